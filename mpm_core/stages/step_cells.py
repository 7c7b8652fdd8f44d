"""A mining step on its present cells, and its transfer to finer cells where needed."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import Brittle, find_brittle
from mpm_core.equilibrium.cascade import Ramp
from mpm_core.equilibrium.convergence import History
from mpm_core.equilibrium.energy_balance import Balance, elastic_energy, hourglass_energies, mined_energy, virgin_work
from mpm_core.equilibrium.explicit_scheme import ExplicitScheme
from mpm_core.equilibrium.falls import MAX_FALLS
from mpm_core.equilibrium.moving_scheme import MovingScheme
from mpm_core.equilibrium.multigrid_scheme import MultigridScheme
from mpm_core.equilibrium.refinement import MAX_WAITING_SHARE, RINGS_SPLIT_AT_ONCE, RefinedCells
from mpm_core.equilibrium.scheme import Scheme
from mpm_core.files.state_datasets import read_grid, read_state, read_unsupported
from mpm_core.grid.adjacency import face_neighbors
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.splitting import split, with_leaves
from mpm_core.model.fallen_rock import coming_loose, mined_volume, part_volumes
from mpm_core.model.model import Model, held_faces
from mpm_core.model.occupancy import Unsupported
from mpm_core.model.particles import bending_stiffness
from mpm_core.model.state import REFINED, State
from mpm_core.stages.external_forces import boundary_strain, external_force, load_size, reference_force
from mpm_core.stages.ground import Ground
from mpm_core.stages.stage_memory import require_cells
from mpm_core.stages.state_transfer import (
    elastic_stress,
    renumber_forces,
    renumber_nodes,
    transfer,
    transfer_forces,
    transfer_nodes,
)

SchemeMaker = Callable[[Model, State, np.ndarray], Scheme]
SCHEMES: dict[str, SchemeMaker] = {"explicit": ExplicitScheme, "multigrid": MultigridScheme}  # by solver.scheme


def make_scheme(model: Model, state: State, volume: np.ndarray) -> Scheme:
    """The scheme that the scene names; explicit steps for particles that rest in their cells or move."""
    solver = model.scene.solver
    kind: SchemeMaker = MovingScheme if solver.move else SCHEMES[solver.scheme]
    return kind(model, state, volume)


def brittle_of(model: Model, volume: np.ndarray, step: int) -> Brittle:
    """Rock of a model that may fail in a step; volume (particle,)."""
    cut = face_neighbors(model.grid, model.changes.cell)  # the only cells whose neighbours matter
    return find_brittle(model, volume, step, *cut)


@dataclass
class StepCells:
    """The data of a step on its cells, replaced as a whole when they are split; the cascade uses it as AdaptiveCells.

    displacement_before (node, d) m: where the step's balance starts from; held_up (node, d) N: what the ramp starts
    with beyond the lasting forces of the step before, which is what the mined rock held up; both at the nodes of now;
    full: as many cells as there may be, or cells that are not split; elsewhere: cells of the mine beyond these, where
    they are a subdomain's; places: what was split, (k, d) each, see `split`; falls: whether rock has fallen in this
    step.
    """

    ground: Ground
    scheme: Scheme
    brittle: Brittle
    ramp: Ramp
    step: int
    displacement_before: np.ndarray
    held_up: np.ndarray
    refinement: RefinedCells
    full: bool = False
    elsewhere: int = 0
    places: list[np.ndarray] = field(default_factory=list)
    falls: bool = False

    def __post_init__(self) -> None:
        self.full = self.full or self.ground.scene.refinement is None

    @property
    def state(self) -> State | None:
        """On the cells of now; None while they are being split."""
        return self.scheme.body.state if "scheme" in vars(self) else None

    @property
    def model(self) -> Model:
        """On the cells of now."""
        return self.scheme.body.model

    def flagged(
        self, model: Model, state: State, brittle: Brittle, fresh: np.ndarray, provisional: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Flagged places (k, d), which need finer cells, and which of fresh particles (k,) fail before that, see
        RefinedCells; none and all once there are as many cells as allowed. provisional: equilibrium is not reached to
        the final tolerance."""
        if self.full:
            return np.empty((0, model.dimension), int), fresh
        patience = 0.0
        if provisional and not self.elsewhere:  # a split of a subdomain costs little
            patience = MAX_WAITING_SHARE * np.count_nonzero(state.failed == self.step)
        return self.refinement.flagged(model, state, brittle, fresh, len(self.model.cell_nodes), patience)

    def split(self, places: np.ndarray, forget: Callable[[], None]) -> bool:
        """Split cells at places (k, d), in equilibrium; False where there would be too many. forget: called before the
        cells are split, to free what belongs to those of now."""
        self.scheme.release()
        grid = split(self.model.grid, places, RINGS_SPLIT_AT_ONCE, 1)
        most = self.ground.refinement.max_cells
        if (cells := len(grid.cell_level) + self.elsewhere) > most:
            logging.warning("%d cells would be more than grid.max_cells, %d: no more are split", cells, most)
            self.full = True
            return False
        before = len(self.model.grid.cell_level)
        forget()
        self.onto(grid)
        self.places.append(places)
        logging.info(
            "%d cells split: %d cells, %d of the finest",
            (len(grid.cell_level) - before) // ((1 << grid.dimension) - 1),
            len(grid.cell_level),
            np.count_nonzero(grid.cell_level == grid.levels - 1),
        )
        return True

    def onto(self, grid: MultiLevelGrid, counted: Callable[[Model], np.ndarray] | None = None) -> None:
        """Go over to a grid whose cells are those of now or parts of them. What that adds to the energy is counted, of
        all cells or of those (cell,) bool that `counted` says of a model."""
        if grid is self.model.grid:
            return
        body = self.scheme.body
        body.commit()
        require_cells(self.ground.scene, grid)
        old, state, was = body.model.stripped(), body.state, stored(body, counted)
        virgin_was = virgin_work(body, self.moved())
        del body, self.scheme, self.brittle  # gigabytes that nothing needs any more
        model = self.ground.on(grid, old)
        state, volume = transfer(old, state, model), model.volumes(self.step)
        self.held_up = transfer_forces(old, self.held_up, model)
        self.displacement_before = transfer_nodes(old, self.displacement_before, model)
        del old
        self.scheme = make_scheme(model, state, volume)
        self._set_step(model, volume)
        self.refinement = RefinedCells.of(grid)
        state.energy[REFINED] += stored(self.scheme.body, counted) - was
        state.energy[REFINED] -= virgin_work(self.scheme.body, self.moved()) - virgin_was

    def _set_step(self, model: Model, volume: np.ndarray) -> None:
        """The step's load and rock that may fail on a model; volume (particle,) m3.

        What has fallen exerts no force any more, whatever the share of the load that acts.
        """
        target, before = external_force(model, self.step), max(self.step - 1, 0)
        lasting = lasting_force(model, before) if before < self.step else target
        start = lasting + self.held_up
        if self.falls and before < self.step:
            without = model.unsupported.of(~model.unsupported.falls_in(self.step))
            whole = self.ground.model(model.grid, model.body, without, all_fallen=True)
            start -= renumber_forces(whole, external_force(whole, self.step), model) - target
        reference = step_reference_force(model, start, target, self.ramp.strain, self.step)
        self.ramp = replace(self.ramp, start=start, target=target, reference=reference)
        self.brittle = brittle_of(model, volume, self.step)

    @property
    def fallen(self) -> Unsupported:
        """What has fallen in this step, in the cells of now."""
        return self.model.unsupported.of(self.model.unsupported.falls_in(self.step))

    def take_out(self, loose: np.ndarray) -> str:
        """Take out particles (k,) that have come loose, and what only they held: they fall, as if excavated. Nothing is
        taken out, and the reason returned, where more falls in the step than falls.MAX_FALLS, or more than the step has
        mined."""
        model, fallen = self.model, self.fallen
        found = coming_loose(
            model.grid, model.changes, held_faces(model.scene), np.unique(model.particles.cell[loose]), self.step
        )
        found = replace(
            found,
            piece=found.piece + np.max(model.unsupported.piece[model.unsupported.step == self.step], initial=-1) + 1,
            fall=found.fall + np.max(fallen.fall, initial=0),
        )
        volume, before = (float(part_volumes(model, part).sum()) for part in (found, fallen))
        number, thickness, mined = int(found.fall[0]), model.scene.thickness, mined_volume(model, self.step)
        logging.info("fall %d: %.3g m3 of rock come loose", number, volume * thickness)
        if volume + before > mined:
            return (
                f"caving: {(volume + before) * thickness:.3g} m3 of rock come loose in this step, more than the "
                f"{mined * thickness:.3g} m3 that it mines"
            )
        if number > MAX_FALLS:
            return f"caving: more than {MAX_FALLS} falls in this step, {before * thickness:.3g} m3 of rock so far"
        self.without(found)
        return ""

    def without(self, fallen: Unsupported, counted: Callable[[Model], np.ndarray] | None = None) -> None:
        """Go over to the mine without parts of its cells that fall. Their energy goes with them; it is counted as
        `onto` does."""
        if not len(fallen.cell):
            return
        body = self.scheme.body
        body.commit()
        old, was, state = body.model, stored(body, counted), body.state
        virgin_was = virgin_work(body, self.moved())
        self.scheme.drop_work_arrays()
        model = self.ground.model(old.grid, old.body, old.unsupported.and_then(fallen), all_fallen=True)
        volume = model.volumes(self.step)
        release_mined_hourglass(body, volume)
        follow_walls(old, model, state)
        self.held_up = renumber_forces(old, self.held_up, model)  # of a node that falls part, once
        self.displacement_before = transfer_nodes(old, self.displacement_before, model)
        self.falls = True
        self.scheme = make_scheme(model, state, volume)
        self._set_step(model, volume)
        state.energy[REFINED] += stored(self.scheme.body, counted) - was
        state.energy[REFINED] -= virgin_work(self.scheme.body, self.moved()) - virgin_was

    def resume(self, saved: dict[str, np.ndarray]) -> None:
        """Go over to the cells of a checkpoint, see Checkpoint.save."""
        if len(saved["cells_index"]) > len(self.model.cell_nodes):  # else none was split: the load is that of now, to
            self.onto(with_leaves(self.model.grid, saved["cells_index"], saved["cells_level"]))  # the last bit
        self.full = bool(saved["full"])
        self.places = [saved["places"]] if len(saved["places"]) else []
        self.without(Unsupported(**{name: saved[f"fallen_{name}"] for name in vars(Unsupported.none())}))
        self.displacement_before = saved["displacement_before"]  # to the last bit, whatever the splits on the way

    def renew(self) -> None:
        """A new scheme, for a state that was changed from outside."""
        body = self.scheme.body
        self.scheme = make_scheme(body.model, body.state, body.volume)

    def moved(self) -> np.ndarray:
        """Motion of the nodes in this step, (node, d) m."""
        return self.scheme.body.state.displacement - self.displacement_before


def begin_step(ground: Ground, previous: xr.Dataset, step: int, history: History) -> tuple[StepCells, Balance]:
    """A step in equilibrium, before any of its load: what it has on its cells, and the balance of its energy.

    A function of its own, so that nobody holds what is on these cells once they are split.
    """
    scene, before = ground.scene, max(step - 1, 0)
    scheme = start_of(ground, previous, before, history)
    model, state = scheme.body.model, scheme.body.state
    lasting = external_force(model, before)
    start = lasting + scheme.body.internal_force()
    mined, gone = model.at(step), 0.0
    volume, target = mined.volumes(step), external_force(mined, step)
    if step > before:
        gone = mined_energy(model, state, scheme.body.volume, volume) + release_mined_hourglass(scheme.body, volume)
        if mined is model:
            scheme.set_volume(volume)
        else:
            scheme.drop_work_arrays()
            start, lasting = renumber_forces(model, start, mined), renumber_forces(model, lasting, mined)
            follow_walls(model, mined, state)
            if len(mined.unheld) > len(model.unheld):
                logging.warning(
                    "fill lies between walls a cell or two apart that were open before, at %d nodes: it does not hold "
                    "them; use smaller cells, or fill in the step that mines",
                    len(mined.unheld),
                )
            model, scheme = mined, make_scheme(mined, state, volume)
    balance = Balance.at_start(scheme.body, gone)
    # What the mined rock held up until now: with it nothing moves; it is ramped to what stays for good.
    start -= scheme.body.internal_force()
    more_strain = boundary_strain(scene, step) - boundary_strain(scene, before)
    ramp = Ramp(start, target, more_strain, step_reference_force(model, start, target, more_strain, step))
    cells = StepCells(
        ground, scheme, brittle_of(model, volume, step), ramp, step, state.displacement.copy(), start - lasting,
        RefinedCells.of(model.grid),
    )  # fmt: skip
    return cells, balance


def lasting_force(model: Model, before: int) -> np.ndarray:
    """Forces (node, d) N of all up to a step before that of the model, at the model's nodes."""
    earlier = model.at(before)
    return renumber_forces(earlier, external_force(earlier, before), model)


def step_reference_force(
    model: Model, start: np.ndarray, target: np.ndarray, more_strain: np.ndarray, step: int
) -> float:
    """Reference of the unbalanced forces of a step on the cells of a model, N, see external_forces.reference_force.

    start, target (node, d) N: of its ramp; more_strain (d, d): of its boundary. On finer cells the same load is shared
    by more nodes, and its 2-norm is smaller.
    """
    change = load_size(model, np.where(model.held, 0.0, target - start), more_strain, step)
    whole = load_size(model, target, boundary_strain(model.scene, step), step)
    return reference_force(change, whole, model.scene.solver.tolerance)


def start_of(ground: Ground, previous: xr.Dataset, before: int, history: History) -> Scheme:
    """The state of the step before in equilibrium, on cells that are fine around all that this step mines."""
    scheme, is_split = on_opened_cells(ground, previous, before)
    if is_split:
        scene, model = ground.scene, scheme.body.model
        force, strain = external_force(model, before), boundary_strain(scene, before)
        scheme.reach_equilibrium(force, scene.solver.tolerance, load_size(model, force, strain, before), history)
        scheme.body.commit()
        scheme.body.state.energy[:] = 0.0  # of cells that are other ones now: no part of what the step does
    return scheme


def on_opened_cells(ground: Ground, previous: xr.Dataset, before: int) -> tuple[Scheme, bool]:
    """The state of the step before on cells that are fine around all that this step mines; whether they are split for
    that."""
    scene, step = ground.scene, len(ground.scene.steps) - 1
    was, body = read_grid(previous)
    ground.refuse_other(was, before)
    grid = ground.opened(was, step) if scene.refinement and step > before else was
    require_cells(scene, grid)
    unsupported = read_unsupported(previous)
    if grid is was:
        model = ground.model(was, body, unsupported, at=before)
        state = read_state(previous, model)
        return make_scheme(model, state, model.volumes(before)), False
    old = ground.model(was, body, unsupported, all_fallen=True, at=before)
    model = ground.on(grid, old, all_fallen=False, at=before)
    state = transfer(old, read_state(previous, old), model)
    return make_scheme(model, state, model.volumes(before)), True


def follow_walls(old: Model, new: Model, state: State) -> None:
    """Place and stress of particles that stand for other samples of their cells in a new model than in the old one, or
    have another stiffness there.

    Intact rock has that of elastic rock which has moved so since virgin; all else keeps its full stress. Nodes of
    their own that walls get are where the one was that they shared.
    """
    renumber_nodes(old, state, new)
    state.position = new.particles.position
    _change_stiffness(old, new, state)
    was, now = old.particles.row, new.particles.row
    own = np.flatnonzero((was != now) | (now >= new.particles.shared_rows))  # the others have the same row of a table
    moved = own[(old.slopes[was[own]] != new.slopes[now[own]]).any(axis=(1, 2))]
    state.stress[moved] += old.insitu[moved] - new.insitu[moved]
    intact = moved[(state.failed[moved] < 0) & new.particles.is_rock[moved]]
    state.stress[intact] = elastic_stress(new, state.displacement, intact)


def _change_stiffness(old: Model, new: Model, state: State) -> None:
    """Stress since virgin and hourglass forces of intact rock at new edges, and of new skins, as if it had had that
    stiffness from the start."""
    was, now = old.particles.material, new.particles.material
    moduli = old.elastic_constants[:, 1]
    factor = np.where(state.failed < 0, moduli[now] / moduli[was], 1.0)
    changed = np.flatnonzero(factor != 1.0)
    state.stress[changed] *= factor[changed, None]
    first = old.particles.group_start[: len(old.cell_nodes)]
    bending = new.bending_share[first] / old.bending_share[first]
    state.hourglass_force *= np.where(state.failed[first] < 0, factor[first] * bending, 1.0)[:, None, None]


def release_mined_hourglass(body: Body, volume: np.ndarray) -> float:
    """Hourglass forces of cells of which rock or fill is mined go with it, in proportion to its stiffness.

    body: with the volumes before; volume (particle,): what stays. Returns the energy that goes with them, J.
    """
    model, state = body.model, body.state
    lame, shear = model.elastic_constants[model.particles.material].T
    stiffness, cells = bending_stiffness(lame, shear), len(model.cell_nodes)
    before, after = model.bending_share * body.volume, model.bending_share * volume
    old = np.bincount(model.particles.cell, stiffness * before, minlength=cells)
    kept = np.bincount(model.particles.cell, stiffness * np.minimum(before, after), minlength=cells)
    share = np.divide(kept, old, out=np.ones(cells), where=old > 0.0)
    gone = np.sum((1.0 - share) * hourglass_energies(state.hourglass_force, body.hourglass))
    state.hourglass_force *= share[:, None, None]
    return float(gone)


def stored(body: Body, counted: Callable[[Model], np.ndarray] | None = None) -> float:
    """Energy of stress and of hourglass forces of a body, or of the cells (cell,) bool that `counted` says, J (per m in
    2-D)."""
    cells = np.ones(len(body.model.cell_nodes), bool) if counted is None else counted(body.model)
    hourglass = hourglass_energies(body.state.hourglass_force, body.hourglass)
    volume = np.where(cells[body.model.particles.cell], body.volume, 0.0)
    return elastic_energy(body.model, body.state, volume) + float(hourglass[cells].sum())
