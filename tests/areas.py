"""Areas of polygons, for tests."""

import numpy as np


def polygon_area(polygon: np.ndarray) -> float:
    """Signed area, m2, positive counter-clockwise; polygon (corner, 2) m."""
    x, y = np.asarray(polygon, float).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
