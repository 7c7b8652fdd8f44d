"""Keys of all knobs, in the order of the page: what the rules need to know, without loading any mechanics."""

KEYS = (
    "stiffness", "poisson", "friction", "cohesion", "dilation", "residual", "stress", "size", "offset", "levels",
    "length", "tolerance", "walls", "time_step", "damping", "float32", "shapes", "random_1", "random_2", "mistakes",
)  # fmt: skip
