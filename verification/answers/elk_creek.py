"""Pressure cells and closure stations of Elk Creek's gate roads: modelled beside measured change, as a face passes.

A change counts from the first of the study's distances at which the instrument was read. Rock, gob, and the factor
between what the model says and what an instrument reads are those with the least mean error on panel 1. Panel 2 judges
them, beside elastic rock, no change at all, and what similar places saw when panel 1 passed ("as panel 1").
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import spearmanr

from catalogs.figures import style
from catalogs.records.elk_creek_reader import data_folder
from response.observation_settings import ObservationSlice
from response.observations import observe
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row
from workflow import BASE
from workflow.mines.elk_creek import read_panels
from workflow.mines.elk_creek_instruments import GATE_ROAD, Instrument, read_closure_stations, read_pressure_cells
from workflow.mines.longwall import Panel, seconds

VARIANT = re.compile(r"(?P<rock>\w+)_gob_(?P<gob>\d+)_panel_(?P<panel>\d)_(?P<place>inby|outby)")
FITTED, JUDGED = "1", "2"  # Panels.
DEEP = 6.0  # m from the entry along the borehole, beyond the coal of the ribs that yields around entries.
ALIKE = 4  # Instruments of panel 1 at the most similar distance from the rib, whose mean change is "as panel 1".
DRAWS, LEVEL, SEED = 2000, 0.95, 66  # Of instruments, with replacement; of intervals; of the random generator.
KINDS = {"cell": "stress (MPa)", "closure": "closure (mm)"}
AS_PANEL_1, UNCHANGED, UNSCALED = "as panel 1", "no change", "mine file, factor 1"
AS_IN_MINE_FILE = "brittle", "30"  # Rock, and stiffness of the gob, MPa.
TABLES = (
    Pivot(
        "Mean error of the change on panel 1, with its interval over instruments",
        r"panel 1, (?P<row>[^:]+): mean error, (?P<column>.+)",
        "with interval",
    ),
    Pivot(
        "Mean error of the change on panel 2, with its interval over instruments",
        r"panel 2, (?P<row>[^:]+): mean error, (?P<column>.+)",
        "with interval",
    ),
    Pivot("Factor of each model", r"panel 1, (?P<row>\w+ rock, gob of \d+ MPa): factor, (?P<column>.+)", "measured"),
)


@dataclass(frozen=True)
class Passing:
    """Instruments while a panel passed them.

    rib (instrument,) m: distance from the panel's nearer rib. change (instrument, stage): MPa or mm since the stage
    `first` (instrument,) of each, NaN without readings.
    """

    panel: Panel
    instruments: list[Instrument]
    rib: NDArray
    change: NDArray
    first: NDArray

    def some(self, chosen: NDArray) -> "Passing":
        """Those of the instruments that are chosen (instrument,) bool."""
        kept = [one for one, keep in zip(self.instruments, chosen, strict=True) if keep]
        return Passing(self.panel, kept, self.rib[chosen], self.change[chosen], self.first[chosen])

    @property
    def compared(self) -> NDArray:
        """True (instrument, stage) where a change was measured."""
        return np.isfinite(self.change) & (np.arange(self.change.shape[1]) > self.first[:, None])


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of both panels, and a figure of panel 2. Raises InputError without the recorded data.

    Settings: folder of the recorded data; elevation (m) of the middle of the model's seam; stages: distances (m) of the
    face past the instruments.
    """
    settings = results.settings
    folder = data_folder(BASE / "config" / "verification" / settings["folder"], "settings.folder")
    stages = np.array(settings["stages"], float)
    panels = {panel.name: panel for panel in read_panels(folder)}
    cells = {name: read_pressure_cells(folder, name) for name in (FITTED, JUDGED)}
    stations = read_closure_stations(folder)
    rows, shown = [], {}
    for kind, what in KINDS.items():
        read = cells if kind == "cell" else dict.fromkeys(cells, stations)
        passed = {name: passing(panels[name], read[name], cells[name], stages) for name in read}
        modelled = modelled_changes(results.variants, passed, settings["elevation"], stages)
        made, shown[what] = scores(what, passed, modelled)
        rows += made
        if kind == "cell":
            deep = {name: np.array([cell.depth >= DEEP for cell in own.instruments]) for name, own in passed.items()}
            chosen = {name: own.some(deep[name]) for name, own in passed.items()}
            of_deep = {
                key: {name: change[deep[name]] for name, change in by_panel.items()}
                for key, by_panel in modelled.items()
            }
            what = f"stress, cells at {DEEP:g} m and deeper (MPa)"
            made, shown[what] = scores(what, chosen, of_deep)
            rows += made
    return rows, draw(shown, stages)


def axis_of(panel: Panel) -> NDArray:
    """Unit vector (xy,) of the advance of a panel's face."""
    middle = 0.5 * (panel.tailgate + panel.headgate)
    return (middle[-1] - middle[0]) / np.linalg.norm(middle[-1] - middle[0])


def passing(panel: Panel, read: list[Instrument], cells: list[Instrument], stages: NDArray) -> Passing:
    """What was measured while a panel passed. The distance of the face is that of the site's pressure cells."""
    axis = axis_of(panel)
    across = np.array([-axis[1], axis[0]])
    ribs = [float(np.mean(ends @ across)) for ends in (panel.tailgate, panel.headgate)]
    kept, rib, changes, firsts = [], [], [], []
    for one in read:
        faces = [cell.readings["face"] for cell in cells if cell.site == one.site]
        if not faces:  # The face did not pass this site.
            continue
        face = max(faces, key=len)
        reached = [_first_time(face, stage) for stage in stages]
        value = (1e-6 if one.kind == "cell" else 1e3) * _at(one.readings["value"], reached)
        if np.isfinite(value).sum() < 2:
            continue
        first = int(np.isfinite(value).argmax())
        kept.append(one)
        rib.append(min(abs(float(one.place @ across) - edge) for edge in ribs))
        changes.append(value - value[first])
        firsts.append(first)
    return Passing(panel, kept, np.array(rib), np.array(changes), np.array(firsts))


def _first_time(face: pd.Series, stage: float) -> pd.Timestamp:
    """When the face first reached a distance; NaT where the record does not see it arrive."""
    past = (face >= stage).to_numpy()
    if not past.any() or past[0]:
        return pd.NaT
    return face.index[int(past.argmax())]


def _at(values: pd.Series, times: Iterable[pd.Timestamp]) -> NDArray:
    """Values at times, between two readings in proportion to time; NaN outside of them."""
    known = values.index.to_numpy().astype("datetime64[s]").astype(float)
    asked = np.array([np.nan if time is pd.NaT else time.timestamp() for time in times])
    return np.interp(asked, known, values.to_numpy(), left=np.nan, right=np.nan)


def modelled_changes(
    variants: Mapping[str, Variant], passed: Mapping[str, Passing], elevation: float, stages: NDArray
) -> dict[tuple[str, str], dict[str, NDArray]]:
    """Modelled changes (instrument, stage) by rock and gob, and by panel; NaN where a variant was not run so far."""
    found: dict[tuple[str, str], dict[str, NDArray]] = {}
    for name, variant in variants.items():
        key = VARIANT.fullmatch(name)
        assert key, name
        own = passed[key["panel"]]
        by_panel = found.setdefault((key["rock"], key["gob"]), {})
        changes = by_panel.setdefault(key["panel"], np.full(own.change.shape, np.nan))
        here = [n for n, one in enumerate(own.instruments) if one.site.lower().endswith(f" {key['place']}")]
        if here:
            values = modelled_values(variant, own, here, elevation, stages)
            changes[here] = values - values[np.arange(len(here)), own.first[here]][:, None]
    return found


def modelled_values(variant: Variant, passed: Passing, here: list[int], elevation: float, stages: NDArray) -> NDArray:
    """Vertical compression (MPa) or closure (mm) of the model at some instruments and each stage (instrument, stage).

    Between the ends of two steps it follows in proportion to the advance of the face.
    """
    instruments = [passed.instruments[n] for n in here]
    points, closures = [], []
    for one in instruments:
        x, y = one.place
        if one.kind == "cell":
            points.append({"name": one.label, "at": [x, y, elevation], "measures": "stress"})
        else:
            low, high = elevation - 0.5 * GATE_ROAD, elevation + 0.5 * GATE_ROAD
            closures.append({"name": one.label, "start": [x, y, low], "end": [x, y, high]})
    given = variant.mine.observations_slice() | {"observations": {"points": points, "closures": closures}}
    settings = ObservationSlice.of(given)
    states = (variant.read(f"steps/{step}.nc") for step in variant.step_names)
    table = observe(settings, variant.grid, states).to_dataframe()
    table = table[table["quantity"].isin(["stress zz", "closure"])]
    sign = np.where(table["quantity"] == "stress zz", -1.0, 1.0)
    value = table.assign(value=sign * table["modelled"]).pivot(index="instrument", columns="step", values="value")
    axis = axis_of(passed.panel)
    ends = [step["end"] for step in settings.steps[1:]]
    dates = [pd.Timestamp(date).tz_localize(None) for date in (settings.steps[1]["start"], *ends)]
    faces = np.array([0.5 * np.add(*passed.panel.face(seconds(date))) @ axis for date in dates])
    found = np.full((len(here), len(stages)), np.nan)
    for number, one in enumerate(instruments):
        line = np.mean([other.place @ axis for other in passed.instruments if other.site == one.site])
        series = value.loc[one.label, variant.step_names].to_numpy(float)
        found[number] = np.interp(stages, faces - line, series, left=np.nan, right=np.nan)
    return found


def factor_of(measured: NDArray, modelled: NDArray) -> float:
    """The factor k with the least sum of |measured - k modelled|, values (n,): a weighted median of their ratios."""
    used = np.abs(modelled) > 0.0
    ratio, weight = measured[used] / modelled[used], np.abs(modelled[used])
    order = np.argsort(ratio)
    share = np.cumsum(weight[order])
    return float(ratio[order][np.searchsorted(share, 0.5 * share[-1])])


def as_earlier(fitted: Passing, judged: Passing) -> NDArray:
    """Changes (instrument, stage) of the later panel as similar places saw them when the earlier one passed.

    From one stage to the next it is the mean of those that were measured, and none where nothing was.
    """
    found = np.zeros_like(judged.change)
    order = np.abs(judged.rib[:, None] - fitted.rib).argsort(axis=1, kind="stable")
    since_last = np.diff(fitted.change, axis=1)
    for one, first in enumerate(judged.first):
        for stage in range(first + 1, judged.change.shape[1]):
            added = since_last[order[one], stage - 1]
            known = added[np.isfinite(added)][:ALIKE]
            found[one, stage] = found[one, stage - 1] + (known.mean() if len(known) else 0.0)
    return found


@dataclass(frozen=True)
class Model:
    """Rock and gob with their factor and mean error on panel 1; changes (instrument, stage) without factor by panel."""

    rock: str
    gob: str
    factor: float
    error: NDArray
    changes: Mapping[str, NDArray]

    @property
    def name(self) -> str:
        return f"{self.rock} rock, gob of {self.gob} MPa"

    @property
    def misfit(self) -> float:
        """Mean error on panel 1."""
        return float(np.nanmean(self.error))


@dataclass(frozen=True)
class Shown:
    """Panel 2 for the figure: measured changes and predictions (instrument, stage), by name; name of the chosen one."""

    measured: NDArray
    predicted: dict[str, NDArray]
    chosen: str


def fit_models(fitted: Passing, modelled: Mapping[tuple[str, str], Mapping[str, NDArray]]) -> list[Model]:
    """Each rock and gob with the factor that fits panel 1 best."""
    models = []
    for (rock, gob), changes in modelled.items():
        used = fitted.compared & np.isfinite(changes[FITTED])
        factor = factor_of(fitted.change[used], changes[FITTED][used])
        error = np.where(used, np.abs(fitted.change - factor * changes[FITTED]), np.nan)
        models.append(Model(rock, gob, factor, error, changes))
    return models


def scores(
    what: str, passed: Mapping[str, Passing], modelled: Mapping[tuple[str, str], Mapping[str, NDArray]]
) -> tuple[list[Row], Shown]:
    """Rows of both panels. what: quantity and unit."""
    fitted, judged = passed[FITTED], passed[JUDGED]
    models = fit_models(fitted, modelled)
    rows = [_row(f"panel 1, {one.name}: mean error, {what}", one.misfit, _interval(one.error)) for one in models]
    rows += [_row(f"panel 1, {one.name}: factor, {what}", one.factor, "") for one in models]
    unchanged = np.where(fitted.compared, np.abs(fitted.change), np.nan)
    rows.append(_row(f"panel 1, {UNCHANGED}: mean error, {what}", float(np.nanmean(unchanged)), _interval(unchanged)))
    rocks = dict.fromkeys(one.rock for one in models)
    best = [min((one for one in models if one.rock == rock), key=lambda one: one.misfit) for rock in rocks]
    chosen = min(best, key=lambda one: one.misfit)
    mine = next(one for one in models if (one.rock, one.gob) == AS_IN_MINE_FILE)
    predicted = {f"{one.rock} rock": one.factor * one.changes[JUDGED] for one in best} | {
        UNSCALED: mine.changes[JUDGED],
        AS_PANEL_1: as_earlier(fitted, judged),
        UNCHANGED: np.zeros(judged.change.shape),
    }
    remarks = {f"{one.rock} rock": f"gob of {one.gob} MPa, factor {one.factor:.3g}" for one in best}
    winner = f"{chosen.rock} rock"
    remarks[winner] += ", chosen on panel 1"
    used = judged.compared & np.all([np.isfinite(values) for values in predicted.values()], axis=0)
    errors = {name: np.where(used, np.abs(judged.change - values), np.nan) for name, values in predicted.items()}
    for name, error in errors.items():
        remark = "; ".join(filter(None, [remarks.get(name, ""), _counts(used), _interval(error)]))
        rows.append(_row(f"panel 2, {name}: mean error, {what}", float(np.nanmean(error)), remark))
    for name in (name for name in errors if name != winner):
        less = errors[winner] - errors[name]
        quantity = f"panel 2, {winner} (chosen) less {name}: mean error, {what}"
        rows.append(_row(quantity, float(np.nanmean(less)), _interval(less)))
    for name in (name for name in errors if name != UNCHANGED):
        rank = float(spearmanr(judged.change[used], predicted[name][used]).statistic)
        rows.append(_row(f"panel 2, {name}: rank correlation of the changes, {what}", rank, _counts(used)))
    for one in best:
        quantity = f"panel 2, {one.rock} rock: share of changes within a {LEVEL:.0%} interval, {what}"
        rows.append(_row(quantity, *_held(fitted, judged, one)))
    return rows, Shown(np.where(judged.compared, judged.change, np.nan), predicted, winner)


def _held(fitted: Passing, judged: Passing, model: Model) -> tuple[float, str]:
    """Share of panel 2's changes within the interval of panel 1's residuals at the same distances, and how many."""
    residual = np.where(fitted.compared, fitted.change - model.factor * model.changes[FITTED], np.nan)
    left = judged.change - model.factor * model.changes[JUDGED]
    inside, of = 0, 0
    for stage in range(residual.shape[1]):
        own, later = residual[:, stage], left[judged.compared[:, stage], stage]
        own, later = own[np.isfinite(own)], later[np.isfinite(later)]
        if len(own) > 1 and len(later):
            low, high = np.quantile(own, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
            inside, of = inside + int(((later >= low) & (later <= high)).sum()), of + len(later)
    return (inside / of if of else math.nan), f"{inside} of {of}; interval from the residuals of panel 1"


def _row(quantity: str, value: float, remark: str) -> Row:
    return Row(quantity, math.nan, value, math.nan, None, remark)


def _counts(used: NDArray) -> str:
    return f"{int(used.sum())} changes of {int(used.any(axis=1).sum())} instruments"


def _interval(values: NDArray) -> str:
    """Interval of the mean (instrument, stage) by drawing instruments with replacement, as text."""
    known = np.isfinite(values).any(axis=1)
    total, count = np.nansum(values[known], axis=1), np.isfinite(values[known]).sum(axis=1)
    drawn = np.random.default_rng(SEED).integers(0, len(total), (DRAWS, len(total)))
    low, high = np.quantile(total[drawn].sum(axis=1) / count[drawn].sum(axis=1), [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return f"{LEVEL:.0%} interval over instruments {low:.3g} to {high:.3g}"


def draw(shown: Mapping[str, Shown], stages: NDArray) -> Figure:
    """Panel 2: medians by the distance of the face, and each change beside that of the model chosen on panel 1."""
    figure = style.new_figure(height=9.0)
    for row, (what, one) in enumerate(shown.items()):
        by_stage, scatter = (figure.add_subplot(len(shown), 2, 2 * row + side) for side in (1, 2))
        for series in one.measured:
            by_stage.plot(stages, series, color=style.OUTLINE, linewidth=0.4, alpha=0.5)
        medians = {"measured": one.measured} | {
            name: np.where(np.isfinite(one.measured), values, np.nan)
            for name, values in one.predicted.items()
            if name != UNCHANGED
        }
        for number, (name, values) in enumerate(medians.items()):
            known = np.isfinite(values).any(axis=0)
            color = "black" if name == "measured" else f"C{number - 1}"
            median = np.nanmedian(values[:, known], axis=0)
            by_stage.plot(stages[known], median, marker="o", markersize=3, label=name, color=color, linewidth=1.8)
        by_stage.set_xlabel("distance of the face past the instrument (m)")
        by_stage.set_ylabel("change of " + what.replace(", ", ",\n"))
        by_stage.legend(fontsize=7)
        chosen = one.predicted[one.chosen]
        points = scatter.scatter(chosen, one.measured, c=np.broadcast_to(stages, chosen.shape), s=12, cmap="viridis")
        both = np.isfinite(chosen) & np.isfinite(one.measured)
        ends = [min(chosen[both].min(), one.measured[both].min()), max(chosen[both].max(), one.measured[both].max())]
        scatter.plot(ends, ends, color=style.OUTLINE, linewidth=0.8)
        scatter.set_xlabel(f"change in {one.chosen} (chosen on panel 1)")
        scatter.set_ylabel("measured change")
        figure.colorbar(points, ax=scatter, label="distance of the face (m)")
    return figure
