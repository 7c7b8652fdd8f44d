"""A case: one value of a knob, the scene in which it is turned, the judge of its result, and the allowed error."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from verification.rows import KnownMiss
from verification.stability.judges import ErrorMeasure, closure_error, dimension_of, front_error

# Allowed errors as shares of closure and front of a tunnel and a sphere: 0.4 of a cell, which is an eighth of a
# tunnel's radius and a quarter of a sphere's.
MAX_HOLE_ERROR = {2: 0.05, 3: 0.10}
MAX_MOTION_DIFFERENCE = 1e-3  # Share of the largest motion between runs that must answer alike.
LOOSE_TOLERANCE_MISS = KnownMiss("The loosest tolerance that is taken leaves a tenth of the load unbalanced.", 0.15)


@dataclass(frozen=True)
class Case:
    """One value of a knob, and what its run must come to.

    series: scene, scheme or kind of rock, in words. value: of the knob, a number or words. values: the scene as a mine
    file would hold it. judge: None where only a sound state and its balances can be asked; the page counts these apart.
    known: why the case converges to a wrong answer, and its largest known error. under: what is changed within the
    process while the case runs (shapes.py). refused: how the refusal of a mistake begins and what else it says; the
    mine is then only read.
    """

    series: str
    value: float | str
    values: dict
    judge: ErrorMeasure | None
    allowed: float
    known: KnownMiss | None = None
    under: Callable[[], AbstractContextManager] = nullcontext
    refused: tuple[str, str] | None = None


def closure_case(series: str, value: float, scene: dict, **options) -> Case:
    """Case of a hole in elastic rock, judged by its closure. options: as Case."""
    return Case(series, value, scene, closure_error, MAX_HOLE_ERROR[dimension_of(scene)], **options)


def front_case(series: str, value: float, scene: dict, **options) -> Case:
    """Case of a hole in Coulomb rock, judged by the front of its failed rock. options: as Case."""
    return Case(series, value, scene, front_error, MAX_HOLE_ERROR[dimension_of(scene)], **options)


@dataclass(frozen=True)
class Knob:
    """A quantity that is varied. scale: of its axis, log | linear | words | none. about: what is run, for the page."""

    key: str
    title: str
    scale: str
    about: str
    cases: Callable[[], Iterable[Case]] = field(repr=False)
