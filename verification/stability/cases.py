"""What a case is: one value of a knob, the scene it is turned in, who judges it, and what error is allowed."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from verification.stability.judges import Judge


@dataclass(frozen=True)
class Known:
    """A case that is converged and wrong, is known, and stays listed. at_most: its error may not grow beyond."""

    reason: str
    at_most: float


@dataclass(frozen=True)
class Case:
    """value: of the knob, a number or in words; series: which scene, scheme or kind of rock, in words.

    judge: None where a sound state and its balances are all that can be asked (the page counts these by themselves).
    under: what is driven within the process while it runs (drive.py). refused: how the line begins, and what else it
    says, that a mistake must be refused with; the mine is then read only.
    """

    series: str
    value: float | str
    values: dict
    judge: Judge | None
    allowed: float
    known: Known | None = None
    under: Callable[[], AbstractContextManager] = nullcontext
    refused: tuple[str, str] | None = None


@dataclass(frozen=True)
class Knob:
    """What is turned. scale: of its axis, log | linear | words | none; about: what the page says of it."""

    key: str
    title: str
    scale: str
    about: str
    cases: Callable[[], Iterable[Case]] = field(repr=False)
