"""The stages that rules run: the grid, the elastic history, and a mining step; their forces, checkpoints and finer
cells."""
