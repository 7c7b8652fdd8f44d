"""Scores of kept forecasts, once the months that they were made for are recorded, and the scores in sentences.

A forecast is an outcome.nc that was kept: its draws and chances for a step that began after its last recorded event. It
is scored when the record covers the whole step, and if the mine file now mines its openings in the same steps as the
forecast. Nothing of it is computed again.

Layout of forecast_scores.nc: ROW_FIELDS and CHANCE_FIELDS. Dimensions: row (a step of a forecast), quantity (number,
potency: m3, largest: log10 m3), interval (lower, upper: 95 %), chance (one that was given for a row).

Attributes: mine, sentences (JSON: all of it in words, for the report), and those of a job's provenance (common.job).
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike, NDArray

from catalogs.compare.exposure import DAY, common_period, window
from catalogs.compare.locations import box_around, information_gain, location_errors
from catalogs.report.text import DOWN, UP, beside, fixed, number, plural, typeset, whole
from catalogs.settings import DatedStep
from catalogs.sources.jackknife import INTERVAL_95
from catalogs.sources.sizes import log_potency
from common.datasets import read_dataset
from common.errors import InputError
from common.event_table import read_events
from common.fields import TEXT, Field
from plans.hazard import chance_of
from plans.kept_forecasts import read_forecast
from plans.layout import ANY
from plans.record import is_covered
from plans.runs import Geometry
from plans.settings import Opening, ScoreSlice

QUANTITIES = ("number", "potency", "largest")
SCORED = "scored"
NOT_YET = "not recorded yet"
KNOWN = "known"  # The record reached the beginning of the step when the forecast was made, so it is no forecast.
MINED_OTHERWISE = "mined otherwise"
NO_FLOOR = "no floor"  # No event in the runs of the plan says from which size on events count.
BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.
MIN_PROBABILITY = 1e-4  # Smaller probabilities count as this in the logarithmic score.


def _field(name: str, dims: str, unit: str, meaning: str, dtype: DTypeLike = np.float64) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


ROW_FIELDS = (
    _field("forecast", "row", "", "index in the list `forecasts` of the mine file", np.int32),
    _field("file", "row", "", "file of the forecast, as written there", TEXT),
    _field("plan", "row", "", "name of the plan", TEXT),
    _field("step", "row", "", "name of the step", TEXT),
    _field("start", "row", "", "first date of the step", TEXT),
    _field("end", "row", "", "first date after it", TEXT),
    _field("status", "row", "", "scored, or why it is not: see the constants of plans.scores", TEXT),
    _field("difference", "row", "", "what is mined otherwise, in words; else empty", TEXT),
    _field("median", "row quantity", "", "median of the forecast"),
    _field("range", "row quantity interval", "", "95 % range of the forecast"),
    _field("recorded", "row quantity", "", "what is recorded, from the floor on; -inf: no event is largest"),
    _field("place", "row quantity", "1", "share of the draws below it, plus half of what is equal: uniform if good"),
    _field("inside", "row quantity", "1", "1: within the range", np.int8),
    _field("gain", "row", "1", "mean information gain of the recorded places over uniform ones, nats"),
    _field("floor", "row", "log10(m3)", "size from which events count"),
)
CHANCE_FIELDS = {  # by the name of the attribute of ForecastChance
    "row": _field("chance_row", "chance", "", "row that the chance is for", np.int32),
    "opening": _field("chance_opening", "chance", "", "opening near which the event is expected", TEXT),
    "distance": _field("chance_distance", "chance", "m", "distance within which it is expected"),
    "size": _field("chance_size", "chance", "", "class of its size", TEXT),
    "magnitude": _field("chance_magnitude", "chance", "", "moment magnitude of the class"),
    "forecast_probability": _field(
        "forecast_probability", "chance", "1", "chance of such an event while the step lasts"
    ),
    "occurred": _field("occurred", "chance", "1", "1: there was such an event", np.int8),
    "rate_probability": _field(
        "rate_probability", "chance", "1", "chance at the rate of the record that the forecast had"
    ),
}


@dataclass(frozen=True)
class ForecastChance:
    """A chance that a forecast gave for its step, and its outcome.

    Of an event of a class of size (name, moment magnitude) or larger within a distance (m) of an opening, the
    probability that was forecast; occurred: 1 if there was one, else 0; rate_probability: that of a constant rate, NaN
    where none is known. row: number of the row.
    """

    row: int
    opening: str
    distance: float
    size: str
    magnitude: float
    forecast_probability: float
    occurred: int
    rate_probability: float


def score_stage(given: Mapping, *, record: Path, grid: Path) -> xr.Dataset:
    """The scores of the forecasts that a slice (ScoreSlice) names, with their sentences; record, grid: of the mine now.

    Raises InputError as score.
    """
    settings = ScoreSlice.of(given, "forecasts")
    forecasts = [read_forecast(one.file, f"forecasts.{index}") for index, one in enumerate(settings.forecasts)]
    scores = score(forecasts, read_events(record), read_dataset(grid), settings)
    return scores.assign_attrs(sentences=json.dumps(sentences(scores), ensure_ascii=False))


def score(forecasts: Sequence[xr.Dataset], record: xr.Dataset, grid: xr.Dataset, settings: ScoreSlice) -> xr.Dataset:
    """The scores of kept forecasts, in the layout of this module.

    forecasts: outcomes (plans.layout), those of settings.forecasts; record, grid: of the mine now. Raises InputError
    for one of another mine, for one that holds no forecast, and for one with an opening that the mine no longer has.
    """
    if record.attrs["mine"] != settings.mine:
        raise InputError(f"forecasts: the record is of mine {record.attrs['mine']}, not of {settings.mine}")
    rows: list[dict] = []
    chances: list[ForecastChance] = []
    for index, (forecast, source) in enumerate(zip(forecasts, settings.forecasts, strict=True)):
        try:
            for row, recorded in _rows(forecast, record, grid, settings):
                chances += recorded.chances(len(rows)) if recorded else []
                rows.append(row | {"forecast": index, "file": source.file})
        except InputError as error:
            raise InputError(f"forecasts.{index}: {source.file}: {error}") from error
    return _dataset(rows, chances).assign_attrs(mine=settings.mine)


def _rows(
    forecast: xr.Dataset, record: xr.Dataset, grid: xr.Dataset, settings: ScoreSlice
) -> Iterator[tuple[dict, "RecordedStep | None"]]:
    """A row for each step of a forecast, and what is recorded of the step if it is scored."""
    if forecast.attrs["mine"] != settings.mine:
        raise InputError(f"of mine {forecast.attrs['mine']}, not of {settings.mine}")
    ahead = json.loads(forecast.attrs["steps_ahead"])
    if not ahead:
        raise InputError("holds no forecast: the record had reached all steps when it was made; leave it out")
    floor = float(forecast.attrs["floor"])
    for step in dated_steps(forecast):
        row: dict = {"plan": forecast.attrs["plan"], "step": step.name, "start": step.start, "end": step.end}
        row |= {"floor": floor, "status": KNOWN, "difference": "", **unscored()}
        recorded = None
        if step.name in ahead:
            row |= {"status": NOT_YET, **_forecast_ranges(forecast, step)}
            if is_covered(record, step):
                row["difference"] = mined_otherwise(forecast, step, settings)
                row["status"] = MINED_OTHERWISE if row["difference"] else SCORED if np.isfinite(floor) else NO_FLOOR
        if row["status"] == SCORED:
            recorded = RecordedStep(forecast, record, grid, step)
            row |= recorded.numbers(row) | {"gain": recorded.gain()}
        yield row, recorded


def mined_otherwise(forecast: xr.Dataset, step: DatedStep, settings: ScoreSlice) -> str:
    """Difference, in words, between the mine file and a forecast in what is mined up to a step; empty without any."""
    mine = {one.name: one for one in settings.steps}
    if step.name not in mine:
        return f"the mine file has no step {step.name}"
    now = mine[step.name]
    if window(now.model_dump()) != window(step.model_dump()):
        return f"{step.name} was from {step.start} to {step.end}, and is from {now.start} to {now.end}"

    def until(steps: Sequence[DatedStep], openings: Iterable[tuple[str, str]]) -> dict[str, str]:
        names = [one.name for one in steps]
        mined = ["", *names[: names.index(step.name) + 1]]
        return {opening: when for opening, when in openings if when in mined}

    columns = (forecast[name].values.astype(str) for name in ("opening", "opening_step"))
    then = until(dated_steps(forecast), (one for one in zip(*columns, strict=True) if one[0] != ANY))
    today = until(settings.steps, ((one.name, one.step) for one in settings.openings))
    for opening in [*then, *today]:
        if then.get(opening) != today.get(opening):
            was, has = (
                f"mined in {one[opening]}"
                if one.get(opening)
                else "mined before"
                if opening in one
                else "not mined by then"
                for one in (then, today)
            )
            return f"{opening} is {was} in the forecast, and {has} in the mine file"
    return ""


def dated_steps(forecast: xr.Dataset) -> list[DatedStep]:
    """The steps of an outcome."""
    columns = (forecast[name].values for name in ("step", "start", "end"))
    return [
        DatedStep(name=str(name), start=str(start), end=str(end)) for name, start, end in zip(*columns, strict=True)
    ]


def unscored() -> dict:
    """Columns of a row that is not scored."""
    unknown = np.full(len(QUANTITIES), np.nan)
    pairs = np.full((len(QUANTITIES), 2), np.nan)
    row = {"median": unknown, "range": pairs, "recorded": unknown, "place": unknown, "gain": np.nan}
    return row | {"inside": np.zeros(len(QUANTITIES), np.int8)}


def _draws(forecast: xr.Dataset, step: DatedStep) -> list[NDArray]:
    """Draws of each quantity of a step."""
    return [forecast[f"forecast_{name}"].sel(step=step.name).values for name in QUANTITIES]


def _forecast_ranges(forecast: xr.Dataset, step: DatedStep) -> dict:
    """Median and 95 % range of each quantity of a step."""
    draws = _draws(forecast, step)
    quantiles = [np.quantile(one, [INTERVAL_95[0], 0.5, INTERVAL_95[1]], method="nearest") for one in draws]
    return {"median": np.array([one[1] for one in quantiles]), "range": np.array([one[[0, 2]] for one in quantiles])}


class RecordedStep:
    """The record of a step that a forecast was made for."""

    def __init__(self, forecast: xr.Dataset, record: xr.Dataset, grid: xr.Dataset, step: DatedStep):
        self.forecast, self.step = forecast, step
        self.steps = dated_steps(forecast)
        self.number = [one.name for one in self.steps].index(step.name)
        floor, size = float(forecast.attrs["floor"]), log_potency(record["potency"].values)
        counted = (record["resolved"].values == 1) & ~(size < floor)
        start, end = window(step.model_dump())
        time = record["time"].values
        # a constant rate knows no more than the forecast did
        until = np.minimum(start, np.datetime64(forecast.attrs["recorded_until"] or "NaT", "ns"))
        inside, before = counted & (time >= start) & (time < end), counted & (time <= until)
        self.size, self.location = size[inside], record["location"].values[inside]
        self.potency = record["potency"].values[inside]
        self.size_before, self.location_before = size[before], record["location"].values[before]
        error = np.hypot(location_errors(record), float(grid.attrs["fine_cell"])) / np.sqrt(3.0)
        self.error = error[inside]
        # Of the record alone, the same for all forecasts of the step: events of its own would widen a forecast's box.
        known = (record["resolved"].values == 1) & (time < end)
        self.box_places, self.box_margin = record["location"].values[known], BOX_MARGIN * error[known].max(initial=0.0)
        self.days = float((end - start) / DAY)
        self.days_before = _days_before(record, until)
        named = zip(forecast["opening"].values, forecast["opening_step"].values, strict=True)
        openings = [Opening(name=str(name), step=str(mined)) for name, mined in named if name != ANY]
        self.geometry = Geometry.of(grid, openings, self.steps)

    def numbers(self, row: dict) -> dict:
        """Recorded quantities, and the place of each in the draws."""
        largest = float(self.size.max()) if len(self.size) else -np.inf
        recorded = np.array([len(self.size), self.potency.sum(), largest])
        draws = _draws(self.forecast, self.step)
        place = [np.mean(one < value) + 0.5 * np.mean(one == value) for one, value in zip(draws, recorded, strict=True)]
        known = np.array([not np.isnan(one).any() for one in draws])
        low, high = row["range"].T
        inside = known & (low <= recorded) & (recorded <= high)
        return {"recorded": recorded, "place": np.where(known, place, np.nan), "inside": inside.astype(np.int8)}

    def gain(self) -> float:
        """Information gain of the recorded places, nats per event: the mean of the runs, each a map of its own, over
        uniform events in the box of the record; NaN without an event."""
        if not len(self.location):
            return np.nan
        own = self.forecast["event_step"].values == self.number
        events, run = (self.forecast[name].values[own] for name in ("event_location", "event_run"))
        box = box_around(self.box_places, margin=float(self.box_margin))
        gains = [
            information_gain(self.location, events[run == one], self.error, box).mean() for one in self.counted_runs
        ]
        return float(np.mean(gains))

    @property
    def counted_runs(self) -> NDArray:
        """Numbers of the forecast's runs whose events count."""
        return np.flatnonzero(np.isfinite(self.forecast["number"].values[:, 0, 0]))

    def chances(self, row: int) -> list[ForecastChance]:
        """Forecast probabilities of this step, each with its outcome; row: number of the row of this step.

        Openings that are mined in later steps, and probabilities that are NaN, are left out.
        """
        forecast = self.forecast
        distances = [float(one) for one in forecast["distance"].values]
        now, then = (self._nearness(places, max(distances)) for places in (self.location, self.location_before))
        chances = []
        probability = forecast["chance"].sel(period=self.step.name).values
        for opening, name in enumerate(forecast["opening"].values):
            if name != ANY and self.geometry.mined[opening] > self.number:
                continue
            for column, distance in enumerate(distances):
                for place, size in enumerate(forecast["size_log_potency"].values):
                    if np.isnan(probability[opening, column, place]):
                        continue
                    near = now[:, opening] <= distance
                    earlier = int(((then[:, opening] <= distance) & (self.size_before >= size)).sum())
                    rate = earlier * self.days / self.days_before if self.days_before > 0.0 else np.nan
                    chances.append(
                        ForecastChance(
                            row,
                            str(name),
                            distance,
                            str(forecast["size"].values[place]),
                            float(forecast["size_magnitude"].values[place]),
                            float(probability[opening, column, place]),
                            int((near & (self.size >= size)).any()),
                            float(chance_of(np.array(rate), np.array(1.0))),
                        )
                    )
        return chances

    def _nearness(self, places: NDArray, farthest: float) -> NDArray:
        """Distance (event, opening + 1), m, from each opening that is mined by the step, and from any."""
        away = self.geometry.distances(places, self.number, farthest)
        return np.column_stack([away, away.min(axis=1, initial=np.inf)])


def _days_before(record: xr.Dataset, until: np.datetime64) -> float:
    """Days that the record covers before a time; NaN if it does not say so, or for no time."""
    common = common_period(record)
    return max(float((until - np.datetime64(common[0], "ns")) / DAY), 0.0) if common else np.nan


def _dataset(rows: Sequence[dict], chances: Sequence[ForecastChance]) -> xr.Dataset:
    """Rows and chances as variables."""
    values = {field: [row[field.name] for row in rows] for field in ROW_FIELDS}
    values |= {field: [getattr(one, name) for one in chances] for name, field in CHANCE_FIELDS.items()}
    variables = {
        field.name: (field.dims, np.array(column, field.dtype), field.attributes) for field, column in values.items()
    }
    return xr.Dataset(variables, coords={"quantity": list(QUANTITIES), "interval": ["lower", "upper"]})


def brier(forecast_probability: NDArray, occurred: NDArray) -> float:
    """Mean squared error of probabilities (chance,): 0 is best, 0.25 is that of always one half (Brier 1950)."""
    return float(np.mean((np.asarray(forecast_probability) - occurred) ** 2))


def log_score(forecast_probability: NDArray, occurred: NDArray) -> float:
    """Mean of -ln of the probability of what occurred, nats: 0 is best.

    Probabilities are clipped to MIN_PROBABILITY and 1 less that.
    """
    clipped = np.clip(np.asarray(forecast_probability, float), MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
    return float(-np.mean(np.where(occurred, np.log(clipped), np.log1p(-clipped))))


def sentences(scores: xr.Dataset) -> list[str]:
    """Sentences on each forecast: its range, what was recorded, whether that is within; then on steps not scored.

    scores: forecast_scores.nc.
    """
    lines = []
    for row in range(scores.sizes["row"]):
        part = scores.isel(row=row)
        if str(part["status"].values) == SCORED:
            lines.append(" ".join(_scored(scores, part, row)))
    for place in np.unique(scores["forecast"].values):
        own = scores.isel(row=np.flatnonzero(scores["forecast"].values == place))
        lines += _not_scored(own, _forecast_name(own.isel(row=0)))
    return lines


def _forecast_name(row: xr.Dataset) -> str:
    """A forecast by its plan and file."""
    return f"plan {row['plan'].values}, {Path(str(row['file'].values)).name}"


def _not_scored(own: xr.Dataset, name: str) -> Iterator[str]:
    """Sentences on the steps of a forecast that are not scored, with the reason; own: rows of this forecast."""
    status, steps = own["status"].values, own["step"].values
    known, waiting, without = (steps[status == one] for one in (KNOWN, NOT_YET, NO_FLOOR))
    if len(waiting):
        verb = "is" if len(waiting) == 1 else "are"
        yield f"Forecast of {name}: {', '.join(waiting)} {verb} not recorded to the end yet."
    for row in np.flatnonzero(status == MINED_OTHERWISE):
        yield f"Forecast of {name}: {steps[row]} is not scored, since {own['difference'].values[row]}."
    if len(without):
        yield (
            f"Forecast of {name}: {', '.join(without)} cannot be scored. Runs of the plan make no event, so nothing "
            "says from which size on events count."
        )
    if len(known):
        yield (
            f"Forecast of {name}: steps up to {known[-1]} are no forecasts, since the record had reached them when it "
            "was made."
        )


def _scored(scores: xr.Dataset, part: xr.Dataset, row: int) -> Iterator[str]:
    """The sentences of one row."""
    quantities = {
        name: (*part["range"].values[place], part["median"].values[place], part["recorded"].values[place])
        for place, name in enumerate(QUANTITIES)
    }
    within = ["within the range" if one else "outside of the range" for one in part["inside"].values]
    low, high, middle, recorded = quantities["number"]
    floor = typeset(f"log P {float(part['floor']):.1f}")
    verb = "was" if recorded == 1 else "were"
    yield (
        f"Forecast for {part['step'].values} ({_forecast_name(part)}): {whole(low)} to {whole(high)} events from "
        f"{floor} on (median {whole(middle)}); {whole(recorded)} {verb} recorded, {within[0]}."
    )
    low, high, middle, recorded = quantities["potency"]
    if np.isfinite(middle):
        value, ends = beside(recorded, (low, high))
        yield f"Potency: {ends} m³ (median {number(middle)}); {value} m³ recorded, {within[1]}."
        low, high, middle, recorded = quantities["largest"]
        ends, value = _sizes(low, high, recorded)
        yield f"Largest event: {ends} (median {_size(middle)}); {value} recorded, {within[2]}."
    gain = float(part["gain"])
    if np.isfinite(gain):
        yield (
            f"Recorded places are {number(np.exp(gain), 2)} times as probable as under a uniform rate (information "
            f"gain {fixed(gain, 2)} nats per event)."
        )
    own = scores["chance_row"].values == row
    if own.any():
        yield _chances(*(scores[name].values[own] for name in ("forecast_probability", "occurred", "rate_probability")))


def _size(size: float) -> str:
    return f"log P {fixed(size, 1)}" if np.isfinite(size) else "none"


def _sizes(low: float, high: float, recorded: float) -> tuple[str, str]:
    """A range of sizes and the recorded one (log10 m3) as texts that tell whether it is inside; -inf: no event."""
    tenths = partial(fixed, decimals=1)
    if np.isfinite([low, high, recorded]).all():
        value, ends = beside(recorded, (low, high), tenths)
        return f"log P {ends}", f"log P {value}"
    if np.isfinite([high, recorded]).all():  # the range begins without an event
        value, ends = beside(recorded, (min(recorded, high), high), tenths)
        return f"none to log P {ends.rpartition(' to ')[2]}", f"log P {value}"
    if np.isfinite(high):
        begin = f"log P {tenths(low, rounding=DOWN)}" if np.isfinite(low) else "none"
        return f"{begin} to log P {tenths(high, rounding=UP)}", _size(recorded)
    return "none", _size(recorded)


def _chances(forecast_probability: NDArray, occurred: NDArray, rate_probability: NDArray) -> str:
    """Scores of the chances, and of those of a constant rate."""
    probability = forecast_probability
    text = (
        f"Of {plural(len(probability), 'chance')} of an event near an opening, {number(probability.sum(), 2)} were "
        f"expected to happen and {int(occurred.sum())} did. Their Brier score is "
        f"{fixed(brier(probability, occurred), 3)}, their logarithmic score "
        f"{fixed(log_score(probability, occurred), 2)} (0 is best for both)"
    )
    if np.isfinite(rate_probability).all():
        text += (
            f"; at the constant rate of the record before, {fixed(brier(rate_probability, occurred), 3)} and "
            f"{fixed(log_score(rate_probability, occurred), 2)}"
        )
    return text + "."
