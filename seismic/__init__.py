"""From plastic strain to seismic events: potency, families, clusters, events."""
