"""Results of a mine in files for other programs: VTU, DXF, OMF and CSV, in the mine's own coordinates."""
