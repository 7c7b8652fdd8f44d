"""What a case is: one value of a knob, the scene it is turned in, who judges it, and what error is allowed."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from verification.known_misses import KnownMiss
from verification.stability.judges import Judge


@dataclass(frozen=True)
class Case:
    """value: of the knob, a number or in words; series: which scene, scheme or kind of rock, in words.

    judge: None where a sound state and its balances are all that can be asked (the page counts these by themselves).
    known: why the case is converged and wrong all the same, and the error up to which it may be.
    under: what is driven within the process while it runs (drive.py). refused: how the line begins, and what else it
    says, that a mistake must be refused with; the mine is then read only.
    """

    series: str
    value: float | str
    values: dict
    judge: Judge | None
    allowed: float
    known: KnownMiss | None = None
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
