"""Limits of the numerics: one knob at a time is turned to its extremes, and each run is compared with a known truth.

A reduced set runs with the tests. ``snakemake --cores all stability`` runs all of it. A knob is a case of the study.
Its name is its key, in the order of the table. The rules read the keys here without loading any mechanics.
"""

KEYS = (
    "stiffness", "poisson", "friction", "cohesion", "dilation", "residual", "stress", "size", "offset", "levels",
    "length", "tolerance", "walls", "time_step", "damping", "float32", "shapes", "seeds_0_50", "seeds_50_100",
    "mistakes",
)  # fmt: skip
SEEDS = "seeds_([0-9]+)_([0-9]+)"  # Key of the scenes of these seeds, without the last one.
SEVERAL_SEEDS = tuple(f"seeds_{first}_{first + 50}" for first in range(0, 400, 50))  # Target `extremes`.
