"""Writes the list of kernels that are compiled beside each other before a stage begins (stages/first_kernels.txt).

Run `python -m verification.kernel_list` after a kernel was added or removed, or gets other arguments. It takes some
minutes: it runs two small mines with an empty folder of kernels, and notes what their stages call and how long that
takes to compile.
"""

import inspect
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import yaml

from verification.extremes.tiny_mine import FLAT
from verification.studies import merge
from workflow.configuration import load
from workflow.mine import Mine

DEMO, SECTION = "demo", "section"
CONFIG = Path(__file__).resolve().parents[1] / "config"


def listed_mine(name: str) -> Mine:
    """A mine that calls what ordinary ones do: the demo on large cells, or one in plane strain."""
    default = yaml.safe_load((CONFIG / "default.yaml").read_text())
    file = CONFIG / "mines" / "demo.yaml"
    demo = merge(yaml.safe_load(file.read_text()), {"grid": {"finest_cell": "5 m"}})
    return load(merge(default, {DEMO: demo, SECTION: FLAT}[name]), file, default)


@contextmanager
def noted_calls(calls: dict) -> Iterator[None]:
    """Note the kernels that Python calls meanwhile, with their types, and the seconds that each takes to compile."""
    from numba.core.dispatcher import Dispatcher

    compile_one, depth = Dispatcher.compile, 0

    def compile_and_note(self, types):
        nonlocal depth
        depth += 1  # what a kernel calls is compiled within it
        began = time.thread_time()
        try:
            return compile_one(self, types)
        finally:
            depth -= 1
            if depth == 0:
                calls.setdefault((self, types), time.thread_time() - began)

    Dispatcher.compile = compile_and_note  # type: ignore[method-assign]
    try:
        yield
    finally:
        Dispatcher.compile = compile_one  # type: ignore[method-assign]


def name_in(module: ModuleType, kernel, law: ModuleType, dimension: int) -> str:
    """Name of a kernel in its module as the list has it (first_kernels.ListedKernel)."""
    for name, value in vars(module).items():
        if value is kernel:
            return name
        if isinstance(value, dict):
            for key, entry in value.items():
                if entry is kernel:
                    return f"{name}[{key}]"
        if name.startswith("make_") and hasattr(value, "cache_info"):  # makes a kernel once for the same arguments
            made_for = (law, dimension)[: len(inspect.signature(value).parameters)]
            if value(*made_for) is kernel:
                return f"{name}({','.join(['law', str(dimension)][: len(made_for)])})"
    raise LookupError(f"{module.__name__}: no name for {kernel.py_func.__qualname__}")


def type_text(kind) -> str:
    """A type as the list has it (first_kernels.type_of)."""
    if not hasattr(kind, "ndim"):
        return str(kind)
    assert kind.mutable
    return f"{kind.dtype}[{','.join([':'] * (kind.ndim - 1) + ['::1' if kind.layout == 'C' else ':'])}]"


def lines_of(name: str, folder: str = "") -> dict[str, float]:
    """Lines of what the stages of a mine call, and the seconds that each takes to compile, in a new process.

    folder: where compiled kernels are kept, if not where they usually are.
    """
    if folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
    from mpm_core.constitutive.laws import LAWS  # numba: once the folder of kernels is named
    from mpm_core.stages.first_kernels import ListedKernel
    from workflow.run_mine import run_stages

    mine, lines = listed_mine(name), dict[str, float]()
    calls, listed = dict[tuple, float](), set[tuple]()
    with tempfile.TemporaryDirectory() as other, noted_calls(calls):
        for made, _, _ in run_stages(mine.run_slices(extracted_as=()), Path(other) / "failed.npz"):
            for kernel, types in calls.keys() - listed:
                module = sys.modules[kernel.py_func.__module__]
                one = ListedKernel(
                    made if made in ("grid", "elastic") else "step",
                    mine.dimension,
                    module.__name__,
                    name_in(module, kernel, LAWS[0], mine.dimension),
                    tuple(map(type_text, types)),
                )
                lines[one.line()] = calls[kernel, types]
            listed |= calls.keys()
    return lines


def recorded_lines(*folders: str) -> list[str]:
    """The list: what the stages of both mines call, longest to compile first; a folder for each mine, if any."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as pool:
        found = list(pool.map(lines_of, (DEMO, SECTION), folders or ("", "")))
    lines = found[0] | found[1]
    return sorted(lines, key=lambda line: (-lines[line], line))


if __name__ == "__main__":
    from mpm_core.stages.first_kernels import KERNEL_LIST

    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        KERNEL_LIST.write_text("\n".join(recorded_lines(first, second)) + "\n", encoding="utf-8")
