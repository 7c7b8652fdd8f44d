"""The energy balance of a stage. Each of its terms is counted by itself.

Rock that stays in the stage has particles of volume V, full stress s = s' + s0 (s': change since virgin, s0: virgin),
and nodes that move by du. Equilibrium is r = F - sum B^T s' V - H = 0 (H: hourglass forces), with forces F that are
constant within an increment. With G = sum B^T s0 V, weight and in-situ stress at the boundary, work is done by F + G.

A path is straight, from one committed state a to the next, b. Along it strain is elastic but for the flow p of failed
rock, whose path integral of stress : dp is d (kernels.energy_sums). As stress and force are linear in strain and
motion but for that, on every path

    (F + G) . du = [sum V s : C^-1 : s / 2] + [q^2 / 2 k] + sum V d + M + R
    work         = stored                   + hourglass   + flow      + motion + unbalanced
    M = r_a . du / 2 - sum V (d - (s_a + s_b) : p / 2),    R = r_b . du / 2

where [] is the change from a to b. M + R is the path integral of r: what forces do beyond what rock absorbs. It ends
as waves and heat. R is the part of it that forces do which are still unbalanced at b, where rock counts as in
equilibrium: zero in perfect equilibrium, and in proportion to the tolerance of the relaxation. Between two generations
of failure that is solver.cascade_tolerance, and R the error of motion by it. So nothing but round-off is left over.

An excavation whose support is ramped down in n increments sets 1 / n in motion of what it does at once (Salamon 1984,
J. South. Afr. Inst. Min. Metall. 84, 233). A boundary that is strained moves slowly: the mean of its forces at both
ends times its motion is work, and what flow adds to that on the path is work of the boundary, not motion.

Neither flow nor a drop is ever negative unless rock dilates above its friction: that is counted as gained, by itself.

Cells that are split (stages/state_transfer.py) hold more energy afterwards, or less: the same displacement, felt at
more points. That is no work of anything, and counted by itself.

Failure happens in equilibrium. What stress loses at fixed strain is dissipated, (s_trial + s_peak) / 2 : overshoot
strain and (s_peak + s_residual) / 2 : seismic strain; the hourglass energy of its cell is lost. That nodes are out of
balance then is the next path's r_a. Rock that is mined takes its energy with it; it is no part of these volumes, but of
Salamon's energy released.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mpm_core.kernels.energy_sums import (
    energy_of_hourglass,
    make_flow_energy,
    stored_energy,
    work_of_forces,
    work_of_stress,
)
from mpm_core.kernels.nodal_operations import advance_nodes
from mpm_core.model.model import Model
from mpm_core.model.state import (
    BOUNDARY,
    FLOW,
    FORCES,
    GAINED,
    HOURGLASS,
    MOTION,
    OVERSHOOT,
    REFINED,
    SEISMIC,
    UNBALANCED,
    State,
)

BALANCE_EQUATION = (
    "energy_work = energy_support + energy_stored + energy_hourglass + energy_hourglass_released + energy_seismic + "
    "energy_overshoot + energy_flow - energy_gained + energy_motion + energy_unbalanced + energy_refined + "
    "energy_left, J, of the rock that stays; "
    "energy_released is Salamon's (1984): energy_mined + all of these but support, stored, hourglass, refined and "
    "left; "
    "energies below energy_round_off are round-off"
)
MIN_ENERGY_SHARE = 1e-12  # Energies below this share of the rock's elastic energy are round-off.


class EnergyBody(Protocol):
    """The attributes of a body (body.Body) that the energy balance reads."""

    model: Model
    state: State
    volume: np.ndarray
    attached: np.ndarray
    unbalanced: np.ndarray
    slot_force: np.ndarray
    hourglass: np.ndarray
    flowing: np.ndarray
    flow_start: tuple[np.ndarray, np.ndarray]
    rest: np.ndarray


def virgin_work(body: EnergyBody, moved: np.ndarray) -> float:
    """Work of the virgin stress of a body's rock on a nodal motion (node, d) m, J: G . du of the balance."""
    model, particles = body.model, body.model.particles
    return work_of_stress(
        model.cell_nodes, model.grid.cell_size, particles.cell, particles.row, particles.slopes, body.volume,
        model.insitu, moved,
    )  # fmt: skip


class EnergyPath:
    """The path from the last committed state on. The work of forces on it is counted when it ends."""

    external: np.ndarray | None
    residual: np.ndarray | None
    start: np.ndarray | None
    carried: np.ndarray | None

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the path: nothing is under way."""
        self.external = self.residual = self.start = self.carried = None

    def strain(self, body: EnergyBody) -> None:
        """Note, before the boundary moves, that nodes carry their present forces until the path begins."""
        if self.start is None:
            self.start, self.carried = body.state.displacement.copy(), nodal_forces(body)

    def begin(self, body: EnergyBody, external: np.ndarray) -> None:
        """External forces (node, d) N act from now on, nothing has moved yet; a path that has begun goes on."""
        if self.external is not None:
            return
        self.external = external
        self.residual = body.unbalanced.copy()
        if self.start is None:  # the last equilibrium as a rule, which is kept in any case
            begins_at_rest = np.array_equal(body.rest, body.state.displacement)
            self.start = body.rest if begins_at_rest else body.state.displacement.copy()
        if self.carried is not None:
            self.residual[:] = np.where(body.model.held, 0.0, external + self.carried)

    def end(self, body: EnergyBody, beyond: float, in_equilibrium: bool = True) -> None:
        """Count the work that was done. beyond J: how much more flow dissipates on the path than at its mean stress;
        in_equilibrium: what is unbalanced now (body.unbalanced) counts as none."""
        if self.external is None:
            return
        assert self.start is not None  # set with the external forces
        assert self.residual is not None
        state, held = body.state, body.model.held
        moved = state.displacement - self.start
        state.energy[FORCES] += work_of_forces(self.external, moved)
        state.energy[MOTION] += 0.5 * work_of_forces(self.residual, moved)
        state.energy[UNBALANCED if in_equilibrium else MOTION] += 0.5 * work_of_forces(body.unbalanced, moved)
        if self.carried is None:
            state.energy[MOTION] -= beyond
        else:
            reaction = np.where(held, -0.5 * (self.carried + nodal_forces(body)), 0.0)
            state.energy[BOUNDARY] += work_of_forces(reaction, moved) + beyond
        self.reset()


def nodal_forces(body: EnergyBody) -> np.ndarray:
    """Forces -B^T s' V - H (node, d) N of the stress that slots were last filled from, at held nodes, too."""
    scatter, state = body.model.scatter, body.state
    zeros, found = np.zeros_like(state.displacement), np.zeros_like(state.displacement)
    moves = body.attached[:, None] & np.ones(body.model.dimension, bool)
    advance_nodes(
        scatter.free_nodes, scatter.sum_start, scatter.sum_slots, scatter.sum_weights, body.slot_force, zeros,
        np.empty(0), moves, 0.0, 0.0, zeros.copy(), zeros, found,
    )  # fmt: skip
    return found


def dissipate(state: State, entry: int, energy: np.ndarray) -> None:
    """Count energies (k,) J of particles: what is dissipated in the entry, what rock has gained in its own."""
    state.energy[entry] += float(np.sum(np.maximum(energy, 0.0)))
    state.energy[GAINED] -= float(np.sum(np.minimum(energy, 0.0)))


def count_flow(body: EnergyBody) -> float:
    """Count what has flowed as dissipated; how much more that is than at the mean stress of the path, J."""
    model, state = body.model, body.state
    energy = np.empty((len(body.flowing), 2))
    make_flow_energy(model.law)(
        body.flowing, *body.flow_start, model.insitu, state.stress, state.later_strain, model.particles.material,
        model.elastic_constants, model.residual_rows, energy,
    )  # fmt: skip
    energy *= body.volume[body.flowing, None]
    dissipate(state, FLOW, energy[:, 0])
    return float(np.sum(energy[:, 1]))


def hourglass_energies(force: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Energy (cell,) J of hourglass forces (cell, mode, d) N: q^2 / 2 k over their modes; stiffness (cell,) N/m."""
    energy = np.empty(len(force))
    energy_of_hourglass(force, stiffness, energy)
    return energy


def elastic_energy(model: Model, state: State, volume: np.ndarray) -> float:
    """Elastic energy of the full stress, J (per m in 2-D)."""
    particles = model.particles
    return stored_energy(state.stress, model.insitu, volume, particles.material, model.elastic_constants)


def mined_energy(model: Model, state: State, stood: np.ndarray, stays: np.ndarray) -> float:
    """Elastic energy of what is mined, J (per m in 2-D), as it stood: before rock next to new edges becomes softer.

    stood, stays (particle,): volumes before and after, m3 (m2 in 2-D); fill that is placed counts nothing.
    """
    return elastic_energy(model, state, np.maximum(stood - stays, 0.0))


@dataclass
class Balance:
    """Energies at the start of a stage, J (per m in 2-D): of the rock that stays, and of what is mined."""

    stored: float
    hourglass: float
    mined: float

    @classmethod
    def at_start(cls, body: EnergyBody, mined: float) -> "Balance":
        """body: with the volumes that stay; mined J: energy that goes with what is mined."""
        stored = elastic_energy(body.model, body.state, body.volume)
        hourglass = float(hourglass_energies(body.state.hourglass_force, body.hourglass).sum())
        return cls(stored, hourglass, mined)

    def facts(self, body: EnergyBody, target: np.ndarray, moved: np.ndarray) -> dict[str, float | str]:
        """Every term of the balance at the stage's end, J, see BALANCE_EQUATION.

        target (node, d) N: forces that act for good; moved (node, d) m: motion of the stage. Particles that move do so
        by velocities of their own: their forces' work is not counted.
        """
        model, state = body.model, body.state
        counted = np.nan if model.scene.solver.move else 1.0
        lasting = work_of_forces(target, moved)
        elastic = elastic_energy(model, state, body.volume)
        terms = {
            "support": (lasting - state.energy[FORCES]) * counted,
            "stored": elastic - self.stored,
            "hourglass": float(hourglass_energies(state.hourglass_force, body.hourglass).sum()) - self.hourglass,
            "hourglass_released": state.energy[HOURGLASS],
            "seismic": state.energy[SEISMIC],
            "overshoot": state.energy[OVERSHOOT],
            "flow": state.energy[FLOW],
            "motion": state.energy[MOTION] * counted,
            "unbalanced": state.energy[UNBALANCED] * counted,
        }
        work = (lasting + virgin_work(body, moved) + state.energy[BOUNDARY]) * counted
        gained, refined = state.energy[GAINED], -state.energy[REFINED]
        left = work + gained - refined - sum(terms.values())
        largest = np.nanmax(np.abs([work, gained, *terms.values()]))
        dissipated = terms["seismic"] + terms["overshoot"] + terms["flow"]
        motion = terms["motion"] + terms["unbalanced"]
        released = self.mined + dissipated - gained + terms["hourglass_released"] + motion
        round_off = MIN_ENERGY_SHARE * max(elastic, self.stored + self.mined)
        values = {"work": work, **terms, "gained": gained, "refined": refined, "left": left, "mined": self.mined}
        values |= {"released": released, "dissipated": dissipated, "elastic": elastic, "round_off": round_off}
        scale = model.scene.thickness
        facts: dict[str, float | str] = {f"energy_{name}": float(value) * scale for name, value in values.items()}
        share = abs(left) / largest if largest > round_off else 0.0 * counted  # nothing happened
        return facts | {"energy_left_share": float(share), "energy_balance": BALANCE_EQUATION}
