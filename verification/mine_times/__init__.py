"""Processor time and memory of shipped mines by number of cells and of steps, from the logs of their stages."""
