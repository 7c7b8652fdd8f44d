"""Where trials are run: points in the unit cube of the calibrated quantities, in which the prior is uniform."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc


def sobol_points(count: int, quantities: int, seed: int) -> NDArray:
    """A scrambled Sobol sequence: (point, quantity) in [0, 1). The first points are those of any shorter sequence."""
    powers = int(np.ceil(np.log2(max(count, 2))))
    return qmc.Sobol(quantities, scramble=True, rng=np.random.default_rng(seed)).random_base2(powers)[:count]
