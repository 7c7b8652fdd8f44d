"""What a plan makes, for the reader: means of its runs by step and opening."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from catalogs.periods import ALL_STEPS
from common.source_tensors import moment_magnitude
from plans.layout import ANY, LIKE_OWN, OWN


@dataclass(frozen=True)
class Made:
    """Means of the plan's own run and its members: number, potency (m3), energy released (J), failed volume (m3);
    largest: log10 potency of the largest event of all these runs, m3, NaN without one."""

    number: float
    potency: float
    energy: float
    failed: float
    largest: float


@dataclass(frozen=True)
class PlanSummary:
    """An outcome (plans.layout) as the page asks for it."""

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
        """Names of the steps that the hazard of the whole plan is of: those ahead, or all if none is."""
        return self.ahead or self.steps

    @cached_property
    def openings(self) -> list[str]:
        """Names of the openings that it mines."""
        return [str(name) for name in self.outcome["opening"].values if name != ANY]

    @cached_property
    def is_like_own(self) -> NDArray:
        """Which runs are the plan's own run and its members, (run,)."""
        return np.isin(self.outcome["run_kind"].values, LIKE_OWN)

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
        """How many members its ensemble has."""
        return int(self.is_like_own.sum()) - 1

    def has_runs(self, kind: str) -> bool:
        """Whether it has a run of a kind."""
        return bool((self.outcome["run_kind"].values == kind).any())

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

    def made(self, steps: Sequence[str], opening: str = ANY) -> Made:
        """What the runs make in steps near an opening. Energy and failed volume are of all openings."""
        largest = self.of_runs("largest", steps, opening)
        number, potency = (self.of_runs(name, steps, opening).sum(axis=1).mean() for name in ("number", "potency"))
        energy, failed = (self.of_runs(name, steps).sum(axis=1).mean() for name in ("energy_released", "failed_volume"))
        known = float(np.nanmax(largest)) if np.isfinite(largest).any() else np.nan
        return Made(float(number), float(potency), float(energy), float(failed), known)

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
