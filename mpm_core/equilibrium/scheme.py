"""What a stage needs of a scheme: a class that offers this, named in step_cells.SCHEMES and the settings."""

from typing import Protocol, runtime_checkable

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.subdomain import Part
from mpm_core.model.state import State


class Scheme(Protocol):
    """Brings a body to equilibrium. What it keeps about the body follows the body only through these methods."""

    body: Body

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes (particle,) m3."""

    def set_failed(self) -> None:
        """Take over which particles have failed (state.failed)."""

    def go_back(self, kept: dict[str, np.ndarray]) -> None:
        """Return to a committed state kept earlier (state.keep); what has flowed since then is forgotten."""

    def relax(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Bring the 2-norm of the unbalanced force at free nodes to at most tolerance * reference (N).

        external (node, d) N. Raises NoEquilibrium where equilibrium is not reached, InputError for NaN.
        """

    def drop_work_arrays(self) -> None:
        """Nothing more is to be relaxed: what only that needs goes."""


class Excerpt(Protocol):
    """Some cells of a mine, (k,) indices, where something has happened."""

    @property
    def cells(self) -> np.ndarray:
        """Their indices (k,)."""

    def give_back(self, state: State) -> None:
        """Write it into the state of the whole mine."""


@runtime_checkable
class SchemeInParts(Scheme, Protocol):
    """A scheme for which a small part of the mine is less work than the whole."""

    def part_around(self, brittle: Brittle, fresh: np.ndarray) -> Part | None:
        """The part around rock that has just failed, particles (k,); None where that is too much of the mine."""

    def scheme_of(self, part: Part) -> Scheme:
        """The scheme that brings a part to equilibrium."""

    def take_back(self, part: Excerpt) -> None:
        """Take over what has happened in a part, which is in equilibrium and committed."""
