"""Mines whose excavations are derived from recorded data: one module per mine, each with `excavations(folder, ...)`."""
