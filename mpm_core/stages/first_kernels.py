"""The kernels of a stage, compiled beside each other before it begins: the first run of a version does not wait for
one core.

Numba compiles a kernel when it is first called, in the process that calls it. The list next to this file says which
kernels the stages of ordinary scenes call, and with what. `python -m verification.kernel_list` writes it; a line has

    stage  the first that calls it: grid, elastic or step
    dimensions
    module
    name  in it; with `[3]` for kernels by dimension, with `(law)` or `(law,3)` for kernels made for the scene's law
    types of the arguments, as numba writes them

Lines stand in the order in which the kernels are compiled, longest first, so that no process is left with a long one. A
kernel that is not in the list, or cannot be compiled as the list says, is compiled when it is called.
"""

import hashlib
import importlib
import logging
import multiprocessing
import os
import re
import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import llvmlite.binding
import numba
from numba.core.dispatcher import Dispatcher

from common.costs import COMPILING, processor_time
from common.kernel_cache import kernel_hash
from common.stage import die_with_parent
from mpm_core.constitutive.laws import can_fail, law_of_all
from mpm_core.scene.scene import Scene

KERNEL_LIST = Path(__file__).with_suffix(".txt")
CALLED_BY = {"grid": ("grid",), "elastic": ("elastic",), "step": ("elastic", "step")}
"""by stage: the stages whose lines it needs"""
MAX_PROCESSES = 8  # Each takes memory, and one of them has the longest kernel to compile.
NUMBER_BYTES = 2  # of a line's number in a pipe


@dataclass(frozen=True)
class ListedKernel:
    """A line of the list."""

    stage: str
    dimension: int
    module: str
    name: str
    types: tuple[str, ...]

    @classmethod
    def read(cls, line: str) -> "ListedKernel":
        """Kernel listed by a line: stage, dimension, module, name and types, separated by blanks."""
        stage, dimension, module, name, *types = line.split(" ")
        return cls(stage, int(dimension), module, name, tuple(types))

    def line(self) -> str:
        """Line of the list that `read` reads: stage, dimension, module, name and types, separated by blanks."""
        return " ".join([self.stage, str(self.dimension), self.module, self.name, *self.types])

    @property
    def needs_law(self) -> bool:
        """True if the kernel is made for a law of failure."""
        return "(law" in self.name

    def find(self, law: ModuleType | None) -> Dispatcher:
        """The kernel. Raises AttributeError or KeyError if there is none."""
        name, *parts = re.findall(r"\w+", self.name)
        found = getattr(importlib.import_module(self.module), name)
        if "[" in self.name:
            return found[int(parts[0])]
        return found(*(law if part == "law" else int(part) for part in parts)) if parts else found

    def signature(self) -> tuple[numba.types.Type, ...]:
        """Types of the arguments."""
        return tuple(map(type_of, self.types))


def read_list() -> list[ListedKernel]:
    """All lines of the list, in its order."""
    return list(map(ListedKernel.read, KERNEL_LIST.read_text(encoding="utf-8").splitlines()))


def type_of(text: str) -> numba.types.Type:
    """A number's type ("float64"), or an array's by its dimensions ("float64[:,::1]": contiguous; "float64[:,:]")."""
    name, _, dimensions = text.partition("[")
    number = getattr(numba.types, "boolean" if name == "bool" else name)
    if not dimensions:
        return number
    return numba.types.Array(number, dimensions.count(",") + 1, "C" if dimensions.endswith("::1]") else "A")


def compile_for_grid(plane: str | None, processes: int) -> None:
    """Compile what building a grid needs; see `_compile_first`."""
    _compile_first("grid", 2 if plane else 3, None, processes)


def compile_for_scene(stage: str, scene: Scene, processes: int) -> None:
    """Compile what the elastic stage or a step needs, for the law of the scene's rock; see `_compile_first`.

    Scenes of the explicit scheme, which are few, compile each kernel when it is called.
    """
    if scene.solver.scheme == "multigrid":
        materials = scene.materials.values()
        law = law_of_all(materials) if any(map(can_fail, materials)) else None
        _compile_first(stage, 2 if scene.plane else 3, law, processes)


def _compile_first(stage: str, dimension: int, law: ModuleType | None, processes: int) -> None:
    """Compile what a stage needs and no earlier run has compiled, in so many processes, or in as many as numba has
    threads.

    law: of the scene's rock; None if it cannot fail. To be called before this process has run a parallel kernel: copies
    of a process lack its threads.
    """
    processes = min(processes, numba.config.NUMBA_NUM_THREADS, MAX_PROCESSES)  # type: ignore[attr-defined]  # see threads.py
    if processes < 2 or sys.platform != "linux":
        return
    folder, made_for = Path(os.environ["NUMBA_CACHE_DIR"]), _made_for(dimension, law)
    done = {part: folder / f"{part}_{made_for}.compiled" for part in CALLED_BY[stage]}
    left = [part for part in done if not done[part].exists()]
    if not left:
        return
    needed = [one for one in read_list() if one.stage in left and one.dimension == dimension]
    before = processor_time()
    if _in_processes([one for one in needed if law or not one.needs_law], law, processes):
        folder.mkdir(parents=True, exist_ok=True)
        for part in left:
            done[part].touch()
    COMPILING.seconds += processor_time() - before


def _made_for(dimension: int, law: ModuleType | None) -> str:
    """Hash of all that compiled kernels depend on but their own types."""
    llvm = llvmlite.binding
    parts = [kernel_hash(), KERNEL_LIST.read_text(encoding="utf-8"), str(dimension), law.__name__ if law else ""]
    parts += [sys.version, numba.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _in_processes(needed: list[ListedKernel], law: ModuleType | None, processes: int) -> bool:
    """Compile kernels in processes that take one after the other; whether none of them was killed.

    Their numbers stand in a pipe, which the system hands out without a lock that a killed process could keep.
    """
    logging.info("compiling %d kernels in %d processes, for the first run of this version", len(needed), processes)
    for one in needed:  # once, before the processes are copies of this one
        importlib.import_module(one.module)
    context = multiprocessing.get_context("fork")
    numbers, end = os.pipe()
    os.write(end, b"".join(number.to_bytes(NUMBER_BYTES, sys.byteorder) for number in range(len(needed))))
    os.close(end)
    started = [context.Process(target=_compile, args=(numbers, needed, law), daemon=True) for _ in range(processes)]
    try:
        for process in started:
            process.start()
        for process in started:
            process.join()
    finally:
        for process in started:  # the user has interrupted the stage
            if process.is_alive():
                process.kill()
                process.join()
        os.close(numbers)
    return all(process.exitcode == 0 for process in started)


def _compile(numbers: int, needed: list[ListedKernel], law: ModuleType | None) -> None:
    """Compile the kernels whose numbers are read from a pipe, until there are none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the stage ends its processes
    die_with_parent()
    while number := os.read(numbers, NUMBER_BYTES):
        one = needed[int.from_bytes(number, sys.byteorder)]
        try:
            one.find(law).compile(one.signature())
        except Exception as error:  # the list is stale: the kernel is compiled when it is called
            logging.info("%s as listed in %s: %s", one.name, KERNEL_LIST.name, " ".join(str(error).split()))
