"""The mine of a folder of results: the run's own mine, its coarse companion, it in elastic rock, or a member.

The verification adds mines of its own (`Folders.add`): the variants of its studies.
"""

import functools
import re
from typing import Protocol

from workflow.mine import Mine

NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"
ENSEMBLE = "ensemble"  # folder of the perturbed members, by number
COARSE = "coarse"  # folder of the companion on cells of twice the size
ELASTIC_ROCK = "elastic_rock"  # folder of the same mine in rock that does not fail, for its baselines
ALL_CORES = 64


class OtherMines(Protocol):
    """Mines other than the run's own."""

    pattern: str  # of their folders below results, a regular expression

    def mine_at(self, place: str) -> Mine:
        """The mine of a folder that fits the pattern. Ends the run in one line if there is none."""

    def threads_at(self, place: str) -> int:
        """Threads that the mechanics of this mine may use."""


class Folders:
    """Folders below results, and the mine that each one is of."""

    def __init__(self, mine: Mine):
        self.mine = mine
        self.others: OtherMines | None = None
        self.mine_at = functools.cache(self._mine_at)

    def add(self, others: OtherMines) -> None:
        """Add the folders of other mines."""
        self.others = others

    @property
    def places(self) -> str:
        """Regular expression of the folders of whole mines."""
        own = re.escape(self.mine.name)
        return f"{own}|{self.others.pattern}" if self.others else own

    @property
    def pattern(self) -> str:
        """Regular expression of the wildcard `mine`: a mine's folder, or that of one of its other runs."""
        return f"({self.places})(/{ENSEMBLE}/[1-9][0-9]*|/{COARSE}|/{ELASTIC_ROCK})?"

    def parts(self, folder: str) -> tuple[str, str]:
        """Folder of the whole mine, and which run is meant: ensemble/<number>, coarse, elastic_rock, or "": its own."""
        found = re.fullmatch(f"({self.places})/?({ENSEMBLE}/[0-9]+|{COARSE}|{ELASTIC_ROCK}|)", folder)
        assert found, f"{folder} is no folder of a mine"  # the wildcard `mine` matches no other
        return found[1], found[2]

    def _mine_at(self, folder: str) -> Mine:
        """Configuration behind results/<folder>."""
        place, part = self.parts(folder)
        mine = self.mine if self.others is None or place == self.mine.name else self.others.mine_at(place)
        if part == COARSE:
            return mine.coarser()
        if part == ELASTIC_ROCK:
            return mine.in_elastic_rock()
        return mine.member(int(part.split("/")[1])) if part else mine

    def shared(self, folder: str) -> str:
        """Folder of the grid and the elastic state below results. The members of an ensemble have none of their own."""
        place, part = self.parts(folder)
        return place if part.startswith(ENSEMBLE) else folder

    def threads(self, folder: str) -> int:
        """Threads of a stage of the mechanics: all of them, unless the folder's mine is small."""
        place, _ = self.parts(folder)
        return ALL_CORES if self.others is None or place == self.mine.name else self.others.threads_at(place)
