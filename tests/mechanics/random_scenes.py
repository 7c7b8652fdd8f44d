"""Random small scenes: boxes, discs, slots, slivers, blocks in voids, all mixes of faces, weight or none, fill or none.

Each comes to rest with finite stress and bounded motion, or is refused in one line. A reduced set is a test
(test_random_scenes.py); `python -m tests.mechanics.random_scenes 0 300` runs the scenes 0 to 299 and prints a table.
"""

import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.errors import InputError
from mpm_core.scene.scene import FACES, Scene
from mpm_core.stages.equilibrium_stages import MIN_STRESS_SHARE, elastic_stage, mining_step
from tests.mechanics.scenes import COULOMB, HOST, ball, box, excavation, grid_around, make_dataset, make_scene, uniform

CONDITIONS = ("fixed", "roller", "traction", "free")
SIZE = 12.0  # m: edge of the domain
SURFACE = 60.0  # m above its lower face


@dataclass(frozen=True)
class RandomScene:
    """What a seed makes: keywords of make_scene but for steps, and the grid with its shapes."""

    keywords: dict
    shapes: list
    grid: object
    steps: int

    def scene(self, step: int, **solver) -> Scene:
        """As the stage of a step gets it: what comes later is not yet known."""
        known = [
            entry | {key: entry[key] if entry[key] <= step else -1 for key in ("mined", "filled")}
            for entry in self.keywords["excavations"]
        ]
        settings = self.keywords["solver"] | solver
        return make_scene(**self.keywords | {"excavations": known, "steps": step + 1, "solver": settings})


def make(seed: int) -> RandomScene:
    """The scene of a seed. Raises InputError where it is refused at once."""
    random = np.random.default_rng(seed)
    plane = str(random.choice(["xz", "xz", "xy"])) if random.random() < 0.8 else None
    dimension = 2 if plane else 3
    shapes = [_shape(random, dimension) for _ in range(random.integers(1, 5))]
    steps = int(random.integers(1, 4))
    entries = []
    for number in range(len(shapes)):
        mined = int(random.integers(steps)) if number else 0
        filled = random.choice([None, mined, mined + 1], p=[0.6, 0.2, 0.2])
        fill = {} if filled is None or filled >= steps else {"fill": "fill", "filled": int(filled)}
        entries.append(excavation(mined, name=f"excavation_{number}", **fill))
    conditions = _faces(random)
    if plane != "xy" and random.random() < 0.5:
        stress = {"constant": [0.0] * 6, "gradient": [*(-random.uniform(0.01, 0.03, 2) * 1e6), -0.027e6, 0, 0, 0]}
        if random.random() < 0.2:
            stress["gradient"][4] = 0.003e6
    else:
        stress = uniform(*(-random.uniform(0.0, 3e6, 3)), 0, 0, random.choice([0.0, 0.3e6]))
    strength = (
        {"cohesion": {"intact": 10.0 ** random.uniform(5.5, 7), "residual": 0.3e6}} if random.random() < 0.6 else {}
    )
    levels = int(random.integers(1, 4)) if dimension == 2 else 2
    keywords = {
        "plane": plane,
        "host": COULOMB | strength if strength else HOST,
        "stress": stress,
        "surface": SURFACE,
        "excavations": entries,
        "boundary": conditions,
        "particles_per_cell": int(random.choice([1, 1, 2])),
        "cut_cells": str(random.choice(["mean", "whole", "subdivide"])),
        "solver": {
            "scheme": str(random.choice(["multigrid", "multigrid", "explicit"])),
            "increments": int(random.integers(0, 4)),
            "max_iterations": 6000,
        },
    }
    coarse = 3.0 if dimension == 2 else 4.0
    grid = grid_around(shapes, (round(SIZE / coarse),) * dimension, levels, coarse, rings=int(random.integers(0, 2)))
    return RandomScene(keywords, shapes, grid, steps)


def _faces(random) -> dict:
    """Conditions by face: the same all round, two kinds, or any mix."""
    kind = random.integers(4)
    if kind == 0:
        return dict.fromkeys(FACES, str(random.choice(CONDITIONS)))
    if kind == 1:
        return {face: "roller" if face[0] != "z" else "fixed" if face == "z_lower" else "free" for face in FACES}
    if kind == 2:
        special, others = random.choice(CONDITIONS, 2)
        axis = str(random.choice(["x", "y", "z"]))
        return {face: str(special if face[0] == axis else others) for face in FACES}
    return {face: str(random.choice(CONDITIONS)) for face in FACES}


def _shape(random, dimension: int):
    """A box, a disc, a slot, a void with a block in it, a shell around all, or what lies outside a body."""
    center, kind = random.uniform(0.1, 0.9, dimension) * SIZE, random.integers(7)
    edge = random.uniform(0.5, 5.0, dimension)
    if random.random() < 0.4:  # on the cells' own lattice: edges and corners meet
        center, edge = np.rint(center), 2.0 * np.rint(edge / 2.0 + 0.5)
    if kind <= 1:
        return box(center - edge / 2, center + edge / 2)
    if kind == 2:
        return ball(center, edge[0])
    if kind == 3:
        edge[random.integers(dimension)] = random.choice([0.1, 0.4, 1.0])
        edge[random.integers(dimension)] = random.choice([4.0, 30.0])
        return box(center - edge / 2, center + edge / 2)
    if kind in (4, 5):
        whole = box(center - edge / 2 - 1.0, center + edge / 2 + 1.0)
        offset = random.choice([0.0, 0.7, 1.0], dimension)
        block = box(
            center - edge * random.uniform(0.1, 0.5) + offset, center + edge * random.uniform(0.1, 0.5) + offset
        )
        return lambda x: whole(x) & ~block(x)
    if random.random() < 0.3:
        return box([-1.0] * dimension, [SIZE + 1.0] * dimension)
    body = ball([SIZE / 2] * dimension, random.uniform(2.0, 5.9))
    return lambda x: ~body(x)


def run(made: RandomScene, folder: Path, **solver):
    """(dataset, facts) of the last stage: elastic, then all steps. Raises what they raise."""
    path = folder / "failed.npz"
    grid = make_dataset(made.scene(0), made.grid, made.shapes)
    state, facts = elastic_stage(made.scene(0, **solver), grid, path)
    for step in range(made.steps):
        state, facts = mining_step(made.scene(step, **solver), grid, state, path)
    return state, facts


def outcome(seed: int, folder: Path) -> tuple[str, str]:
    """ "rest", "refused" or what is wrong with it, and more about it in words."""
    try:
        made = make(seed)
        state, facts = run(made, folder)
    except InputError as error:
        return ("refused" if "\n" not in str(error) else "many lines"), str(error)
    except Exception as error:  # whatever it is: the outcome that this looks for
        return "traceback", repr(error)
    moved = np.abs(state.node_displacement.values).max()
    words = f"moved {moved:.2g} m, loose {facts['loose_pieces']} of {facts['loose_volume']:.2g} m3"
    if not np.isfinite(state.stress.values).all() or moved > made.grid.fine_cell:
        return "unbounded", words
    if facts["energy_dissipated"] < 0.0:
        return "makes energy", f"dissipated {facts['energy_dissipated']:.3g} J"
    return "rest", words


def elastic_difference(seed: int, folder: Path) -> float | None:
    """Largest difference in stress between this scene's elastic stage by its own scheme at the default tolerance and by
    the other at 1e-9, share of the largest stress, or of MIN_STRESS_SHARE of the virgin one; None if it is refused."""
    made = replace(make(seed), steps=0)
    other = {"explicit": "multigrid", "multigrid": "explicit"}[made.keywords["solver"]["scheme"]]
    try:
        (one, _), (two, _) = run(made, folder), run(made, folder, scheme=other, tolerance=1e-9, max_iterations=30000)
    except InputError:
        return None
    present = one.volume.values > 0.0
    gap = np.abs(one.stress.values - two.stress.values)[present].max()
    virgin = made.scene(0).insitu.at(np.linspace(0.0, SIZE, 2))
    return float(gap / max(np.abs(two.stress.values).max(), MIN_STRESS_SHARE * np.abs(virgin).max()))


def main() -> None:
    """Run the scenes from the first to before the last number given; exit status 1 if one of them is wrong."""
    first, last = (int(word) for word in sys.argv[1:3])
    counts = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, last):
            began = time.perf_counter()
            kind, words = outcome(seed, Path(folder))
            counts[kind] += 1
            print(f"{seed:6d} {time.perf_counter() - began:6.1f} s  {kind:12s} {words}", flush=True)
    print(dict(counts))
    sys.exit(bool(set(counts) - {"rest", "refused"}))


if __name__ == "__main__":
    main()
