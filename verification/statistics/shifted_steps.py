"""Locations of steps that lie apart: a shift of one catalogue is to be found, and none where there is none."""

import numpy as np

from catalogs.locations import compare_locations
from verification.rows import Row

CENTRES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.75**0.5, 0.0]])  # each 1 from the two others


def compare_steps(settings: dict, apart: float, shift: float, pairs: int, seed: list[int]) -> tuple[float, float]:
    """Share of pairs of catalogues said to differ, and mean energy distance, m; the second moved by `shift` m along x.

    Three steps, `apart` m from each other, of `events` each in either catalogue, spread `spread` m per coordinate.
    """
    chosen = settings["steps"]
    generator = np.random.default_rng(seed)
    steps = np.repeat(np.arange(len(CENTRES)), chosen["events"])
    days = np.arange(len(steps)) // chosen["events_a_day"]
    centre = apart * CENTRES[steps]
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
    chosen, level, rows = settings["steps"], settings["level"], []
    for number, apart in enumerate(chosen["apart"]):
        alarms, energy = compare_steps(settings, apart, 0.0, chosen["alike_pairs"], [seed, 200 + number])
        power, _ = compare_steps(settings, apart, chosen["metres"], chosen["shifted_pairs"], [seed, 300 + number])
        what = f"three steps {apart:g} m apart"
        error = (level * (1 - level) / chosen["alike_pairs"]) ** 0.5
        rows += [
            Row(
                f"{what}, one process: share of pairs said to differ (p <= {level:g})",
                level, alarms, abs(alarms - level), allowed["false_alarms"],
                f"{chosen['alike_pairs']} pairs, Monte Carlo standard error {error:.4f}",
            ),
            Row(f"{what}, one process: mean energy distance (m)", 0.0, energy, abs(energy), allowed["energy"]),
            Row(
                f"{what}, shift of {chosen['metres']:g} m: share found (error: short of {chosen['power']:g})",
                chosen["power"], power, max(0.0, chosen["power"] - power), 0.0, f"{chosen['shifted_pairs']} pairs",
            ),
        ]  # fmt: skip
    return rows
