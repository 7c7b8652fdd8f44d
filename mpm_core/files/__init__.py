"""Grids and states as netCDF datasets and as VTK files, and the table of every variable that they hold."""
