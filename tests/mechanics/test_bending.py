"""Rock one cell thick between voids bends as plate theory says, wherever its walls lie in their cells."""

import numpy as np
import pytest

from mechanics.scenes import HOST, box, excavation, grid_around, make_dataset, make_scene
from mpm_core.equilibrium.convergence import History
from mpm_core.files.state_datasets import read_grid
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.ground import Ground
from mpm_core.stages.step_cells import make_scheme, stored

CURVATURE = 1e-6  # 1/m
SPAN = {2: 24, 3: 8}  # Cells of 1 m along a skin.


def skin(dimension: int, bottom: float, top: float, poisson_ratio: float):
    """A scheme for weightless rock between two elevations, whose sides along the skin are held."""
    span, height = SPAN[dimension], 4
    sides = [-1.0] * (dimension - 1), [span + 1.0] * (dimension - 1)
    voids = [box([*sides[0], top], [*sides[1], height]), box([*sides[0], -1.0], [*sides[1], bottom])]
    scene = make_scene(
        {2: "xz", 3: None}[dimension],
        host=HOST | {"poisson_ratio": poisson_ratio},
        excavations=[excavation(name="above"), excavation(name="below")],
        boundary={"z_lower": "free", "z_upper": "free"},
        solver={"scheme": "multigrid"},
    )
    grid = make_dataset(scene, grid_around([], (*[span] * (dimension - 1), height), 1, 1.0), voids)
    model = Ground.of(scene, grid).model(*read_grid(grid), Unsupported.none())
    return make_scheme(model, model.virgin_state(), model.volumes(0))


def bent(scheme, middle: float, poisson_ratio: float, along_x: float, along_y: float, twist: float) -> float:
    """Energy, J (per m in 2-D), at rest under the exact motion of a plate's sides with these curvatures, 1/m."""
    body, place = scheme.body, scheme.body.model.node_position
    x, y = place[:, 0], place[:, 1] if place.shape[1] == 3 else 0.0 * place[:, 0]
    z = place[:, -1] - middle
    u, v = -z * (along_x * x + twist * y), -z * (along_y * y + twist * x)
    w = 0.5 * (along_x * x**2 + along_y * y**2) + twist * x * y
    w += poisson_ratio / (2 * (1 - poisson_ratio)) * (along_x + along_y) * z**2
    motion = np.stack([u, v, w] if place.shape[1] == 3 else [u, w], axis=1)
    body.displace(motion)
    reference = HOST["youngs_modulus"] * CURVATURE
    scheme.reach_equilibrium(np.zeros_like(motion), 1e-9, reference, History(1e-9))
    return stored(body)


def rigidity(thickness: float, poisson_ratio: float) -> float:
    """D of a plate, N m."""
    return HOST["youngs_modulus"] * thickness**3 / (12 * (1 - poisson_ratio**2))


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.25, 0.4, 0.49])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_skin_of_one_cell_bends_as_a_plate(dimension, poisson_ratio):
    """D k^2 / 2 per area (Timoshenko and Goodier 1970, article 98), to round-off."""
    energy = bent(skin(dimension, 1.0, 2.0, poisson_ratio), 1.5, poisson_ratio, CURVATURE, 0.0, 0.0)
    area = SPAN[dimension] ** (dimension - 1)
    assert energy == pytest.approx(0.5 * rigidity(1.0, poisson_ratio) * CURVATURE**2 * area, rel=1e-6)


@pytest.mark.parametrize(
    ("bottom", "top"), [(1.0, 1.5), (1.25, 1.75), (1.5, 2.5), (1.0, 2.5), (1.25, 3.0), (1.5, 3.5), (1.0, 3.0)]
)
def test_a_skin_whose_walls_cut_cells_bends_with_the_cube_of_its_thickness(bottom, top):
    """2 %: the ends are held in the motion of the exact plate, not of its cells."""
    energy = bent(skin(2, bottom, top, 0.25), 0.5 * (bottom + top), 0.25, CURVATURE, 0.0, 0.0)
    assert energy == pytest.approx(0.5 * rigidity(top - bottom, 0.25) * CURVATURE**2 * SPAN[2], rel=0.02)


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.25, 0.4])
def test_a_plate_of_one_cell_bends_alike_in_all_directions(poisson_ratio):
    """Energy per area D / 2 (k_x^2 + k_y^2 + 2 k_xy^2): that of theory without what Poisson's ratio couples."""
    for along_x, along_y, twist in ([1, 1, 0], [1, -1, 0], [0, 0, 1], [1, 0.5, 0.3]):
        curvature = CURVATURE * np.array([along_x, along_y, twist])
        energy = bent(skin(3, 1.0, 2.0, poisson_ratio), 1.5, poisson_ratio, *curvature)
        form = along_x**2 + along_y**2 + 2 * twist**2
        expected = 0.5 * rigidity(1.0, poisson_ratio) * CURVATURE**2 * form * SPAN[3] ** 2
        assert energy == pytest.approx(expected, rel=1e-6)
