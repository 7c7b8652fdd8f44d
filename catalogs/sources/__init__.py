"""Single sources and their catalogues: sizes, mechanisms, completeness; QuakeML, ParaView and the twin."""
