"""The interface of a scheme. A class that offers it is named in step_cells.SCHEMES and in the settings."""

from typing import Protocol, runtime_checkable

import numpy as np

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import Brittle
from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.subdomain import Subdomain
from mpm_core.model.state import State


class Scheme(Protocol):
    """Brings a body to equilibrium. What it keeps about the body follows the body only through these methods."""

    body: Body

    def set_volume(self, volume: np.ndarray) -> None:
        """Take over changed particle volumes (particle,) m3."""

    def set_failed(self) -> None:
        """Take over which particles have failed (state.failed)."""

    def go_back(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a committed state kept earlier (state.snapshot); what has flowed since then is forgotten."""

    def reach_equilibrium(self, external: np.ndarray, tolerance: float, reference: float, history: History) -> None:
        """Bring the 2-norm of the unbalanced force at free nodes to at most tolerance * reference (N).

        external (node, d) N. Raises NoEquilibrium where equilibrium is not reached, InputError for NaN.
        """

    def release(self) -> None:
        """Free the memory of all that the next relaxation makes again."""

    def drop_work_arrays(self) -> None:
        """Free the work arrays; no relaxation follows."""


class Excerpt(Protocol):
    """A part of the mine whose state is to be written into the whole; its cells are (k,) indices."""

    @property
    def cells(self) -> np.ndarray:
        """Their indices (k,)."""

    def write_back(self, state: State) -> None:
        """Write it into the state of the whole mine."""


@runtime_checkable
class SchemeWithSubdomains(Scheme, Protocol):
    """A scheme for which a small subdomain of the mine is less work than the whole."""

    def subdomain_around(self, brittle: Brittle, fresh: np.ndarray) -> Subdomain | None:
        """The subdomain around rock that has just failed, particles (k,); None where that is too much of the mine."""

    def scheme_of(self, subdomain: Subdomain) -> Scheme:
        """The scheme that brings a subdomain to equilibrium."""

    def take_over(self, excerpt: Excerpt) -> None:
        """Take over the result of a subdomain, which is in equilibrium and committed."""
