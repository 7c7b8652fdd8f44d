"""Kernels are compiled once for each version: the next process finds them on disk."""

import gc
import subprocess
import sys
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from mpm_core.equilibrium.moving_scheme import MovingBody
from tests.mechanics.scenes import COULOMB, grid_around, make_model, make_scene

ROOT = Path(__file__).parents[2]
STEP = "from tests.mechanics.test_kept_kernels import compiled_anew; print(compiled_anew())"


def compiled_anew() -> list[str]:
    """Names of the kernels kept on disk that this process had to compile for steps of moving particles."""
    for plane in ("xz", None):
        grid = grid_around([], (2,) * (2 if plane else 3), levels=1, coarse=4.0)
        model = make_model(make_scene(plane, host=COULOMB), grid)
        body = MovingBody(model, model.virgin_state(), model.particles.full_volume)
        body.advance(0.0 * body.state.displacement, body.time_step)
        body.update(body.time_step)
    kernels = [value for value in gc.get_objects() if issubclass(type(value), Dispatcher)]  # no weak proxy
    assert any(kernel.py_func.__name__ == "cycle" and kernel.signatures for kernel in kernels)
    return sorted({kernel.py_func.__name__ for kernel in kernels if kernel.stats.cache_misses})


def test_the_next_process_compiles_no_kernel():
    """Among them those made per law and dimension: what their closure holds is the same in every process.

    A compiled function there is not (numba names it anew), a module is.
    """
    compiled_anew()
    run = subprocess.run([sys.executable, "-c", STEP], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split("\n")[-2] == "[]"
