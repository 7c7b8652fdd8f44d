"""Spread of a catalogue's numbers as variances by source: chance, way of loading, cells, closeness."""
