"""One run of a tiny mine that most tests look at, and copies of it that they may spoil."""

import shutil
from pathlib import Path

import pytest
from tiny_mines import TINY, finished, start, write_mine


@pytest.fixture(scope="session")
def base(tmp_path_factory) -> Path:
    """Folder of all runs; a space in its name, as on many users' shares."""
    return tmp_path_factory.mktemp("mines") / "block caves"


@pytest.fixture(scope="session")
def tiny_file(base) -> Path:
    """The tiny mine's file, with the record beside it."""
    return write_mine(TINY, base / "files" / "tiny.yaml")


@pytest.fixture(scope="session")
def undisturbed(base, tiny_file) -> tuple[Path, str]:
    """Folder and terminal text of one run of the tiny mine to its report, on two cores."""
    folder = base / "undisturbed"
    status, text = finished(start(tiny_file, folder))
    assert status == 0, text
    return folder, text


@pytest.fixture
def spoiled(undisturbed, base, request) -> Path:
    """A copy of the undisturbed run beside it, time stamps and Snakemake's own notes included."""
    folder = base / request.node.name.replace("[", "_").replace("]", "")
    shutil.copytree(undisturbed[0], folder)
    return folder
