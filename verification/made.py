"""Provenance of a table: the commit of the checkout, the date, and the versions of numpy and numba.

It is written beside the table when the table is written, and pages of docs/studies quote it.
"""

import json
import re
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path

from common.datasets import atomic_path
from common.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
FILE = "made.json"
PINS = "tests/golden"
GOLDEN = (f"{PINS}/tiny.json", f"{PINS}/demo.json")  # That of Elk Creek needs recorded data.
MECHANICS = re.compile(r"/(?:(?:grid|elastic)\.nc|(?:steps|events)/)")  # Results of the mechanics, in paths of pins.
NUMERICS = (PINS,)  # Results of most studies may change with what is pinned of the mechanics.
UNKNOWN, DIRTY = "unknown", "-dirty"
COMMIT_LENGTH = 7


@dataclass(frozen=True)
class Made:
    """commit: abbreviated, ending in -dirty where tracked files differed from it; "unknown" outside of a git checkout.
    date: UTC, ISO 8601."""

    commit: str
    date: str
    numpy: str
    numba: str

    @classmethod
    def now(cls) -> "Made":
        """By this checkout, at this moment."""
        described = _git("describe", "--always", "--exclude=*", f"--abbrev={COMMIT_LENGTH}", f"--dirty={DIRTY}")
        date = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(described or UNKNOWN, date, version("numpy"), version("numba"))

    @classmethod
    def read(cls, table: Path) -> "Made":
        """Provenance of a table, read from FILE beside it. Raises InputError if there is no such file."""
        try:
            return cls(**json.loads((table.parent / FILE).read_text(encoding="utf-8")))
        except OSError as error:
            raise InputError(
                f"{table}: has no {FILE} beside it, which tells the commit that it was made at; run its target again"
            ) from error

    def write(self, table: Path) -> None:
        """Write it beside a table, atomically."""
        with atomic_path(table.parent / FILE) as temporary:
            temporary.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    def sentence(self) -> str:
        """Sentence for the page of a study."""
        return f"Made on {self.date[:10]} at commit `{self.commit}` with numpy {self.numpy} and numba {self.numba}."


def oldest(made: Iterable[Made]) -> Made:
    """The first of several by date: a table is as old as the oldest of its rows."""
    return min(made, key=lambda one: one.date)


def is_older(commit: str, folders: Iterable[str] = NUMERICS) -> bool:
    """True if folders changed since a commit, or if that is not known; of PINS, what is pinned of the mechanics.

    Changes that were not committed when a table was made count if they are committed now. What was pinned later only
    does not count.
    """
    commit, folders = commit.removesuffix(DIRTY), list(folders)
    if PINS in folders:
        before, now = pinned_mechanics(commit), pinned_mechanics("HEAD")
        if before is None or now is None or any(now.get(path) != pins for path, pins in before.items()):
            return True
    others = [folder for folder in folders if folder != PINS]
    return bool(others) and _git("log", "-1", "--format=%h", f"{commit}..HEAD", "--", *others) != ""


@cache
def pinned_mechanics(commit: str) -> dict[str, dict] | None:
    """What GOLDEN pins of the mechanics at a commit, by the path of a result; None where that is not known."""
    found: dict[str, dict] = {}
    for path in GOLDEN:
        text = _git("show", f"{commit}:{path}")
        if text is None:
            return None
        found |= {name: pins for name, pins in json.loads(text)["files"].items() if MECHANICS.search(name)}
    return found


def _git(*words: str) -> str | None:
    """Output of a command of git in this checkout; None where it fails or git is not installed."""
    try:
        run = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True)
    except OSError:
        return None
    return None if run.returncode else run.stdout.strip()
