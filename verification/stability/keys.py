"""Keys of all knobs, in the order of the page: what the rules need to know, without loading any mechanics."""

KEYS = (
    "stiffness", "poisson", "friction", "cohesion", "dilation", "residual", "stress", "size", "offset", "levels",
    "length", "tolerance", "walls", "time_step", "damping", "float32", "shapes", "seeds_0_50", "seeds_50_100",
    "mistakes",
)  # fmt: skip
SEEDS = "seeds_([0-9]+)_([0-9]+)"  # key of the scenes that are drawn by these seeds, the last one left out
SEVERAL_SEEDS = tuple(f"seeds_{first}_{first + 50}" for first in range(0, 400, 50))  # of the target `extremes`
