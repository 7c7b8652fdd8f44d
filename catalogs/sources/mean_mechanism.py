"""The turn between the mean mechanisms of two catalogues, and two tests of it: may it be none, may it be random?

The mean mechanism is the frame of principal axes of the sum of T T^T - P P^T over the sources with three clear axes,
each counted once. The turn is the least rotation of the model's frame to the record's (Kagan 1991). Errors come from
the jackknife over blocks (`sources.jackknife`) of the rotation of each frame. A model that ran once has no blocks: its
frame is taken to scatter as that of so many recorded events. Where the sum has two principal values that are nearly
equal, as in a girdle, the frame is hardly known, and the error says so.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalogs.sources.jackknife import Scatter, effective_blocks
from catalogs.sources.mechanisms import HALF_TURNS, KAGAN_LIMIT, AxesSample, frames, kagan_angle, random_frames
from common.source_tensors import principal_axes

DRAWS = 9999  # Draws of the errors of the turn, and of random frames.


def rotation_between(first: NDArray, second: NDArray) -> NDArray:
    """Rotation vector (..., 3), radians, of the least rotation that turns one double couple into another.

    first, second (..., 3, 3): rows P, B, T, unit vectors of either sense; leading dimensions broadcast. Its length is
    `kagan_angle`.
    """
    first, second = np.broadcast_arrays(frames(first), frames(second))
    traces = np.einsum("...ai,...ai,ha->...h", first, second, HALF_TURNS)
    turned = first * HALF_TURNS[traces.argmax(axis=-1)][..., :, None]
    matrix = np.einsum("...ai,...aj->...ij", second, turned)
    return Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec().reshape(*matrix.shape[:-1])


def mechanism_turn(model: AxesSample, record: AxesSample, generator: np.random.Generator) -> dict[str, NDArray]:
    """The turn, degrees, its 95 % interval, both p-values and the turn that the test notices; names as in
    catalogs.compare.layout.

    Empty without sources that have three clear axes in both catalogues, or with fewer than two blocks of the record.
    """
    frame, scatter, count = [], [], []
    for side in (model, record):
        clear = np.isfinite(side.axes).all(axis=(1, 2))
        count.append(int(clear.sum()))
        if not count[-1]:
            return {}
        own, of = _mean_frame(side.axes[clear], side.labels[clear])
        frame.append(own)
        scatter.append(of)
    if scatter[1] is None:
        return {}
    both = scatter[1].times(1.0 + count[1] / count[0])
    if model.blocks is not None and scatter[0] is not None:
        both = scatter[0] + scatter[1]
    turn = float(kagan_angle(*frame))
    lengths = both.lengths(DRAWS, generator)
    off, noticed = np.degrees(lengths), float(np.degrees(both.noticed(lengths)))
    random = kagan_angle(random_frames(DRAWS, generator), np.eye(3))
    reach = np.quantile(off, 0.95)
    found = {
        "mechanism_turn": turn,
        "mechanism_turn_interval": np.clip([turn - reach, turn + reach], 0.0, KAGAN_LIMIT),
        "mechanism_turn_p_value": (1 + np.sum(off >= turn)) / (DRAWS + 1),
        "mechanism_turn_random_p_value": (1 + np.sum(random <= turn)) / (DRAWS + 1),
        "mechanism_turn_noticed": noticed if noticed < KAGAN_LIMIT else np.inf,
    }
    return {name: np.array(value, float) for name, value in found.items()}


def _mean_frame(axes: NDArray, labels: NDArray) -> tuple[NDArray, Scatter | None]:
    """Frame (3, 3) of the mean mechanism of axes (event, 3, 3), and the scatter of its rotation; None of one block."""
    labels = np.unique(labels, return_inverse=True)[1].reshape(-1)
    pressure, tension = axes[:, 0], axes[:, 2]
    tensor = tension[:, :, None] * tension[:, None, :] - pressure[:, :, None] * pressure[:, None, :]
    counts = np.bincount(labels)
    sums = np.zeros((len(counts), 3, 3))
    np.add.at(sums, labels, tensor)
    whole = principal_axes(sums.sum(axis=0))
    if len(counts) < 2:
        return whole, None
    moved = rotation_between(principal_axes(sums.sum(axis=0) - sums), whole)
    return whole, Scatter.of(moved, np.zeros(3), max(effective_blocks(counts) - 1.0, 1.0))
