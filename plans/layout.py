"""Layout of outcome.nc: every variable with its dimensions, unit and meaning, in one table; and a plan's summary.

Dimensions: run (the plan's own first), step (the dated ones, in order), opening (those that the plan mines, then "any"
for all together), distance, size (the classes of the mine file, the smallest first; none without any), period (the
steps, then "all": those that are ahead of the record, or all if none is), interval (lower, upper: 95 %), event (of the
plan's own run and of its members), draw, xyz. Steps, openings, sizes, periods and intervals carry their names,
distances their value.

Events count if they are resolved and at least as large as `floor`, the largest of the floors of the own runs of all
plans, of their members and, with a record, of the cut of its comparison. Runs on other cells have a larger floor. So
numbers of all kinds of runs are counted from `shared_floor`, too.

NaN: all numbers of runs in which rock found no equilibrium, numbers by opening of runs on other cells or in other rock,
a size where there is no event, forecasts of steps that are not ahead, chances near an opening in steps before it is
mined, and of a size below the floor.

Attributes: mine, plan, floor and shared_floor (log10 m3), shear_modulus (Pa), recorded_until (ISO; time of the last
recorded event, or the later end that the configuration states; empty without a record), steps_ahead (JSON), differs_in
(JSON: sections of the mine file in which the plan differs, apart from the sequence), contains and lacks (JSON: what the
intervals contain and lack), law_source ("record" | "model" | "none"), law_events, law_b, law_bound (log10 m3; medians),
law_b_interval, law_bound_interval, runs (the plan's own and its members), number_dispersion (variance over mean of the
number that a step is forecast with), and those of a job's provenance (common.job). ratio_text is a sentence for the
reader. record_factor: lower end (2.5 %), median and upper end of the factor that multiplies chances in the steps of the
period "all" (plans.factors); NaN without a record. collapsed: step in which rock of the plan's own run found no
equilibrium, empty if it did in all: such a plan is not compared, and its numbers are those of what was computed.
fallen_volume (m3): rock that came loose and fell in the dated steps, the mean of the plan's own run and its members.
"""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike, NDArray

from catalogs.settings import ALL_STEPS
from common.datasets import read_dataset
from common.errors import InputError
from common.fields import FILE_REMEDY, TEXT, Field
from common.source_tensors import moment_magnitude

ANY = "any"  # Name, in addition to those of the openings, of all of them together.
OWN, MEMBER, COARSE, DRAW = "own", "member", "coarse", "draw"
LOG_M3 = "log10(m3)"
RATE_BY_MEASURES = "rate_by_measures"  # attribute, JSON: numbers of the steps ahead (MeasuredRate), weights of measures
LIKE_OWN = (OWN, MEMBER)  # Kinds of runs that differ from the plan's own by chance only.


def _field(name: str, dims: str, unit: str, meaning: str, dtype: DTypeLike = np.float64) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


FIELDS = (
    # what the runs made
    _field("run_kind", "run", "", "own, member (of the ensemble), coarse (doubled cells) or draw (of the rock)", TEXT),
    _field("number", "run step opening", "1", "events from the floor on, by the nearest opening mined by then"),
    _field("potency", "run step opening", "m3", "their summed potency"),
    _field("squares", "run step opening", "m6", "sum of their squared potencies"),
    _field("largest", "run step opening", LOG_M3, "largest of them"),
    _field("number_within", "run step opening distance", "1", "events within a distance of an opening mined by then"),
    _field("shared_number", "run step", "1", "events from the shared floor on"),
    _field("whole_potency", "run step", "m3", "summed potency of all events, of whatever size"),
    _field("energy_released", "run step", "J", "energy released (Salamon 1984)"),
    _field("failed_volume", "run step", "m3", "rock that failed"),
    # the plan
    _field("start", "step", "", "first date, ISO, UTC", TEXT),
    _field("end", "step", "", "first date after it", TEXT),
    _field("days", "step", "d", "duration"),
    _field("mined", "step", "m3", "rock that the step is the first to mine, on the grid"),
    _field("made_by", "step", "", "digest of states and events of all runs: the same in plans that share it", TEXT),
    _field("opening_step", "opening", "", "step that mines it; empty: mined before the first of them", TEXT),
    _field("opening_volume", "opening", "m3", "rock that it is the first to mine, on the grid"),
    # hazard
    _field("size_magnitude", "size", "1", "moment magnitude of the class"),
    _field("size_log_potency", "size", LOG_M3, "its potency, by the shear modulus of the host"),
    _field("period_days", "period", "d", "duration of the steps of the period"),
    _field("expected", "period opening distance", "1", "expected number of events from the floor on"),
    _field("expected_interval", "period opening distance interval", "1", "its 95 % interval"),
    _field("chance", "period opening distance size", "1", "chance of an event of the class or a larger one"),
    _field("chance_interval", "period opening distance size interval", "1", "its 95 % interval"),
    _field("yearly_chance", "period opening distance size", "1", "the same of a year at the rate of the period"),
    _field("yearly_chance_interval", "period opening distance size interval", "1", "its 95 % interval"),
    _field("yearly_number", "period opening distance size", "1", "expected number of such events a year"),
    # forecast of each step that is ahead
    _field("forecast_number", "step draw", "1", "number of events from the floor on"),
    _field("forecast_potency", "step draw", "m3", "their summed potency"),
    _field("forecast_largest", "step draw", LOG_M3, "largest of them; -inf without one"),
    # events of the plan's own run and of its members
    _field("event_location", "event xyz", "m", "location in the mine frame"),
    _field("event_potency", "event", "m3", "potency"),
    _field("event_step", "event", "1", "index of the step", np.int32),
    _field("event_run", "event", "1", "index of the run", np.int32),
    # coordinates
    _field("step", "step", "", "name of the step", TEXT),
    _field("opening", "opening", "", "name of the opening", TEXT),
    _field("size", "size", "", "name of the class of size", TEXT),
    _field("period", "period", "", "name of the step, or all", TEXT),
    _field("interval", "interval", "", "lower and upper end of a 95 % interval", TEXT),
    _field("distance", "distance", "m", "distance from the opening"),
)  # fmt: skip


def new_outcome(values: Mapping[str, Any], attributes: Mapping) -> xr.Dataset:
    """An outcome of these variables, with dimensions, unit and meaning of the table.

    Raises ValueError for a variable that is not in the table, InputError for one that is missing or not of its form.
    """
    fields = {field.name: field for field in FIELDS}
    if foreign := set(values) - set(fields):
        raise ValueError(f"outcome: {', '.join(sorted(foreign))} not in the layout")
    variables = {
        name: (fields[name].dims, np.array(one, object) if fields[name].dtype == TEXT else one, fields[name].attributes)
        for name, one in values.items()
    }
    return check_outcome(xr.Dataset(variables, attrs=attributes), "outcome")


def check_outcome(dataset: xr.Dataset, source: str, remedy: str = FILE_REMEDY) -> xr.Dataset:
    """An outcome with text as the table has it. Raises InputError, one line, where it is not of this form."""
    for name in ("mine", "plan", "floor", "shared_floor", "recorded_until", "steps_ahead"):
        if name not in dataset.attrs:
            raise InputError(f"{source}: attribute {name} is missing; {remedy}")
    dataset = dataset.copy()
    for field in FIELDS:
        if field.dtype == TEXT and field.name in dataset.variables:
            dataset[field.name] = dataset[field.name].astype(TEXT)
        field.check(dataset, source, remedy)
    return dataset


def read_outcome(path: str | os.PathLike) -> xr.Dataset:
    """The outcome of a file. Raises InputError for one that is missing, unreadable or of another form."""
    return check_outcome(read_dataset(path), os.fspath(path))


@dataclass(frozen=True)
class MeasuredRate:
    """Number of a step by laws of measures: value, and lower and upper end of its 95 % interval, from the floor on."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class RunMeans:
    """Means of the plan's own run and its members: number, potency (m3), energy released (J), failed volume (m3);
    largest: log10 potency of the largest event of all these runs, m3, NaN without one."""

    number: float
    potency: float
    energy: float
    failed: float
    largest: float


@dataclass(frozen=True)
class PlanSummary:
    """An outcome of a plan, and the numbers of it that the page shows."""

    outcome: xr.Dataset

    @property
    def name(self) -> str:
        """Name of the plan."""
        return str(self.outcome.attrs["plan"])

    @cached_property
    def steps(self) -> list[str]:
        """Names of its dated steps, in order."""
        return [str(step) for step in self.outcome["step"].values]

    @cached_property
    def ahead(self) -> list[str]:
        """Names of the steps that begin after the last recorded event."""
        return list(json.loads(self.outcome.attrs["steps_ahead"]))

    @property
    def counted(self) -> list[str]:
        """Names of the steps of the period "all" of the hazard: those ahead, or all if none is."""
        return self.ahead or self.steps

    @cached_property
    def openings(self) -> list[str]:
        """Names of the openings that it mines."""
        return [str(name) for name in self.outcome["opening"].values if name != ANY]

    @cached_property
    def measured_rates(self) -> tuple[dict[str, MeasuredRate], dict[str, float]]:
        """Numbers of its steps ahead by modelled measures, by step, and the weight of each measure."""
        values = json.loads(str(self.outcome.attrs.get(RATE_BY_MEASURES, "")) or "{}")
        rates = {name: MeasuredRate(**one) for name, one in values.get("steps", {}).items()}
        return rates, values.get("weights", {})

    @property
    def collapsed(self) -> str:
        """Step in which its own run found no equilibrium; empty if it did in all."""
        return str(self.outcome.attrs.get("collapsed", ""))

    @property
    def fallen(self) -> float:
        """Rock that fell in its dated steps, m3; NaN where an older outcome does not say."""
        return float(self.outcome.attrs.get("fallen_volume", np.nan))

    @cached_property
    def stands(self) -> NDArray:
        """Mask of the runs that have found equilibrium in all steps, (run,)."""
        return np.isfinite(self.outcome["whole_potency"].values).all(axis=1)

    @cached_property
    def is_like_own(self) -> NDArray:
        """Mask of the plan's own run and its members, as far as these stand, (run,)."""
        return np.isin(self.outcome["run_kind"].values, LIKE_OWN) & self.stands

    @cached_property
    def _values(self) -> dict[str, NDArray]:
        """Variables as arrays: a large mine asks for many numbers, one by one."""
        return {str(name): variable.values for name, variable in self.outcome.variables.items()}

    @cached_property
    def _places(self) -> dict[str, dict]:
        """Index along each dimension by its coordinate."""
        dims = ("step", "opening", "distance", "size", "period")
        return {dim: {value: place for place, value in enumerate(self.outcome[dim].values.tolist())} for dim in dims}

    def of_runs(self, name: str, steps: Sequence[str], opening: str | None = None) -> NDArray:
        """A variable of the plan's own run and its members in steps (run, step), near an opening if it has one."""
        values = self._values[name][self.is_like_own][:, [self._places["step"][step] for step in steps]]
        return values if opening is None else values[:, :, self._places["opening"][opening]]

    @property
    def members(self) -> int:
        """Number of members of its ensemble."""
        return int(self.is_like_own.sum()) - 1

    @property
    def runs(self) -> int:
        """Number of its own run and the members."""
        return self.members + 1

    def has_runs(self, kind: str) -> bool:
        """True if it has a run of this kind that stands."""
        return bool(((self.outcome["run_kind"].values == kind) & self.stands).any())

    def has_lost(self, kind: str) -> bool:
        """True if a run of this kind does not stand."""
        return bool(((self.outcome["run_kind"].values == kind) & ~self.stands).any())

    @property
    def asked(self) -> int:
        """Number of its own run and the members, of which some may not stand."""
        return int(np.isin(self.outcome["run_kind"].values, LIKE_OWN).sum())

    def mined_in(self, opening: str) -> str:
        """Name of the dated step that mines an opening; empty for one that is mined before."""
        return str(self._values["opening_step"][self._places["opening"][opening]])

    def mines(self, step: str) -> list[str]:
        """Names of the openings that a step mines."""
        return [name for name in self.openings if self.mined_in(name) == step]

    def _sum(self, name: str, steps: Sequence[str]) -> float:
        return float(sum(self._values[name][self._places["step"][step]] for step in steps))

    def mined(self, steps: Sequence[str]) -> float:
        """Volume that steps mine, m3."""
        return self._sum("mined", steps)

    def days(self, steps: Sequence[str]) -> float:
        """Duration of steps, days."""
        return self._sum("days", steps)

    def dates(self, step: str) -> tuple[str, str]:
        """First date of a step, and first date after it, ISO."""
        place = self._places["step"][step]
        return str(self._values["start"][place]), str(self._values["end"][place])

    def means(self, steps: Sequence[str], opening: str = ANY) -> RunMeans:
        """Means of the runs in steps near an opening. Energy and failed volume are those of all openings."""
        largest = self.of_runs("largest", steps, opening)
        number, potency = (self.of_runs(name, steps, opening).sum(axis=1).mean() for name in ("number", "potency"))
        energy, failed = (self.of_runs(name, steps).sum(axis=1).mean() for name in ("energy_released", "failed_volume"))
        known = float(np.nanmax(largest)) if np.isfinite(largest).any() else np.nan
        return RunMeans(float(number), float(potency), float(energy), float(failed), known)

    @property
    def floor(self) -> float:
        """Smallest size that counts, log10 m3; NaN if nothing failed in any run."""
        return float(self.outcome.attrs["floor"])

    def magnitude(self, log_potency: float) -> float:
        """Moment magnitude of a potency (log10 m3), by the shear modulus of the host rock."""
        return float(moment_magnitude(10.0 ** np.asarray(log_potency) * float(self.outcome.attrs["shear_modulus"])))

    def chance(
        self, opening: str, distance: float, size: str, period: str = ALL_STEPS, yearly: bool = True
    ) -> tuple[float, NDArray]:
        """Chance of an event of a class or a larger one within a distance of an opening, and its interval (2,)."""
        name = "yearly_chance" if yearly else "chance"
        named = {"period": period, "opening": opening, "distance": distance, "size": size}
        place = tuple(self._places[dim][value] for dim, value in named.items())
        return float(self._values[name][place]), self._values[f"{name}_interval"][place]

    def yearly_number(self, opening: str, distance: float, size: str) -> float:
        """Expected number of events of a class or larger a year, within a distance of an opening, in the whole plan."""
        named = {"period": ALL_STEPS, "opening": opening, "distance": distance, "size": size}
        return float(self._values["yearly_number"][tuple(self._places[dim][value] for dim, value in named.items())])

    def own_events(self) -> tuple[NDArray, NDArray, NDArray]:
        """Events of the plan's own run: location (event, 3) m, log10 potency (event,) m3, index of the step."""
        own = self.outcome["event_run"].values == list(self.outcome["run_kind"].values).index(OWN)
        return (
            self.outcome["event_location"].values[own],
            np.log10(self.outcome["event_potency"].values[own]),
            self.outcome["event_step"].values[own],
        )
