"""Response of the discretisation to prescribed motions, stresses and forces, on the grids of the study."""

from dataclasses import dataclass, replace

import numpy as np

from common.voigt import voigt_from_tensor
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.explicit_scheme import take_time_step
from mpm_core.equilibrium.moving_scheme import MovingBody
from mpm_core.equilibrium.scheme import Scheme
from mpm_core.files.state_datasets import read_grid
from mpm_core.kernels.nodal_operations import collect_to_parents, interpolate, particle_loads
from mpm_core.model.model import Model
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.ground import Ground
from mpm_core.stages.step_cells import make_scheme
from verification.answers.invariants.closed_form import Elastic, Smooth
from verification.results import Variant

DOMAIN_MARGIN = 4.0  # Empty space between a moving body and the faces of its domain, m.


def model_of(variant: Variant, **changes) -> Model:
    """Model of a variant on its own grid. changes: of the scene; `move` and `damping` are settings of the solver."""
    scene = variant.scene()
    solver: dict = {key: changes.pop(key) for key in ("move", "damping") if key in changes}
    scene = replace(scene, **changes, solver=scene.solver.model_copy(update=solver))
    return Ground.of(scene, variant.grid).model(*read_grid(variant.grid), Unsupported.none())


def scheme_of(model: Model) -> Scheme:
    """Scheme at the virgin state, without the rock that is mined in history."""
    return make_scheme(model, model.virgin_state(), model.volumes(0))


def host(model: Model) -> Elastic:
    """Moduli of the host rock."""
    material = model.scene.materials["host"]
    return Elastic(material.youngs_modulus, material.poisson_ratio)


def rigid_motions(model: Model, random: np.random.Generator) -> dict[str, float]:
    """Largest nodal force of a random translation, and of a random rotation about the domain's corner, by name.

    Forces are shares of a node's stiffness times the motion: M h^(d - 2) per metre, M h^(d - 1) per radian.
    """
    d, cell = model.dimension, model.grid.cell_size.max()
    modulus = host(model).confined_modulus
    way, turn = random.standard_normal(d), random.standard_normal((d, d))
    spin = turn - turn.T
    moved, turned = scheme_of(model).body, scheme_of(model).body
    moved.displace(np.tile(way, (len(model.grid.node_index), 1)))
    turned.deform(spin)
    return {
        "translation": largest(moved.internal_force()) / (modulus * cell ** (d - 2) * largest(way)),
        "rotation": largest(turned.internal_force()) / (modulus * cell ** (d - 1) * largest(spin)),
    }


def largest(values: np.ndarray) -> float:
    """Largest absolute value."""
    return float(np.abs(values).max())


def resultants(model: Model, random: np.random.Generator) -> tuple[float, float]:
    """Total force and moment of random stress and hourglass forces, as share of the sums of their terms' sizes."""
    body = scheme_of(model).body
    state = body.state
    state.stress[:] = 1e6 * random.standard_normal(state.stress.shape)
    state.hourglass_force[:] = 1e6 * random.standard_normal(state.hourglass_force.shape)
    force = body.internal_force()
    arm = model.node_position - model.node_position.mean(axis=0)
    total = np.abs(force.sum(axis=0)).max() / np.abs(force).sum()
    moment = 0.0
    for i in range(model.dimension):
        for j in range(i):
            terms = arm[:, i] * force[:, j], arm[:, j] * force[:, i]
            moment = max(moment, abs(np.sum(terms[0] - terms[1])) / np.sum(np.abs(terms)))
    return float(total), float(moment)


def nodal_mass(model: Model) -> tuple[float, np.ndarray]:
    """Mass at the nodes, kg (per metre of a section), and its centre (d,) m."""
    mass = scheme_of(model).body.mass
    return float(mass.sum()), (mass[:, None] * model.node_position).sum(axis=0) / mass.sum()


@dataclass(frozen=True)
class Flight:
    """Particles that flew through the grid: drift of momentum and nodal mass as shares, and number of cell changes."""

    momentum: float
    mass: float
    cell_changes: int


def fly(variant: Variant, random: np.random.Generator, steps: int, reach: float) -> Flight:
    """Let a body of random stress move freely, undamped: the full cycle of the paper, Eqs 1 to 6.

    It flies along the diagonal, by `reach` of a finest cell in a step and axis, each particle up to a third faster or
    slower. Momentum as share of the sum of sizes.
    """
    model = model_of(variant, particles_per_cell=2, cut_cells="whole", move=True, damping=0.0)
    grid, position = model.grid, model.particles.position
    upper = grid.origin + grid.shape * grid.fine_cell
    inside = ((position > grid.origin + DOMAIN_MARGIN) & (position < upper - DOMAIN_MARGIN)).all(axis=1)
    body = MovingBody(model, model.virgin_state(), np.where(inside, model.volumes(0), 0.0))
    body.state.stress[:] = 1e6 * random.standard_normal(body.state.stress.shape)
    speed = reach * grid.fine_cell / body.time_step
    body.velocity[:] = speed * random.uniform(2 / 3, 4 / 3, body.velocity.shape)
    nothing = np.zeros((len(grid.node_index), model.dimension))
    mass = body.particle_mass[:, None].copy()

    def momentum() -> np.ndarray:
        return (mass * body.velocity).sum(axis=0)

    start, size = momentum(), np.abs(mass * body.velocity).sum()
    body.internal_force()  # The first time step needs the forces.
    drift = lost = 0.0
    for _ in range(steps):
        take_time_step(body, nothing)
        drift = max(drift, float(np.abs(momentum() - start).max() / size))
        lost = max(lost, abs(float(body.mass.sum() / mass.sum()) - 1.0))
    return Flight(drift, lost, body.state.cell_changes)


@dataclass(frozen=True)
class Solved:
    """A smooth field solved for: finest and coarsest cell m, cells, and L2 errors as share of the field."""

    cell: float
    coarse_cell: float
    cells: int
    displacement: float
    stress: float


def solve_smooth(variant: Variant, smooth: dict, particles_per_edge: int) -> Solved:
    """Equilibrium under the force of a smooth field that is given on the (fixed) boundary.

    smooth: waves (half waves per width of the domain), phases and tolerance.
    """
    model = model_of(variant, particles_per_cell=particles_per_edge)
    grid, particles, d = model.grid, model.particles, model.dimension
    width = float(grid.shape[0] * grid.fine_cell)
    waves, phases = np.array(smooth["waves"], float)[:d, :d], np.array(smooth["phases"], float)[:d]
    field, tolerance = Smooth(waves * np.pi / width, phases), smooth["tolerance"]
    rock, volume = host(model), model.volumes(0)
    force = np.zeros((len(grid.node_index), d))
    body = field.body_force(particles.position, rock) * volume[:, None]
    none = np.zeros((particles.count, 6))
    modes, slopes = particles.modes[particles.row], particles.slopes[particles.row]
    particle_loads(model.cell_nodes, grid.cell_size, particles.cell, modes, slopes, none, body, force)
    collect_to_parents(grid.node_parents, force)
    force[model.held] = 0.0
    scheme = scheme_of(model)
    body = scheme.body
    body.displace(field.displacement(grid.node_position))
    scheme.reach_equilibrium(force, tolerance, norm(force), History(tolerance))
    found = np.zeros((particles.count, d))
    interpolate(model.cell_nodes, particles.cell, particles.row, particles.modes, body.state.displacement, found)
    exact = field.displacement(particles.position)
    stress = voigt_from_tensor(rock.stress(field.gradient(particles.position)))
    return Solved(
        float(grid.fine_cell),
        float(grid.cell_size.max()),
        len(grid.cell_level),
        mean_square(found - exact, volume) / mean_square(exact, volume),
        mean_square(body.state.stress - stress, volume) / mean_square(stress, volume),
    )


def mean_square(values: np.ndarray, weight: np.ndarray) -> float:
    """L2 norm of values (n, k) by weight (n,)."""
    return float(np.sqrt(np.sum(weight[:, None] * values**2)))
