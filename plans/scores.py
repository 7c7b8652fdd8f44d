"""How good kept forecasts were, once the months that they were made for are recorded.

A forecast is an outcome.nc that was kept: what it says of a step that began after its last recorded event. It is scored
when the record covers the whole step, and if the mine file now mines its openings in the same steps as the forecast.
Nothing of it is computed again.

Layout of forecast_scores.nc
----------------------------
Dimensions: row (a step of a forecast), quantity (number, potency: m3, largest: log10 m3), interval (lower, upper: 95
%), said (a chance that was given for a row).

  forecast, file (row)                   index in the list `forecasts` of the mine file, and the file as written there
  plan, step, start, end (row)           names and dates
  status (row)                           "scored"; "not recorded yet"; "known": the record reached its beginning when
                                         the forecast was made, so it is no forecast; "mined otherwise"; "no floor": no
                                         event in the runs of the plan says from which size on events count
  difference (row)                       what is mined otherwise, in words; else empty
  median (row, quantity), range (row, quantity, interval)   of the forecast
  recorded (row, quantity)               what is recorded, from the forecast's floor on; -inf: no event is largest
  place (row, quantity)                  share of the forecast below it, plus half of what is equal: uniform if the
                                         forecast is good
  inside (row, quantity)                 1: within the range
  gain (row) nats                        mean information gain of the recorded places over uniform ones
  floor (row) log10 m3                   from which events count
  said_row, said_opening, said_distance (m), said_size, said_magnitude, said_chance (said)   chances of the duration
  happened (said)                        1: there was such an event
  rate_chance (said)                     chance at the rate of the record that the forecast was made with; NaN where
                                         none is known
Attributes: mine, sentences (JSON: all of it in words, for the report), config_hash, source_hash, made_from, versions.
"""

import json
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.comparison_settings import DatedStep
from catalogs.event_density import box_around, information_gain
from catalogs.exposure import DAY, common_period, window
from catalogs.jackknife import INTERVAL_95
from catalogs.location_errors import location_errors
from catalogs.sizes import log_potency
from common.errors import InputError
from plans.hazard import chance_of
from plans.layout import ANY
from plans.record import is_covered
from plans.runs import Geometry
from plans.settings import Opening, ScoreSlice

QUANTITIES = ("number", "potency", "largest")
SCORED, NOT_YET, KNOWN = "scored", "not recorded yet", "known"
MINED_OTHERWISE, NO_FLOOR = "mined otherwise", "no floor"
BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.


def score(forecasts: Sequence[xr.Dataset], record: xr.Dataset, grid: xr.Dataset, settings: ScoreSlice) -> xr.Dataset:
    """The scores of kept forecasts; layout as at the head of this module.

    forecasts: outcomes (plans.layout), those of settings.forecasts; record, grid: of the mine now. Raises InputError
    for one of another mine, for one that holds no forecast, and for one with an opening that the mine no longer has.
    """
    if record.attrs["mine"] != settings.mine:
        raise InputError(f"forecasts: the record is of mine {record.attrs['mine']}, not of {settings.mine}")
    rows: list[dict] = []
    said: list[dict] = []
    for number, (forecast, kept) in enumerate(zip(forecasts, settings.forecasts, strict=True)):
        try:
            for row, chances in _rows(forecast, record, grid, settings):
                said += [one | {"said_row": len(rows)} for one in chances]
                rows.append(row | {"forecast": number, "file": kept.file})
        except InputError as error:
            raise InputError(f"forecasts.{number}: {kept.file}: {error}") from error
    return _dataset(rows, said).assign_attrs(mine=settings.mine)


def _rows(
    forecast: xr.Dataset, record: xr.Dataset, grid: xr.Dataset, settings: ScoreSlice
) -> Iterator[tuple[dict, list[dict]]]:
    """A row for each step of a forecast, and the chances that were given for it."""
    if forecast.attrs["mine"] != settings.mine:
        raise InputError(f"of mine {forecast.attrs['mine']}, not of {settings.mine}")
    ahead = json.loads(forecast.attrs["steps_ahead"])
    if not ahead:
        raise InputError("holds no forecast: the record had reached all steps when it was made; leave it out")
    floor = float(forecast.attrs["floor"])
    for step in dated_steps(forecast):
        row: dict = {"plan": forecast.attrs["plan"], "step": step.name, "start": step.start, "end": step.end}
        row |= {"floor": floor, "status": KNOWN, "difference": "", **nothing()}
        chances: list[dict] = []
        if step.name in ahead:
            row |= {"status": NOT_YET, **_told(forecast, step)}
            if is_covered(record, step):
                row["difference"] = mined_otherwise(forecast, step, settings)
                row["status"] = MINED_OTHERWISE if row["difference"] else SCORED if np.isfinite(floor) else NO_FLOOR
        if row["status"] == SCORED:
            recorded = _Recorded(forecast, record, grid, step)
            row |= recorded.numbers(row) | {"gain": recorded.gain()}
            chances = recorded.chances()
        yield row, chances


def mined_otherwise(forecast: xr.Dataset, step: DatedStep, settings: ScoreSlice) -> str:
    """How the mine file now differs from a forecast in what is mined up to a step, in words; empty if it does not."""
    mine = {one.name: one for one in settings.steps}
    if step.name not in mine:
        return f"the mine file has no step {step.name}"
    now = mine[step.name]
    if (now.start, now.end) != (step.start, step.end):
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


def nothing() -> dict:
    """Columns of a row that is not scored."""
    unknown = np.full(len(QUANTITIES), np.nan)
    pairs = np.full((len(QUANTITIES), 2), np.nan)
    found = {"median": unknown, "range": pairs, "recorded": unknown, "place": unknown, "gain": np.nan}
    return found | {"inside": np.zeros(len(QUANTITIES), np.int8)}


def _draws(forecast: xr.Dataset, step: DatedStep) -> list[NDArray]:
    """Draws of each quantity, without those that the forecast does not know."""
    return [forecast[f"forecast_{name}"].sel(step=step.name).values for name in QUANTITIES]


def _told(forecast: xr.Dataset, step: DatedStep) -> dict:
    """What the forecast said of a step."""
    draws = _draws(forecast, step)
    quantiles = [np.quantile(one, [INTERVAL_95[0], 0.5, INTERVAL_95[1]], method="nearest") for one in draws]
    return {"median": np.array([one[1] for one in quantiles]), "range": np.array([one[[0, 2]] for one in quantiles])}


class _Recorded:
    """What is recorded of a step that a forecast was made for."""

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
        self.error = np.hypot(location_errors(record)[inside], float(grid.attrs["fine_cell"])) / np.sqrt(3.0)
        self.days = float((end - start) / DAY)
        self.days_before = _days_before(record, until)
        named = zip(forecast["opening"].values, forecast["opening_step"].values, strict=True)
        openings = [Opening(name=str(name), step=str(mined)) for name, mined in named if name != ANY]
        self.geometry = Geometry.of(grid, openings, self.steps)

    def numbers(self, row: dict) -> dict:
        """What is recorded, and where in the draws it lies."""
        largest = float(self.size.max()) if len(self.size) else -np.inf
        recorded = np.array([len(self.size), self.potency.sum(), largest])
        draws = _draws(self.forecast, self.step)
        place = [np.mean(one < value) + 0.5 * np.mean(one == value) for one, value in zip(draws, recorded, strict=True)]
        known = np.array([not np.isnan(one).any() for one in draws])
        low, high = row["range"].T
        inside = known & (low <= recorded) & (recorded <= high)
        return {"recorded": recorded, "place": np.where(known, place, np.nan), "inside": inside.astype(np.int8)}

    def gain(self) -> float:
        """Mean information gain of the recorded places, nats per event; NaN without an event."""
        if not len(self.location):
            return np.nan
        own = self.forecast["event_step"].values == self.number
        events = self.forecast["event_location"].values[own]
        box = box_around(self.location, events, margin=BOX_MARGIN * float(self.error.max()))
        return float(information_gain(self.location, events, self.error, box).mean())

    def chances(self) -> list[dict]:
        """Each chance that was given, and whether it happened."""
        forecast = self.forecast
        distances = [float(one) for one in forecast["distance"].values]
        now, then = (self._nearness(places, max(distances)) for places in (self.location, self.location_before))
        found = []
        given = forecast["chance"].sel(period=self.step.name).values
        for opening, name in enumerate(forecast["opening"].values):
            if name != ANY and self.geometry.mined[opening] > self.number:
                continue
            for column, distance in enumerate(distances):
                for place, size in enumerate(forecast["size_log_potency"].values):
                    chance = float(given[opening, column, place])
                    if np.isnan(chance):
                        continue
                    near = now[:, opening] <= distance
                    earlier = int(((then[:, opening] <= distance) & (self.size_before >= size)).sum())
                    rate = earlier * self.days / self.days_before if self.days_before > 0.0 else np.nan
                    found.append(
                        {
                            "said_opening": str(name),
                            "said_distance": distance,
                            "said_size": str(forecast["size"].values[place]),
                            "said_magnitude": float(forecast["size_magnitude"].values[place]),
                            "said_chance": chance,
                            "happened": int((near & (self.size >= size)).any()),
                            "rate_chance": float(chance_of(np.array(rate), np.array(1.0))),
                        }
                    )
        return found

    def _nearness(self, places: NDArray, farthest: float) -> NDArray:
        """Distance (event, opening + 1), m, from each opening that is mined by the step, and from any."""
        away = self.geometry.distances(places, self.number, farthest)
        return np.column_stack([away, away.min(axis=1, initial=np.inf)])


def _days_before(record: xr.Dataset, until: np.datetime64) -> float:
    """Days that the record covers before a time; NaN if it does not say so, or for no time."""
    common = common_period(record)
    return max(float((until - np.datetime64(common[0], "ns")) / DAY), 0.0) if common else np.nan


def _dataset(rows: list[dict], said: list[dict]) -> xr.Dataset:
    """Rows and chances as variables."""
    texts = ("file", "plan", "step", "start", "end", "status", "difference")
    data: dict = {"forecast": ("row", np.array([row["forecast"] for row in rows], np.int32))}
    data |= {name: ("row", np.array([row[name] for row in rows], object)) for name in texts}
    for name, dims, unit in (
        ("median", ("row", "quantity"), ""),
        ("range", ("row", "quantity", "interval"), ""),
        ("recorded", ("row", "quantity"), ""),
        ("place", ("row", "quantity"), "1"),
        ("inside", ("row", "quantity"), "1"),
        ("gain", ("row",), "1"),
        ("floor", ("row",), "log10(m3)"),
    ):
        data[name] = (dims, np.array([row[name] for row in rows]), {"units": unit} if unit else {})
    columns = {"said_row": np.int32, "said_opening": object, "said_distance": float, "said_size": object}
    columns |= {"said_magnitude": float, "said_chance": float, "happened": np.int8, "rate_chance": float}
    units = {"said_distance": "m", "said_chance": "1", "happened": "1", "rate_chance": "1"}
    for name, kind in columns.items():
        attributes = {"units": units[name]} if name in units else {}
        data[name] = ("said", np.array([one[name] for one in said], kind), attributes)
    return xr.Dataset(data, coords={"quantity": list(QUANTITIES), "interval": ["lower", "upper"]})


def brier(chance: NDArray, happened: NDArray) -> float:
    """Mean squared error of chances (said,): 0 is best, 0.25 is what a chance of one half always gets (Brier 1950)."""
    return float(np.mean((np.asarray(chance) - happened) ** 2))


def log_score(chance: NDArray, happened: NDArray, least: float = 1e-4) -> float:
    """Mean of -ln of the chance of what happened, nats: 0 is best. Chances count as `least` at least, and 1 less at
    most."""
    sure = np.clip(np.asarray(chance, float), least, 1.0 - least)
    return float(-np.mean(np.where(happened, np.log(sure), np.log1p(-sure))))
