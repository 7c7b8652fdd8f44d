"""A job: one call of a stage, as a file that says all that its results depend on.

The file is `results/<mine>/jobs/<stage>/<hash>.json`, or `<stage>/<part>/<hash>.json` where a stage has several jobs,
as those of the steps. It holds the stage's settings in SI units, the results that it reads, and hashes of its
code and of the user's files that the settings name. The hash in its name is that of its content, and the file is an
input of the stage's rule. So whatever changes makes another file, newer than the results, and Snakemake runs the stage
again, also where its own notes (`.snakemake`) are gone. `python -m workflow <file> --output ...` runs a job.
"""

import functools
import hashlib
import json
import math
import os
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

from common.errors import InputError

FOLDER = "jobs"  # below results/<mine>
PACKAGES = ("numpy", "numba", "scipy", "scikit-learn", "xarray", "netCDF4", "obspy")
MADE_FROM = "made_from"
AS_WRITTEN = {"config", "default", "text"}  # keys that quote a mine's file: no file is opened by them
REMEDY = "jobs stand in results/<mine>/jobs; the next run writes deleted ones again"


@dataclass(frozen=True)
class Job:
    """A stage's settings (plain values, SI), the paths that it reads by name, the paths that it writes, its threads,
    and the folder of the logs of the mine's stages.

    Some stages read files whose paths their settings hold: plan_outcome, whose runs are groups of files, vtk and
    vtk_events, whose file may be one of a folder that a rule makes as a whole. Their inputs then name what Snakemake
    has to make first; the provenance follows from these, too.
    """

    stage: str
    settings: dict
    inputs: dict[str, list[str]]
    code: str
    files: dict[str, str]
    outputs: tuple[Path, ...] = ()
    threads: int = 1
    logs: Path | None = None

    def input(self, name: str) -> Path:
        """Path of an input that is one file."""
        (path,) = self.inputs[name]
        return Path(path)

    def input_if_any(self, name: str) -> Path | None:
        """Path of an input; None where the scene has none."""
        return self.input(name) if name in self.inputs else None

    def paths(self, name: str) -> list[Path]:
        """Paths of an input that is several files, in order; empty where the scene has none."""
        return list(map(Path, self.inputs.get(name, [])))

    def output(self, name: str = "") -> Path:
        """The path written that has this file name; without a name the first one."""
        return next(path for path in self.outputs if name in ("", path.name))

    def writes(self, name: str) -> bool:
        """True if one of the paths written has this file name."""
        return any(path.name == name for path in self.outputs)

    def provenance(self) -> dict[str, str]:
        """Attributes of every dataset that the job writes: what it was made from.

        config_hash: of the settings; source_hash: of the code; made_from: of these, of the content of the user's files,
        and of the `made_from` of all results that were read, so that it identifies all that came before; versions: of
        libraries, JSON.
        """
        config = config_hash(self.settings)
        before = sorted(made for name in self.inputs for path in self.paths(name) for made in read_made_from(path))
        parts = [self.stage, config, self.code, *sorted(self.files.values()), *before]
        return {
            "config_hash": config,
            "source_hash": self.code,
            MADE_FROM: hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16],
            "versions": json.dumps({name: version(name) for name in PACKAGES}),
        }


def write_job(
    folder: str | os.PathLike, stage: str, part: str, settings: dict, inputs: dict[str, list[str]], code: str
) -> str:
    """Path of the job of a stage in a folder of results; the file is written unless it stands there.

    part: of a stage that has several jobs in the folder, such as the name of a step; else empty. Raises InputError
    where the file cannot be written.
    """
    from common.datasets import atomic_path  # here: what only reads jobs need not wait for xarray

    values = {"stage": stage, "settings": settings, "inputs": inputs, "code": code, "files": {}}
    text = json.dumps(values, sort_keys=True)
    if '"file": ' in text:  # else no setting names one, and a mine of years has many settings to look through
        values["files"] = {path.as_posix(): content_of(path) for path in files_of(settings)}
        text = json.dumps(values, sort_keys=True)
    # A folder for each job: Snakemake keeps what it has seen in a folder, and would miss a file that is written later.
    path = Path(folder, FOLDER, stage, part, f"{content_hash(text)}.json")
    try:
        if not path.is_file() or path.read_text(encoding="utf-8", errors="replace") != text:
            with atomic_path(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        elif any(_modified(other) < _modified(path) for other in path.parent.glob("*.json")):
            # The results are of an older form; they may have been touched since this one was planned.
            os.utime(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); mend its folder, or move it away") from error
    return path.as_posix()


def _modified(path: Path) -> float:
    """Time at which a file was written, ns; infinite where another process has removed it."""
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return math.inf


def read_job(path: str | os.PathLike) -> Job:
    """The job of a file. Raises InputError for what is none, and for a file whose content is not of its name."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        values = json.loads(text)
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}); {REMEDY}") from error
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); {REMEDY}") from error
    named = re.fullmatch(r"[0-9a-f]{16}", path.stem)
    if not isinstance(values, dict) or (named and named[0] != content_hash(text)):
        raise InputError(f"{path}: damaged: its content is not what was written; {REMEDY}")
    return Job(**values)


def stage_of(path: str | os.PathLike, stages: Collection[str]) -> str:
    """The one of `stages` that a job's file is of, from its path; empty if none. A mine or a step may be named jobs."""
    return next((name for above, name in pairwise(Path(path).parts) if above == FOLDER and name in stages), "")


def remove_earlier(path: str | os.PathLike) -> None:
    """Remove other forms of a job that runs: what they describe is replaced.

    If their settings come back, they are written again, and then they are newer than the results.
    """
    path = Path(path)
    for earlier in path.parent.glob(f"*{path.suffix}"):
        if earlier.name != path.name:
            earlier.unlink(missing_ok=True)


def content_hash(text: str) -> str:
    """The name of a job's file."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def config_hash(settings: dict) -> str:
    """Hash of settings, independent of key order and of the folder that their files are in."""

    def without_folder(pairs: list[tuple]) -> dict:
        return {key: Path(value).name if key == "file" and isinstance(value, str) else value for key, value in pairs}

    text = json.dumps(settings, sort_keys=True)
    return content_hash(json.dumps(json.loads(text, object_pairs_hook=without_folder), sort_keys=True))


def files_of(settings) -> Iterator[Path]:
    """Files and folders that settings name by the key `file`, in the order of their keys."""
    if isinstance(settings, dict):
        for key in sorted(settings.keys() - AS_WRITTEN):
            if key == "file" and isinstance(settings[key], str):
                yield Path(settings[key])
            else:
                yield from files_of(settings[key])
    elif isinstance(settings, list | tuple):
        for entry in settings:
            yield from files_of(entry)


@functools.cache
def content_of(path: Path) -> str:
    """Digest of a file's bytes, of a folder's names and bytes (hidden ones left out); empty if it cannot be read."""
    try:
        if path.is_dir():
            inside = sorted(entry for entry in path.iterdir() if not entry.name.startswith("."))
            text = "".join(f"{entry.name}\0{content_of(entry)}\0" for entry in inside)
            return hashlib.sha256(text.encode()).hexdigest()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:  # the stage that reads it says why
        return ""


def read_made_from(path: str | os.PathLike) -> Iterable[str]:
    """The `made_from` of a dataset, of all datasets in a folder, or nothing."""
    import netCDF4

    path = Path(path)
    for dataset in sorted(path.glob("*.nc")) if path.is_dir() else [path] if path.suffix == ".nc" else []:
        try:
            with netCDF4.Dataset(dataset) as opened:
                yield str(getattr(opened, MADE_FROM, ""))
        except OSError:  # the stage that reads it says why
            continue
