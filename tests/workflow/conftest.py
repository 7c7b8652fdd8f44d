"""One run of a tiny mine that most tests look at, copies of it that they may spoil, and its configuration checked."""

import fcntl
import os
import shutil
from pathlib import Path

import pytest
import yaml
from scheduled_mines import lines_of_mistakes, scheduled_mine  # noqa: F401
from stand_ins import LEAVE_EMPTY, program
from tiny_mines import TINY, changed, merged, snakemake, write_mine

from common.errors import InputError
from workflow.configuration import load
from workflow.mine_folder import NOTES


@pytest.fixture(scope="session")
def base(tmp_path_factory) -> Path:
    """Folder of all runs; a space in its name, as on many users' shares."""
    return tmp_path_factory.mktemp("mines") / "block caves"


@pytest.fixture(scope="session")
def tiny_file(base) -> Path:
    """The tiny mine's file, with the record beside it."""
    return write_mine(TINY, base / "files" / "tiny.yaml")


@pytest.fixture(scope="session")
def undisturbed(base, tiny_file, tmp_path_factory) -> tuple[Path, str]:
    """Folder and terminal text of one run of the tiny mine to its report, on two cores.

    One run for all workers of pytest-xdist: the first makes it, the others copy it, mine file and time stamps included.
    """
    folder = base / "undisturbed"
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return folder, run_to_report(tiny_file, folder)
    shared = tmp_path_factory.getbasetemp().parent / "one tiny mine"
    with open(shared.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until the file is closed
        if shared.is_dir():
            shutil.copytree(shared, base, dirs_exist_ok=True)
            for note in (folder / NOTES).iterdir():  # whose results they are: this worker's own file's
                note.write_text(str(tiny_file.resolve()), encoding="utf-8")
        else:
            text = run_to_report(tiny_file, folder)
            (base / "terminal.txt").write_text(text)
            shutil.copytree(base, shared.with_suffix(".part"))
            shared.with_suffix(".part").rename(shared)
    return folder, (base / "terminal.txt").read_text()


def run_to_report(mine_file: Path, folder: Path) -> str:
    """Terminal text of a run of a mine in a folder."""
    status, text = snakemake(mine_file, folder)
    assert status == 0, text
    return text


@pytest.fixture(scope="session")
def leave_empty(tmp_path_factory) -> Path:
    """An interpreter whose stages say what their results were made from, and nothing else; for any checkout."""
    return program(LEAVE_EMPTY, tmp_path_factory.mktemp("programs") / "leave_empty")


@pytest.fixture
def spoiled(undisturbed, base, request) -> Path:
    """A copy of the undisturbed run beside it, time stamps and Snakemake's own notes included."""
    folder = base / request.node.name.replace("[", "_").replace("]", "")
    shutil.copytree(undisturbed[0], folder)
    results = folder / "results/tiny"
    made = (results / "report.html").stat().st_mtime
    for job in (results / "jobs").rglob("*.json"):
        if job.stat().st_mtime > made:  # of a dry run of another test
            job.unlink()
    return folder


@pytest.fixture
def refuse(tmp_path):
    """The line that a mine is refused with."""

    def line(mine: dict, **values) -> str:
        file = write_mine(changed(mine, **values), tmp_path / "mine.yaml")
        with pytest.raises(InputError) as refused:
            load(merged(yaml.safe_load(file.read_text())), file)
        assert "\n" not in str(refused.value)
        text = str(refused.value)
        assert text.startswith(f"{file}: ")
        return text.removeprefix(f"{file}: ")

    return line


@pytest.fixture
def accept(tmp_path):
    """The mine, checked and in SI."""

    def mine(base: dict, **values):
        file = write_mine(changed(base, **values), tmp_path / "mine.yaml")
        return load(merged(yaml.safe_load(file.read_text())), file)

    return mine
