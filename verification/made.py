"""Provenance of a table: the commit of the checkout, the date, and the versions of numpy and numba.

It is written beside the table when the table is written, and pages of docs/studies quote it.
"""

import json
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from common.datasets import atomic_path
from common.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
FILE = "made.json"
NUMERICS = ("mpm_core", "seismic")  # Results of most studies may change with these folders.
READING = (  # Parts of such folders that read what others made. They change no result of a study.
    *(
        f"mpm_core/geometry/{name}.py"
        for name in "blocks block_files dxf gocad meshes omf_blocks omf_files open_pits parts solid_files".split()
    ),
    *(
        "mpm_core/block_settings.py",
        "mpm_core/scene/rock_blocks.py",
        "mpm_core/scene/scene_solids.py",
        "catalogs/records",
        "catalogs/sources/geographic_frame.py",
    ),
)
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
    """True if folders changed, beyond READING, since a commit, or if that is not known.

    Changes that were not committed when a table was made count if they are committed now.
    """
    since = f"{commit.removesuffix(DIRTY)}..HEAD"
    beside = (f":(exclude){path}" for path in READING if path not in folders)
    return _git("log", "-1", "--format=%h", since, "--", *folders, *beside) != ""


def _git(*words: str) -> str | None:
    """Output of a command of git in this checkout; None where it fails or git is not installed."""
    try:
        run = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True)
    except OSError:
        return None
    return None if run.returncode else run.stdout.strip()
