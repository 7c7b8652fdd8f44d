"""Catalogues of known truth, and whether the intervals of the comparison hold it: (share given, share held)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from catalogs import completeness
from catalogs.exposure import total_interval
from catalogs.mechanisms import AxesSample, compare_axes
from catalogs.settings import ComparisonSettings
from catalogs.size_measures import fit
from verification.statistics.samples import LN10, simulated_sizes


def detected_sizes(generator: np.random.Generator, case: dict) -> NDArray:
    """log10 sizes (count,) with slope b, cut off at `span`, seen with a normal ramp of deviation `fade` about 0.

    Rounded to multiples of bin_width, if there is one. Without `fade` all above 0 are seen.
    """
    count, fade, width = case["count"], case.get("fade", 0.0), case.get("bin_width", 0.0)
    lowest = 4.0 * fade
    found = np.empty(0)
    while len(found) < count:
        x = simulated_sizes(generator, 20 * count, case["b"], case.get("span", np.inf)) - lowest
        found = np.append(found, x[generator.random(len(x)) < norm.cdf(x / fade)] if fade else x)
    found = found[:count]
    return np.round(found / width) * width if width else found


def size_coverage(case: dict, chosen: dict, seed: list[int]) -> tuple[float, float]:
    """Of b of the law that is quoted, above a cut chosen from the sizes."""
    generator = np.random.default_rng(seed)
    given = held = 0
    for index in range(chosen["catalogues"]):
        x = detected_sizes(generator, case)
        width = completeness.rounding(x)
        cut = completeness.completeness(x, width)
        settings = ComparisonSettings(resamplings=chosen["resamplings"], seed=index)
        b = fit(x, cut, width, True, settings).quoted if np.isfinite(cut) else None
        given += b is not None
        held += b is not None and b.lower <= case["b"] <= b.upper
    return given / chosen["catalogues"], held / max(given, 1)


def axes_coverage(case: dict, chosen: dict, seed: list[int]) -> tuple[float, float]:
    """Of the angle between the mean P axes, the record's turned by `turn` degrees; events of a day are alike."""
    generator = np.random.default_rng(seed)
    held = 0
    for index in range(chosen["catalogues"]):
        model = _axes(generator, case["model"], 1, case["spread"], 0.0)
        record = _axes(generator, *case["record"], case["spread"], case["turn"])
        low, high = compare_axes(model, record, index, chosen["resamplings"])["mean_angle_interval"][0]
        held += low <= case["turn"] <= high
    return 1.0, held / chosen["catalogues"]


def _axes(generator: np.random.Generator, days: int, each: int, spread: float, turn: float) -> AxesSample:
    """Frames turned about their B axis by `turn`, then at random by each day and each event, spread in degrees."""
    blocks = np.repeat(np.arange(days), each)
    daily = generator.normal(size=(days, 3))[blocks] * (each > 1)
    scatter = Rotation.from_rotvec(np.radians(spread) * daily)
    scatter *= Rotation.from_rotvec(np.radians(spread) * generator.normal(size=(len(blocks), 3)))
    turned = Rotation.from_rotvec([0.0, np.radians(turn), 0.0]).apply(np.eye(3))
    axes = np.einsum("eij,aj->eai", scatter.as_matrix(), turned)
    return AxesSample(axes, generator.normal(size=(len(blocks), 3)), blocks)


def sum_coverage(case: dict, chosen: dict, seed: list[int]) -> tuple[float, float]:
    """Of what is expected in `days`, potency or number of events: bursts on random days, sizes of a law cut off."""
    generator = np.random.default_rng(seed)
    rate = case["b"] * LN10
    counted = case.get("counted", False)
    top = np.exp(-rate * case["span"])
    mean = 1.0 if counted else rate / (LN10 - rate) * (10 ** case["span"] * top - 1.0) / (1.0 - top)
    truth = case["bursts"] * case["each"] * mean
    given = held = 0
    for _ in range(chosen["catalogues"]):
        sums = np.zeros(case["days"])
        for day in generator.integers(case["days"], size=generator.poisson(case["bursts"])):
            x = simulated_sizes(generator, case["each"], case["b"], case["span"])
            sums[day] += len(x) if counted else np.sum(10.0**x)
        low, high = total_interval(sums, chosen["resamplings"], generator)
        given += bool(np.isfinite(low))
        held += bool(low <= truth <= high)
    return given / chosen["catalogues"], held / max(given, 1)
