"""Recovery of families from tensors of known mechanisms with scatter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import adjusted_rand_score

from common.voigt import tensor_from_voigt, voigt_from_tensor
from seismic.families import closeness, find_families
from verification.answers.clustering.known_truth import lognormal, turned
from verification.rows import Row

RADIANS_PER_TURN = 2.0  # A turn by s moves the direction of a symmetric traceless tensor by at most 2 s.


@dataclass(frozen=True)
class Recovery:
    """Adjusted Rand index and number of families (scatter, threshold, repeat).

    scatter: largest turns, degrees. threshold: of closeness. certain (scatter, threshold): whether geometry makes the
    recovery certain.
    """

    scatter: NDArray
    threshold: NDArray
    certain: NDArray
    index: NDArray
    families: NDArray


def certainly_recovered(mechanisms: NDArray, scatter: float, threshold: float) -> bool:
    """True if every draw must be recovered; mechanisms (m, 3, 3) traceless, scatter in degrees (largest turn).

    Two particles of one mechanism are at most 4 s apart in direction, two of different ones at least their mechanisms'
    angle less 4 s. If the first is within the angle of the threshold and the second beyond it, one leader covers each
    mechanism and nothing else, whichever particle it is.
    """
    reach = 2.0 * RADIANS_PER_TURN * scatter
    angle = np.degrees(np.arccos(threshold))
    return bool(reach <= angle < least_angle(mechanisms) - reach)


def least_angle(mechanisms: NDArray) -> float:
    """Smallest angle, degrees, between the directions of two of the mechanisms (m, 3, 3)."""
    between = closeness(mechanisms[:, None], mechanisms[None])
    return float(np.degrees(np.arccos(between[~np.eye(len(mechanisms), dtype=bool)].max())))


def recover(settings: dict, seed: int) -> Recovery:
    """Families of particles drawn around the mechanisms, for every scatter and threshold, `repeats` times."""
    mechanisms = tensor_from_voigt(np.array(settings["mechanisms"], dtype=float))
    scatters, thresholds = settings["scatter"], settings["closeness"]
    shape = (len(scatters), len(thresholds), settings["repeats"])
    index, families = np.empty(shape), np.empty(shape, int)
    truth = np.arange(settings["particles"]) % len(mechanisms)
    for row, scatter in enumerate(scatters):
        for repeat in range(settings["repeats"]):
            generator = np.random.default_rng([seed, row, repeat])
            size = lognormal(len(truth), 1.0, settings["log_potency_spread"], generator)
            potency = voigt_from_tensor(size[:, None, None] * turned(mechanisms[truth], scatter, generator))
            for column, threshold in enumerate(thresholds):
                label, leader = find_families(potency, threshold)
                index[row, column, repeat] = adjusted_rand_score(truth, label)
                families[row, column, repeat] = len(leader)
    certain = [
        [certainly_recovered(mechanisms, scatter, threshold) for threshold in thresholds] for scatter in scatters
    ]
    return Recovery(np.array(scatters), np.array(thresholds), np.array(certain), index, families)


def family_rows(settings: dict, found: Recovery, allowed: dict) -> list[Row]:
    """Rows on the measure itself, on what geometry makes certain, and on the rest at the shown threshold."""
    count = len(settings["mechanisms"])
    index, families = found.index[found.certain], found.families[found.certain]
    worst = families.flat[np.argmax(np.abs(families - count))] if families.size else count
    where = f"{np.count_nonzero(found.certain)} cells of the table, {found.index.shape[2]} draws each"
    rows = [
        _turned_about_null_axis(allowed["exact"]),
        Row.relative(
            "families: adjusted Rand index where geometry makes recovery certain, least",
            1.0, float(index.min(initial=1.0)), allowed["exact"],
            f"{where}: 4 s <= arccos(closeness) < {_angle(settings):.0f} - 4 s degrees, outlined in the figure",
        ),
        Row.relative(
            "families: number where geometry makes recovery certain, worst",
            count, float(worst), allowed["exact"], where,
        ),
    ]  # fmt: skip
    column = int(np.argmin(np.abs(found.threshold - settings["shown_closeness"])))
    for row, scatter in enumerate(found.scatter):
        name = f"families: closeness {found.threshold[column]:g}, turned by up to {scatter:g} degrees"
        mean = found.index[row, column].mean()
        number = found.families[row, column].mean()
        rows.append(Row.relative(f"{name}: mean adjusted Rand index", 1.0, float(mean)))
        rows.append(Row.relative(f"{name}: mean number of families", count, float(number)))
    return rows


def _angle(settings: dict) -> float:
    return least_angle(tensor_from_voigt(np.array(settings["mechanisms"], dtype=float)))


def _turned_about_null_axis(allowed: float) -> Row:
    """A double couple turned about its null axis by t: its direction moves by 2 t, the most there is."""
    degrees = np.arange(0.0, 91.0, 10.0)
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    shear = np.diag([1.0, -1.0, 0.0])
    turn = np.zeros((len(degrees), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = cosine
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -sine, sine, 1.0
    found = closeness(shear, turn @ shear @ np.swapaxes(turn, 1, 2))
    error = float(np.max(np.abs(found - np.cos(2.0 * np.radians(degrees)))))
    return Row(
        "closeness of a double couple to itself turned by 30 degrees about its null axis (error: worst of 0 to 90)",
        0.5, float(found[3]), error, allowed, "cos(2 x 30 degrees)",
    )  # fmt: skip
