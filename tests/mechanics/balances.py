"""Small scenes whose energy is balanced: a quarter of a tunnel, or an eighth of a sphere."""

from mechanics.scenes import COULOMB, ball, excavation, grid_around, make_dataset, make_scene, uniform
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step

A, PRESSURE = 6.0, 30e6
SYMMETRY = {"x_lower": "roller", "y_lower": "roller", "z_lower": "roller"}
WEAK = COULOMB | {"cohesion": {"intact": 2e6, "residual": 0.0}}
PLASTIC = COULOMB | {
    "friction_angle": {"intact": 30.0, "residual": 30.0},
    "cohesion": {"intact": 2e6, "residual": 2e6},
    "tension_cutoff": {"intact": 1e6, "residual": 1e6},
}
PLANES = COULOMB | {
    "model": "weak_planes",
    "planes": {
        "dip": 60.0,
        "dip_direction": 90.0,
        "cohesion": {"intact": 1e6, "residual": 0.0},
        "friction_angle": {"intact": 25.0, "residual": 20.0},
        "dilation_angle": {"intact": 5.0, "residual": 5.0},
        "tension_cutoff": {"intact": 0.0, "residual": 0.0},
    },
}


NOTHING = "nothing"


def mined(tmp_path, *, plane=None, fills=(None,), base=6, host=COULOMB, pressure=PRESSURE, strain=None, inside=None,
          changes=None, **solver):  # fmt: skip
    """State and facts of each step that mines, and fills, one sphere after the other, each 2 m larger (tunnels in 2-D).

    Where a fill is NOTHING its step mines nothing. pressure Pa: of the virgin rock; inside Pa: on the walls, from the
    step on in which they are mined; strain: of the boundary in the first of them; changes: of the scene.
    """
    d = 2 if plane else 3
    shapes = [ball([0.0] * d, A + 2.0 * number) for number in range(len(fills))]
    options = {
        "stress": uniform(*[-pressure] * 3),
        "boundary": SYMMETRY,
        "host": host,
        "strains": [{"name": "press", "since": 1, "strain": strain}] if strain else [],
        "solver": {"tolerance": 1e-6} | solver,
    } | (changes or {})
    entries = [
        excavation(-1, name=f"e{step}") if fill == NOTHING else excavation(step, fill, step, name=f"e{step}")
        for step, fill in enumerate(fills, 1)
    ]
    if inside:
        entries = [entry | {"pressure": [[step, inside]]} for step, entry in enumerate(entries, 1)]
    grid, state, found = None, None, []
    for steps in range(1, len(fills) + 2):
        later = [excavation(-1, None, name=f"e{step}") for step in range(steps, len(fills) + 1)]
        scene = make_scene(plane, excavations=entries[: steps - 1] + later, steps=steps, **options)
        if grid is None:
            grid = make_dataset(scene, grid_around(shapes, [base] * d, 3, 4.0), shapes)
            state, _ = elastic_stage(scene, grid, tmp_path / "f.npz")
        state, facts = mining_step(scene, grid, state, tmp_path / "f.npz")
        found.append((state, facts))
    return found[1:]
