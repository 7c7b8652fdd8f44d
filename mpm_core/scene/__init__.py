"""The scene that a stage computes, in SI units: materials, stress before mining, steps, solids, and the extent of the
domain."""
