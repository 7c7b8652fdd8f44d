"""Shares of pairs of catalogues found to differ in location: with a shift, and of one process (false alarms)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f, ncf

from catalogs.compare.locations import compare_locations
from verification.answers.statistics.samples import clustered_locations
from verification.comparisons import monte_carlo_error, reaching, vanishing
from verification.rows import Row

# Centres of three steps, each at a distance of 1 from the two others.
STEP_CENTRES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.75**0.5, 0.0]])


@dataclass(frozen=True)
class Power:
    """Share of shifts found by the comparison (found) and by Hotelling's test, and that test's exact power (best)."""

    pairs: int
    found: float
    hotelling: float
    best: float


def false_alarms(settings: dict, seed: int) -> dict[str, float]:
    """Share of pairs of clustered catalogues of one process that are said to differ, by situation."""
    shares = {}
    for number, (name, (first, second)) in enumerate(settings["one_process"].items()):
        generator = np.random.default_rng([seed, number])
        alarms = 0
        for index in range(settings["pairs"]):
            (x, x_blocks), (y, y_blocks) = (clustered_locations(generator, *one) for one in (first, second))
            alarms += _p_value(x, y, x_blocks, y_blocks, index, settings["resamplings"], settings) <= settings["level"]
        shares[name] = alarms / settings["pairs"]
    return shares


def find_shift(settings: dict, seed: int) -> Power:
    """Share of pairs in which a shift of independent events along x, in blocks of a day, is found."""
    chosen, level = settings["shift"], settings["level"]
    generator = np.random.default_rng([seed, 99])
    events = chosen["events"]
    days = np.arange(events) * chosen["days"] // events
    shift = np.array([chosen["metres"], 0.0, 0.0])
    found = hotelling = 0
    for index in range(chosen["pairs"]):
        x, y = chosen["spread"] * generator.normal(size=(2, events, 3))
        y = y + shift
        found += _p_value(x, y, days, days, index, chosen["resamplings"], settings) <= level
        hotelling += hotelling_p_value(x, y) <= level
    pairs = chosen["pairs"]
    return Power(pairs, found / pairs, hotelling / pairs, hotelling_power(events, shift / chosen["spread"], level))


def _p_value(
    x: NDArray, y: NDArray, x_blocks: NDArray, y_blocks: NDArray, index: int, resamplings: int, settings: dict
) -> float:
    distances = np.array([settings["distance"]])
    found = compare_locations(x, y, x_blocks, y_blocks, seed=index, resamplings=resamplings, distances=distances)
    assert found is not None  # both catalogues have blocks enough to be compared
    return found.energy_p_value


def hotelling_p_value(x: NDArray, y: NDArray) -> float:
    """p of one mean for x (event, 3) and y (event, 3), normal with one covariance (Hotelling 1931)."""
    counts, free = (len(x), len(y)), len(x) + len(y) - 2
    covariance = ((counts[0] - 1) * np.cov(x.T) + (counts[1] - 1) * np.cov(y.T)) / free
    apart = x.mean(axis=0) - y.mean(axis=0)
    square = counts[0] * counts[1] / sum(counts) * apart @ np.linalg.solve(covariance, apart)
    dimension = x.shape[1]
    return float(f.sf(square * (free - dimension + 1) / (free * dimension), dimension, free - dimension + 1))


def hotelling_power(events: int, shift: NDArray, level: float) -> float:
    """Exact power of that test: two catalogues of `events`, shift (3,) in standard deviations."""
    dimension = len(shift)
    free = 2 * events - 1 - dimension
    return float(ncf.sf(f.isf(level, dimension, free), dimension, free, events / 2 * np.sum(np.square(shift))))


def location_rows(alarms: dict[str, float], power: Power, settings: dict, allowed: dict) -> list[Row]:
    """Rows of false alarms by situation, and of the power."""
    shift = settings["shift"]
    rows = [
        alarm_row(f"one process, {name}", share, settings["pairs"], settings, allowed) for name, share in alarms.items()
    ]
    chance = monte_carlo_error(shift["power"], power.pairs)
    what = f"shift of {shift['metres']:g} m, {shift['events']} events spread {shift['spread']:g} m"
    return [
        *rows,
        reaching(
            f"{what}: share found (error: short of {shift['power']:g})",
            shift["power"], power.found, shift["power"], 2.0 * chance,
            f"judged as {shift['power']:g} within two Monte Carlo standard errors ({chance:.4f} each, {power.pairs} "
            f"pairs); Hotelling's test, the best for a shift, finds {power.best:.3f}, of these {power.hotelling:.3f}",
        ),
        Row.relative(
            f"{what}: share found, less Hotelling's of the same catalogues, plus its exact power",
            shift["power"], power.found - power.hotelling + power.best, None,
            "takes the luck of these draws out: both tests find the same pairs but for a few",
        ),
    ]  # fmt: skip


def alarm_row(name: str, share: float, pairs: int, settings: dict, allowed: dict) -> Row:
    """Row of the share of pairs of one process that are said to differ, of which only too many are an error.

    The test has to hold for clusters that are found from the record itself, too, and so is cautious where few of them
    are known (study coverage).
    """
    level = settings["level"]
    remark = f"{pairs} pairs, Monte Carlo standard error {monte_carlo_error(level, pairs):.4f}"
    quantity = f"{name}: share of pairs said to differ (p <= {level:g}; error: above {level:g})"
    return Row(quantity, level, share, max(0.0, share - level), allowed["false_alarms"], remark)


def compare_steps(settings: dict, apart: float, shift: float, pairs: int, seed: list[int]) -> tuple[float, float]:
    """Share of pairs of catalogues said to differ, and mean energy distance, m; the second moved by `shift` m along x.

    Three steps, `apart` m from each other, of `events` each in either catalogue, spread `spread` m per coordinate.
    """
    chosen = settings["steps"]
    generator = np.random.default_rng(seed)
    steps = np.repeat(np.arange(len(STEP_CENTRES)), chosen["events"])
    days = np.arange(len(steps)) // chosen["events_a_day"]
    centre = apart * STEP_CENTRES[steps]
    distance, found = np.array([settings["distance"]]), []
    for index in range(pairs):
        x, y = centre + chosen["spread"] * generator.normal(size=(2, len(steps), 3))
        one = compare_locations(
            x, y + np.array([shift, 0.0, 0.0]), days, days, seed=index, resamplings=settings["resamplings"],
            distances=distance, model_steps=steps, record_steps=steps,
        )  # fmt: skip
        assert one is not None  # every step has more than one day of events in either catalogue
        found.append((one.energy_p_value <= settings["level"], one.energy_distance))
    share, energy = np.mean(found, axis=0)
    return float(share), float(energy)


def step_rows(settings: dict, seed: int, allowed: dict) -> list[Row]:
    """False alarms, energy distance without a shift, and power, at each distance between the steps."""
    chosen, rows = settings["steps"], []
    for number, apart in enumerate(chosen["apart"]):
        alarms, energy = compare_steps(settings, apart, 0.0, chosen["alike_pairs"], [seed, 200 + number])
        power, _ = compare_steps(settings, apart, chosen["metres"], chosen["shifted_pairs"], [seed, 300 + number])
        what = f"three steps {apart:g} m apart"
        rows += [
            alarm_row(f"{what}, one process", alarms, chosen["alike_pairs"], settings, allowed),
            vanishing(f"{what}, one process: mean energy distance (m)", energy, allowed["energy"]),
            reaching(
                f"{what}, shift of {chosen['metres']:g} m: share found (error: short of {chosen['power']:g})",
                chosen["power"], power, chosen["power"], remark=f"{chosen['shifted_pairs']} pairs",
            ),
        ]  # fmt: skip
    return rows
