"""Coverage and widths of a calibration with instruments, by records and readings of a mine in closed form.

The instruments are four stress cells, an extensometer with two anchors, and a closure that counts from virgin rock.
Each case calibrates the same trials to records and readings of true values.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calibration.fit import Fit
from calibration.instrument_findings import CATALOGUE, by_terms, find
from calibration.settings import CalibrationSettings
from calibration.stages import TrialCatalogues, calibrate_catalogues
from catalogs.figures import style
from common.observation_table import MODELLED, MODELLED_ERROR, READING_FIELDS
from common.processes import call_all
from verification.answers.coverage import closed_form_mine as mine
from verification.answers.coverage.shares import share_at_least, share_at_most
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results
from verification.rows import Row

NUMERICS = ("calibration", "catalogs/compare", "catalogs/sources")  # Folders that the results may change with.
TABLES = (
    Pivot(
        "Right instruments: share of 95 % intervals that hold the truth, median width over that of the catalogue "
        "alone, share of pages that call an instrument out, and that say that catalogue and instruments want other "
        "values",
        r"right, (?P<row>.+): (?P<column>intervals that hold the truth|width over the catalogue's|pages that call "
        r"one out|pages that say other values)(?: \(.*\))?",
        "measured",
    ),
    Pivot(
        "One of six instruments broken: share of pages that call it out and that call another one out, share of 95 % "
        "intervals that hold the truth, r.m.s. shift of the medians over the deviation of the posterior",
        r"broken, (?P<row>.+): (?P<column>pages that call it out|pages that call another out|intervals that hold the "
        r"truth|shift of the medians)(?: \(.*\))?",
        "measured",
    ),
)
POINTS = 2**10  # Sobol points of a round of the posterior.
NAMES = ("cell 1", "cell 2", "cell 3", "cell 4", "extensometer", "closure")
PLACES = (1, 1, 1, 1, 2, 1)  # Of each, read at once.
IS_STRESS = (True, True, True, True, False, False)
CLOSURE = 5  # Number of the instrument that was not zeroed.
LARGEST = np.array([8.0, 6.0, 10.0, 5.0, 20.0, 30.0])  # MPa, mm: its change in the middle of the ranges.
# ln of the change over the range of each quantity (instrument, quantity).
EFFECTS = np.array([[0.5, 0.1], [-0.4, 0.2], [0.3, -0.3], [0.6, 0.0], [0.1, -0.6], [0.0, -0.5]])
CURVATURE = 0.2  # Of the same, over the range of the second quantity.
CHANCE = 0.01  # Of a run, over the largest change.


@dataclass(frozen=True)
class Scene:
    """Rows of the table of readings: instrument (row,), share (row,) of the largest change that a date has, place."""

    dates: int

    @property
    def instrument(self) -> NDArray:
        return np.repeat(np.arange(len(NAMES)), np.array(PLACES) * self.dates)

    @property
    def place(self) -> NDArray:
        """Number (row,) of each place."""
        return np.repeat(np.arange(sum(PLACES)), self.dates)

    @property
    def share(self) -> NDArray:
        along = np.linspace(0.0, 1.0, self.dates + 1)[1:]
        return np.tile(np.sin(0.5 * np.pi * along), sum(PLACES)) * np.where(self.place == len(NAMES) - 1, 0.6, 1.0)

    def modelled(self, points: NDArray) -> NDArray:
        """Values (point, row) at points (point, quantity)."""
        off = points - 0.5
        change = LARGEST * np.exp(off @ EFFECTS.T + CURVATURE * off[:, 1:] ** 2)
        return change[:, self.instrument] * self.share


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of right and of broken instruments, and of readings of other values; a figure of the shares."""
    chosen, parts = results.settings, {}
    for kind in ("cases", "broken"):
        for number, case in enumerate(chosen[kind]):
            parts[f"{kind} {case['name']}"] = partial(measure, chosen, case, [chosen["seed"], len(kind), number])
    parts["apart"] = partial(measure, chosen, {"name": "apart", "apart": chosen["apart"]}, [chosen["seed"], 0, 0])
    found, rows, held = call_all(parts, results.threads), [], {}
    for case in chosen["cases"]:
        name, one = f"right, {case['name']}", found[f"cases {case['name']}"]
        rows += _right_rows(name, one, results.allowed)
        held[name] = one
    for case in chosen["broken"]:
        name, one = f"broken, {case['name']}", found[f"broken {case['name']}"]
        rows += _broken_rows(name, case.get("instrument", 0), one, results.allowed)
        held[name] = one
    rows += _apart_rows(found["apart"], results.allowed)
    return rows, _draw(held)


@dataclass(frozen=True)
class Measured:
    """Results over the records of a case.

    held (record, quantity): the 95 % interval holds the truth; width (record, quantity): over that of the catalogue
    alone, NaN without one; called (record, instrument): the page says that it contradicts all other data; apart
    (record,): the page says that catalogue and instruments want other values; shift (record, quantity): of the median
    by the fault, over the deviation of the posterior without it; NaN without a fault.
    """

    held: NDArray
    width: NDArray
    called: NDArray
    apart: NDArray
    shift: NDArray


def measure(chosen: dict, case: dict, seed: list[int]) -> Measured:
    """Calibrate the trials of a case to its records and readings, one by one."""
    generator = np.random.default_rng(seed)
    case = {key: value for key, value in chosen.items() if key not in ("cases", "broken", "apart")} | case
    faulty = any(key in case for key in ("factor", "offset", "died"))
    scene = Scene(case["dates"])
    points, catalogues = mine.trials(case, case["trials"], case["replicates"], generator)
    noise = CHANCE * LARGEST[scene.instrument] * generator.standard_normal((len(points), len(scene.instrument)))
    modelled = scene.modelled(points) + noise
    by_cells = np.broadcast_to(1.96 * case["cells"] * LARGEST[scene.instrument], modelled.shape)
    for number, events in enumerate(catalogues):
        catalogues[number] = events.assign(
            {MODELLED.name: ("row", modelled[number]), MODELLED_ERROR.name: ("row", by_cells[number])}
        )
    trials = TrialCatalogues(points, catalogues, np.arange(len(points)))
    quantity = {"range": [0, 1], "source": "closed form"}
    settings = CalibrationSettings.read(
        {
            "quantities": [quantity | {"key": f"quantity.{number}"} for number in range(mine.QUANTITIES)],
            "terms": case.get("terms", ["potency", "number", "instruments"]),
            "replicates": case["replicates"],
            "model_error": case["model_error"],
            "complete_above": f"{mine.FLOOR} m^3",
        }
    )
    surrogate = None  # one for all records, as their cut is one
    columns: dict[str, list] = {name: [] for name in Measured.__dataclass_fields__}
    for _ in range(case["broken_records" if faulty else "records"]):
        truth = generator.uniform(size=mine.QUANTITIES)
        other = truth
        if "apart" in case:
            truth[0] = generator.uniform(0.0, 1.0 - case["apart"])
            other = truth + np.array([case["apart"], 0.0])
        record = mine.record(truth, case, generator)
        right = readings(scene, other, case, generator)
        fits = []
        for table in [right, *([spoiled(scene, right, case)] if faulty else [])]:
            known = settings, mine.dated_steps(), trials, record, POINTS, table, surrogate
            fits.append(calibrate_catalogues(*known).fit)
            surrogate = fits[-1].surrogate
        _note(columns, fits, truth, settings.seed)
    return Measured(**{name: np.array(values) for name, values in columns.items()})


def _note(columns: dict[str, list], fits: list[Fit], truth: NDArray, seed: int) -> None:
    """Note the results of the last fit; the first one has no fault."""
    fit = fits[-1]
    low, middle, high = fit.posterior.intervals(0.95)
    found = find(fit, by_terms(fit, seed), seed)
    columns["held"].append((low <= truth) & (truth <= high))
    alone = found.widths.get(CATALOGUE, np.full(len(truth), np.nan))
    columns["width"].append(fit.posterior.width_left() / alone)
    named = [one.name for one in found.contradicts_rest()]
    columns["called"].append([one.name in named for one in found.instruments])
    columns["apart"].append(found.says_other_values())
    right = fits[0].posterior
    deviation = np.sqrt(right.weights @ (right.points - right.weights @ right.points) ** 2)
    shift = (middle - right.intervals(0.95)[1]) / deviation
    columns["shift"].append(shift if len(fits) > 1 else np.full(len(truth), np.nan))


def readings(scene: Scene, truth: NDArray, case: dict, generator: np.random.Generator) -> xr.Dataset:
    """Readings of instruments that work, of these true values: factors, zeros, errors of cells and of readings."""
    instrument, place, count = scene.instrument, scene.place, len(scene.instrument)
    of_place = np.unique(place, return_index=True)[1]
    stated = np.where(IS_STRESS, case["errors"]["stress"], case["errors"]["displacement"])
    modelled = scene.modelled(truth[None])[0]
    value = modelled * np.exp(case["model_error"] * generator.standard_normal(len(NAMES)))[instrument]
    common = case.get("cells_common", 0.5)
    shared, own = generator.standard_normal(len(NAMES))[instrument], generator.standard_normal(count)
    value = value + case["cells"] * LARGEST[instrument] * (np.sqrt(common) * shared + np.sqrt(1.0 - common) * own)
    error = stated[instrument] * case.get("true_errors", 1.0)
    noise = generator.standard_normal(count)
    if case.get("drift", False):  # a random walk of each place whose r.m.s. over the dates is that of the error
        walk = np.cumsum(noise.reshape(len(of_place), -1), axis=1)
        noise = (walk / np.sqrt(np.arange(1, scene.dates + 1).mean())).ravel()
    is_zeroed = instrument != CLOSURE
    zero = (10.0 * LARGEST[instrument[of_place]] * generator.standard_normal(len(of_place)))[place]
    columns: dict[str, Any] = {
        "instrument": np.array(NAMES, object)[instrument],
        "distance": np.where(instrument == NAMES.index("extensometer"), place.astype(float), np.nan),
        "step": np.array([f"{number % scene.dates:02d}" for number in range(count)], object),
        "unit": np.where(np.array(IS_STRESS)[instrument], "MPa", "mm").astype(object),
        "measured": value + error * noise + np.where(is_zeroed, zero, 0.0),
        "measured_error": np.where(case.get("stated", True), stated[instrument], np.nan),
        "zeroed": is_zeroed.astype(np.int8),
    }
    return xr.Dataset({field.name: (field.dims, columns[field.name]) for field in READING_FIELDS})


def spoiled(scene: Scene, table: xr.Dataset, case: dict) -> xr.Dataset:
    """The same readings with the fault of the case in one instrument."""
    number = case.get("instrument", 0)
    own = np.flatnonzero(scene.instrument == number)
    measured = table["measured"].values.copy()
    measured[own] = case.get("factor", 1.0) * measured[own] + case.get("offset", 0.0) * LARGEST[number]
    if case.get("died", False):
        last = len(own) // 2
        measured[own[last:]] = measured[own[max(last - 1, 0)]]
    return table.assign(measured=("row", measured))


def _right_rows(name: str, found: Measured, allowed: dict) -> list[Row]:
    count, records = found.held.size, len(found.held)
    least, most = allowed["least"], allowed["most"]
    rows = [_coverage_row(name, found, least, most)]
    if np.isfinite(found.width).all():
        bound = allowed["narrower"]
        width, quantity = float(np.median(found.width)), f"{name}: width over the catalogue's (error: above {bound:g})"
        rows.append(Row(quantity, np.nan, width, max(0.0, width - bound), 0.0, f"median of {count} intervals"))
    alarms, share = allowed["false_alarms"], float(found.called.any(axis=1).mean())
    quantity = f"{name}: pages that call one out (error: above {alarms:g})"
    rows.append(share_at_most(quantity, 0.0, share, alarms, records, "pages"))
    if np.isfinite(found.width).all():
        share = float(found.apart.mean())
        quantity = f"{name}: pages that say other values (error: above {alarms:g})"
        rows.append(share_at_most(quantity, 0.0, share, alarms, records, "pages"))
    return rows


def _coverage_row(name: str, found: Measured, least: float, most: float) -> Row:
    """The share of intervals that hold the truth, between two bounds."""
    share, count = float(found.held.mean()), found.held.size
    quantity = f"{name}: intervals that hold the truth (error: outside of {least:g} to {most:g})"
    lower, upper = (
        bound(quantity, 0.95, share, end, count, "intervals")
        for bound, end in ((share_at_least, least), (share_at_most, most))
    )
    return lower if lower.error > 0.0 else upper


def _broken_rows(name: str, number: int, found: Measured, allowed: dict) -> list[Row]:
    others = np.delete(np.arange(len(NAMES)), number)
    records, least = len(found.held), allowed["called_out"]
    share = float(found.called[:, number].mean())
    wrong = float(found.called[:, others].any(axis=1).mean())
    shift = float(np.sqrt(np.mean(found.shift**2)))
    quantity = f"{name}: pages that call it out (error: short of {least:g})"
    return [
        share_at_least(quantity, 1.0, share, least, records, "pages"),
        Row(f"{name}: pages that call another out", 0.0, wrong, wrong, None, f"{records} pages"),
        _coverage_row(name, found, allowed["least"], 1.0),
        Row(f"{name}: shift of the medians", 0.0, shift, shift, None, f"{found.shift.size} medians"),
    ]


def _apart_rows(found: Measured, allowed: dict) -> list[Row]:
    least, share = allowed["called_out"], float(found.apart.mean())
    quantity = f"readings of other values than the record: pages that say so (error: short of {least:g})"
    return [share_at_least(quantity, 1.0, share, least, len(found.apart), "pages")]


def _draw(found: dict[str, Measured]) -> Figure:
    """Share of the intervals that hold the truth, case by case, with two Monte Carlo standard errors."""
    figure = style.new_figure(width=style.PAGE_WIDTH, height=0.22 * len(found) + 1.2)
    axes = figure.subplots()
    held = [100.0 * one.held.mean() for one in found.values()]
    error = [200.0 * np.sqrt(0.95 * 0.05 / one.held.size) for one in found.values()]
    what = "truth inside the 95 % interval (%; bars: 2 Monte Carlo errors)"
    plot_errors(axes, list(found), {"": held}, error, truth=95, xlabel=what)
    axes.set_xlim(right=102.0)
    return figure
