"""Kernels that are compiled beside each other before a stage: the list of them, and the processes that compile them."""

import inspect
import os
import signal
import time
from pathlib import Path

import pytest

from mpm_core.constitutive.laws import LAWS
from mpm_core.stages import first_kernels
from mpm_core.stages.first_kernels import CALLED_BY, ListedKernel, compile_for_grid, read_list, type_of
from verification.kernel_list import recorded_lines, type_text

PROCESSES = 3


def listed(*names: str) -> list[ListedKernel]:
    """Lines of a list of the grid stage in 3-D."""
    return [ListedKernel("grid", 3, "os", name, ()) for name in names]


class Compiled:
    """A kernel that notes its name and its process where it is compiled."""

    def __init__(self, name: str, notes: Path):
        self.name, self.notes = name, notes

    def compile(self, types) -> None:
        """Not at once, so that each process gets some."""
        time.sleep(0.02)
        if self.name == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.name == "stale":
            raise AttributeError("there is no such kernel")
        with self.notes.open("a") as file:
            file.write(f"{self.name} {os.getpid()}\n")


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Compile kernels of these names for the grid stage: (name, process) of each; the folder is empty at first."""
    notes = tmp_path / "notes"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(first_kernels.numba.config, "NUMBA_NUM_THREADS", PROCESSES)
    monkeypatch.setattr(ListedKernel, "find", lambda self, law: Compiled(self.name, notes))

    def names_and_processes(*names: str) -> list[tuple[str, ...]]:
        notes.write_text("")
        monkeypatch.setattr(first_kernels, "read_list", lambda: listed(*names))
        compile_for_grid(None, 64)
        return [tuple(line.split()) for line in notes.read_text().splitlines()]

    return names_and_processes


def test_every_line_names_a_kernel_with_that_many_arguments():
    """For each law: those of the list's mine have the same arguments as all others."""
    lines = read_list()
    assert {one.stage for one in lines} == set(CALLED_BY)
    assert {one.dimension for one in lines} == {2, 3}
    for one in lines:
        for law in LAWS:
            assert len(inspect.signature(one.find(law).py_func).parameters) == len(one.signature()), one.line()


def test_lines_and_types_are_read_as_they_are_written():
    for one in read_list():
        assert ListedKernel.read(one.line()) == one
        assert [type_text(type_of(text)) for text in one.types] == list(one.types)


@pytest.mark.slow
def test_the_list_has_what_its_mines_call():
    """Run `python -m verification.kernel_list` where this fails. Another processor may call a few kernels less."""
    called, known = set(recorded_lines()), {one.line() for one in read_list()}
    assert called <= known
    assert len(known - called) <= 0.05 * len(known)


def test_each_kernel_is_compiled_by_one_process(compiled):
    """All of them, once; by as many processes as numba has threads."""
    names = [f"kernel_{number}" for number in range(300)]
    found = compiled(*names)
    assert sorted(name for name, _ in found) == sorted(names)
    assert len({process for _, process in found}) == PROCESSES
    assert str(os.getpid()) not in {process for _, process in found}


def test_nothing_is_compiled_again(compiled):
    """Unless the list has changed."""
    assert len(compiled("one", "other")) == 2
    assert compiled("one", "other") == []


def test_a_stale_line_leaves_out_its_kernel_only(compiled):
    assert sorted(name for name, _ in compiled("one", "stale", "other")) == ["one", "other"]
    assert compiled("one", "stale", "other") == []


def test_the_others_go_on_where_a_process_is_killed(compiled):
    """And the next stage tries again."""
    names = ["killed", *(f"kernel_{number}" for number in range(20))]
    for _ in range(2):
        assert sorted(name for name, _ in compiled(*names)) == sorted(names[1:])


def test_one_thread_compiles_as_kernels_are_called(compiled, monkeypatch):
    monkeypatch.setattr(first_kernels.numba.config, "NUMBA_NUM_THREADS", 1)
    assert compiled("one") == []
