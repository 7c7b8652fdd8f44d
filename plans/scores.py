"""How good kept forecasts were, once the months that they were made for are recorded.

A forecast is an outcome.nc that was kept: what it says of a step that began after its last recorded event. It is scored
when the record covers the whole step. Nothing of it is computed again.

Layout of forecast_scores.nc
----------------------------
Dimensions: row (a step of a forecast), quantity (number, potency: m3, largest: log10 m3), interval (lower, upper: 95
%), said (a chance that was given for a row).

  plan, step, start, end, status (row)   names, dates, and "scored", "not recorded yet" or "known": the record covered
                                         its beginning when the forecast was made, so it is no forecast
  median (row, quantity), range (row, quantity, interval)   of the forecast
  recorded (row, quantity)               what is recorded, from the forecast's floor on; -inf: no event is largest
  place (row, quantity)                  share of the forecast below it, plus half of what is equal: uniform if the
                                         forecast is good
  inside (row, quantity)                 1: within the range
  gain (row) nats                        mean information gain of the recorded places over uniform ones
  floor (row) log10 m3                   from which events count
  said_row, said_opening, said_distance (m), said_size, said_magnitude, said_chance (said)   chances of the duration
  happened (said)                        1: there was such an event
  rate_chance (said)                     chance at the rate of the record before the forecast; NaN where none is known
Attributes: mine, sentences (JSON: all of it in words, for the report), config_hash, source_hash, made_from, versions.
"""

import json
from collections.abc import Sequence

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
from plans.settings import Opening

QUANTITIES = ("number", "potency", "largest")
SCORED, NOT_YET, KNOWN = "scored", "not recorded yet", "known"
BOX_MARGIN = 3.0  # Standard deviations of a location between all events and the faces of the box.
MIN_EVENTS_BEFORE = 1  # Recorded events before the forecast that a constant rate needs.


def score(forecasts: Sequence[xr.Dataset], record: xr.Dataset, grid: xr.Dataset, mine: str) -> xr.Dataset:
    """The scores of kept forecasts; layout as at the head of this module.

    forecasts: outcomes (plans.layout); record, grid: of the mine now. Raises InputError for one of another mine, for
    one that holds no forecast, and for one with an opening that the mine no longer has.
    """
    rows: list[dict] = []
    said: list[dict] = []
    for forecast in forecasts:
        plan = forecast.attrs["plan"]
        if forecast.attrs["mine"] != mine or record.attrs["mine"] != mine:
            found = ", ".join({forecast.attrs["mine"], record.attrs["mine"]} - {mine})
            raise InputError(f"forecasts: {plan} or the record is of mine {found}, not of {mine}")
        ahead = json.loads(forecast.attrs["steps_ahead"])
        if not ahead:
            raise InputError(
                f"forecasts: {plan} holds no forecast: the record covered all its steps when it was made; leave it out"
            )
        for step in dated_steps(forecast):
            row: dict = {"plan": plan, "step": step.name, "start": step.start, "end": step.end}
            row |= {"floor": float(forecast.attrs["floor"]), "status": KNOWN, **nothing()}
            if step.name in ahead:
                row["status"] = SCORED if is_covered(record, step) else NOT_YET
                row |= _told(forecast, step)
            if row["status"] == SCORED:
                recorded = _Recorded(forecast, record, grid, step)
                row |= recorded.numbers(row) | {"gain": recorded.gain()}
                said += [one | {"said_row": len(rows)} for one in recorded.chances()]
            rows.append(row)
    return _dataset(rows, said).assign_attrs(mine=mine)


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
        inside, before = counted & (time >= start) & (time < end), counted & (time < start)
        self.size, self.location = size[inside], record["location"].values[inside]
        self.potency = record["potency"].values[inside]
        self.size_before, self.location_before = size[before], record["location"].values[before]
        self.error = np.hypot(location_errors(record)[inside], float(grid.attrs["fine_cell"])) / np.sqrt(3.0)
        self.days = float((end - start) / DAY)
        self.days_before = _days_before(record, start)
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


def _days_before(record: xr.Dataset, start: np.datetime64) -> float:
    """Days that the record covers before a time; NaN if it does not say so."""
    common = common_period(record)
    return max(float((start - np.datetime64(common[0], "ns")) / DAY), 0.0) if common else np.nan


def _dataset(rows: list[dict], said: list[dict]) -> xr.Dataset:
    """Rows and chances as variables."""
    texts = ("plan", "step", "start", "end", "status")
    data: dict = {name: ("row", np.array([row[name] for row in rows], object)) for name in texts}
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
