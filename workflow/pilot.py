"""A pilot: the first steps of a mine on larger cells, which show what the mine's own cells will cost.

Cells are as large as the mine's grid allows at first, then half as large again and again, until they are the mine's own
or the next pilot would take longer than a pilot may. Only the last one counts. It is kept: the same pilot is not run
twice in a folder.
"""

import copy
import hashlib
import json
import logging
import platform
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from common.costs import running_time
from common.errors import InputError
from common.progress import log_compilation
from workflow.mine import Mine

MEMORY = Path(".snakemake/pilots")  # next to Snakemake's own notes
MAX_HALVINGS = 3  # Cells of a pilot are at most 2^3 times as large as the mine's own.
GROWTH = 6.0  # Time of a pilot over that of the one before, at most of most mines.
MAX_WARM_SECONDS = 4.0  # A pilot that takes no longer is run twice: most of it may have been loading kernels.
MANY_CELLS = 500_000  # of a mine, whose pilots take all cores
MAX_SECONDS, MAX_SECONDS_PER_CELL = 15.0, 6e-5  # processor time that pilots may take: the larger of both


@dataclass(frozen=True)
class PilotStep:
    """A step of a pilot: its name, cells at its end, the finest of them, and processor time without compiling, s."""

    name: str
    cells: int
    finest: int
    seconds: float


@dataclass(frozen=True)
class Pilot:
    """What a pilot found.

    cell: edge of its finest cells, m; start, start_finest: cells of its grid, and the finest of them; grid, elastic:
    processor time of these stages without compiling, s; steps: those that it ran; thickness: of the rock
    that failed in the last of them in which any did, m; NaN if none did; around: the opening with more of that rock
    around it than any other, and collapsed: the step in which the mine collapsed, by name, or empty.
    """

    cell: float
    start: int
    start_finest: int
    grid: float
    elastic: float
    steps: tuple[PilotStep, ...]
    thickness: float
    around: str = ""
    collapsed: str = ""

    @property
    def seconds(self) -> float:
        """Processor time of all of it, without compiling, s."""
        return self.grid + self.elastic + sum(step.seconds for step in self.steps)


def pilot_slices(mine: Mine) -> list[dict]:
    """Settings of the pilots of a mine, on the largest cells first and on its own last. None where its cells cannot be
    larger.

    They are those of the stages as workflow.run_mine takes them, up to the first dated step that mines, or up to the
    first that does where none is dated. `cell`: size of the finest cells, m; `mined`: of each excavation the number of
    the step that mines it, -1 for none.
    """
    levels = mine.settings.grid.levels
    fewest = max(1, min(2, levels - 1)) if mine.is_adaptive else 1  # of one size, none follow the rock
    own = copy.copy(mine)
    own.change("grid", volume_error=1e9)  # as in larger cells: a run will say what is too thin for its own
    sizes = [own]
    for _ in range(min(levels - fewest, MAX_HALVINGS)):
        sizes.insert(0, sizes[0].coarser())
    return [_first_steps(one) for one in sizes] if len(sizes) > 1 else []


def _first_steps(mine: Mine) -> dict:
    steps, mined = mine.mined_steps, {entry.step for entry in mine.excavations}
    dated = [number for number, name in enumerate(steps) if name in mine.dated_steps]
    wanted = dated or range(len(steps))
    last = next((number for number in wanted if steps[number] in mined), dated[0] if dated else 0)
    slices = mine.run_slices([])
    mined_in = [mine.step_index(entry.step) for entry in mine.excavations]
    return slices | {"steps": slices["steps"][: last + 1], "cell": mine.finest_cell, "mined": mined_in}


def pilot_of(name: str, pilots: list[dict], cells: int, code: str, cores: int) -> Pilot:
    """The pilot of a mine of this name; pilots: see `pilot_slices`; cells: of the mine's own grid; code: hash of the
    sources that run it; cores: of this machine, whose pilots are not those of another one. Raises InputError where it
    reaches no equilibrium."""
    import numba

    from mpm_core.simd.threads import use_threads

    digest = hashlib.sha256(json.dumps([pilots, code, _stamps(pilots), platform.node()], sort_keys=True).encode())
    path = MEMORY / f"{name}_{digest.hexdigest()[:16]}.json"
    with suppress(OSError, ValueError, TypeError, KeyError):  # none yet, or no longer whole
        kept = json.loads(path.read_text(encoding="utf-8"))
        return Pilot(**kept | {"steps": tuple(PilotStep(**step) for step in kept["steps"])})
    MEMORY.mkdir(parents=True, exist_ok=True)
    log_compilation()  # which counts no time of it
    taken, allowed = 0.0, max(MAX_SECONDS, MAX_SECONDS_PER_CELL * cells)
    before = numba.get_num_threads()
    # On a busy machine several cores take many times the processor time over few cells, which tells nothing.
    use_threads(1 if cells < MANY_CELLS else cores)
    try:
        for slices in pilots:
            found = _run(slices, path.with_suffix(".failed.npz"))
            if found.seconds < MAX_WARM_SECONDS:
                found = _run(slices, path.with_suffix(".failed.npz"))
            taken += found.seconds
            if taken + GROWTH * found.seconds > allowed:
                break
    finally:
        use_threads(before)
    _keep(path, found)
    return found


def _stamps(pilots: list[dict]) -> list[list[int]]:
    """Time and size of the files of solids."""
    grid = pilots[0]["grid"]
    sources = [*grid["excavations"], *grid["rock_bodies"], grid.get("blocks", {})]
    files = [Path(entry["file"]) for entry in sources if "file" in entry]
    return [[path.stat().st_mtime_ns, path.stat().st_size] for path in files if path.exists()]


def _keep(path: Path, pilot: Pilot) -> None:
    from common.datasets import atomic_path

    try:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(asdict(pilot)), encoding="utf-8")
    except (InputError, OSError) as error:
        logging.info("%s", error)


def _run(slices: dict, failed: Path) -> Pilot:
    from catalogs.compare.cell_error import failed_thickness
    from workflow.derived_domain import quiet
    from workflow.run_mine import run_stages

    seconds, steps, start, thickness, around, collapsed = {}, [], (0, 0), np.nan, "", ""
    before = running_time()
    try:
        with quiet():  # The mine's own stages will warn.
            for name, dataset, facts in run_stages(slices, failed):
                now = running_time()
                seconds[name] = now - before
                if name == "grid":
                    grid, start = dataset, _cells(dataset)
                if name.startswith("steps/"):
                    step = name.removeprefix("steps/")
                    steps.append(PilotStep(step, *_cells(dataset), seconds[name]))
                    of_step = failed_thickness(dataset, [facts["step_index"]]) * slices["cell"]
                    if np.isfinite(of_step):
                        thickness, around = of_step, _around(dataset, facts["step_index"], grid, slices["mined"])
                    if facts.get("collapsed") and not collapsed:
                        collapsed = step
                before = running_time()
    except InputError as error:
        raise InputError(f"tried on cells of {slices['cell']:.4g} m: {error}") from error
    return Pilot(
        slices["cell"], *start, seconds["grid"], seconds["elastic"], tuple(steps), float(thickness), around, collapsed
    )


def _around(state: xr.Dataset, step: int, grid: xr.Dataset, mined: list[int]) -> str:
    """The opening with more of the rock that failed in a step (by index) nearest to it than any other; empty without
    openings. mined: the step of each excavation, -1 for none."""
    from catalogs.sources.openings import nearest_opening

    names = json.loads(grid.attrs["excavation_names"])
    failed = state["failed"].values == step
    opened = (np.array(mined, int) >= 0) & (np.array(mined, int) <= step)
    nearest, _ = nearest_opening(
        state["position"].values[failed], grid["piece_origin"].values, float(grid.attrs["fine_cell"]),
        grid["piece_excavation"].values.astype(np.int64), opened, np.arange(len(names)),
    )  # fmt: skip
    volume = np.bincount(nearest[nearest >= 0], state["volume"].values[failed][nearest >= 0], minlength=len(names))
    return names[int(volume.argmax())] if volume.any() else ""


def _cells(dataset: xr.Dataset) -> tuple[int, int]:
    """Cells of a grid or a state, and those of the finest size that there can be: a first step may mine nothing."""
    level = dataset["cell_level"].values
    return len(level), int(np.count_nonzero(level == int(dataset.attrs["levels"]) - 1))
