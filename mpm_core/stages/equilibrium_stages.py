"""The elastic history and a mining step, as a rule runs them."""

import json
import logging
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from tqdm import tqdm

from common.datasets import atomic_path, clear_parts
from common.errors import InputError
from mpm_core.constitutive.elastic import STRENGTH_FACTOR_CAP
from mpm_core.equilibrium.body import Body
from mpm_core.equilibrium.brittle import above_strength
from mpm_core.equilibrium.cascade import run_cascade
from mpm_core.equilibrium.convergence import History, norm
from mpm_core.equilibrium.energy_balance import Balance, hourglass_energies, mined_energy, nodal_forces
from mpm_core.equilibrium.increments import overshoot_share
from mpm_core.equilibrium.scheme import Scheme
from mpm_core.files.state_datasets import read_grid, state_dataset
from mpm_core.kernels.failure import make_rate_strength
from mpm_core.model.fallen_rock import describe_falls
from mpm_core.model.model import Model
from mpm_core.model.occupancy import Unsupported
from mpm_core.model.state import State
from mpm_core.model.unsupported import describe_unsupported
from mpm_core.scene.scene import FACES, Scene
from mpm_core.stages.checkpoint import Checkpoint
from mpm_core.stages.external_forces import boundary_strain, external_force, load_size
from mpm_core.stages.ground import Ground
from mpm_core.stages.stage_memory import require_cells
from mpm_core.stages.step_cells import begin_step, make_scheme
from mpm_core.stages.step_subdomain import StepSubdomain, step_subdomain_of

TRUNCATION_REMEDY = {True: "more grid.max_cells", False: "more grid.buffer_cells, or grid.refinement: adaptive,"}
MIN_STRESS_SHARE = 1e-5  # Less of the virgin stress than this share counts as this share.


def elastic_stage(scene: Scene, grid: xr.Dataset, failed_state: Path) -> tuple[xr.Dataset, dict]:
    """Elastic equilibrium of the history: everything mined, loaded and strained in step 0, nothing fails."""
    cells, body = read_grid(grid)
    require_cells(scene, cells, elastic=True)
    model = Ground.of(scene, grid).model(cells, body, Unsupported.none()).at(0)
    refuse_overstressed_virgin(model)
    state = model.virgin_state()
    volume = model.volumes(0)
    scheme = make_scheme(model, state, volume)
    whole = model.particles.full_volume * model.particles.is_rock
    balance = Balance.at_start(scheme.body, mined_energy(model.at(-1), state, whole, volume))
    force, strain = external_force(model, 0), boundary_strain(scene, 0)
    reference = load_size(model, force, strain, 0)
    with SolutionMonitor(scene, "elastic", failed_state, lambda: state) as history:
        history.increment = 1
        if strain.any():
            scheme.body.deform(strain)
        scheme.reach_equilibrium(force, scene.solver.tolerance, reference, history)
        # Where free faces unload rock, the forces that do so measure a stress that has gone: what stays measures again.
        reference *= share_that_stays(model, state, volume)
        scheme.reach_equilibrium(force, scene.solver.tolerance, reference, history)
    return finish(scheme, history, 0, balance, force, state.displacement, reference, "elastic")


def share_that_stays(model: Model, state: State, volume: np.ndarray) -> float:
    """Stress over virgin stress, root mean squares over the rock of these volumes (particle,); MIN_STRESS_SHARE to
    1."""
    rock = model.particles.is_rock & (volume > 0.0)
    virgin = np.sum(model.insitu[rock] ** 2 * volume[rock, None])
    now = np.sum((model.insitu[rock] + state.stress[rock]) ** 2 * volume[rock, None])
    return float(np.sqrt(np.clip(now / virgin, MIN_STRESS_SHARE**2, 1.0))) if virgin > 0.0 else 1.0


def mining_step(
    scene: Scene, grid: xr.Dataset, previous: xr.Dataset, failed_state: Path, checkpoint: Checkpoint | None = None
) -> tuple[xr.Dataset, dict]:
    """Equilibrium of rock that fails after the last of the scene's steps, from the state of the step before.

    The first step starts from the elastic history, in which its rock is already mined: failure is switched on.
    checkpoint: goes on from it if it is of the same inputs, and keeps it up to date (not where particles move: they
    have velocities of their own that no dataset holds).
    """
    step = len(scene.steps) - 1
    if previous.attrs.get("collapsed"):
        return not_computed(scene, previous)
    saved = {} if checkpoint is None or scene.solver.move else checkpoint.read()
    watched = SolutionMonitor(scene, scene.steps[step], failed_state)
    with watched as history:
        cells, balance = begin_step(Ground.of(scene, grid), previous, step, history)
        at_work = cells
        watched.state = lambda: at_work.state
        step_subdomain = step_subdomain_of(cells) if not saved or saved["in_step_subdomain"] else None
        if step_subdomain is not None:
            at_work = step_subdomain.cells
        if saved:
            at_work.resume(saved)
            Checkpoint.restore(saved, at_work.scheme.body.state, history)
            at_work.renew()
            at_work.scheme.body.start = saved["start"]
            at_work.scheme.body.rest = history.last_equilibrium.get("displacement", at_work.scheme.body.rest)

        def save(state: State, history: History) -> None:
            if checkpoint is not None and not scene.solver.move:
                in_step_subdomain = at_work is not cells
                checkpoint.save(
                    state, history, at_work.model.grid, in_step_subdomain, at_work.places, at_work.full, at_work.fallen,
                    at_work.displacement_before, at_work.scheme.body.start,
                )  # fmt: skip

        def run(step_subdomain: StepSubdomain | None) -> tuple[Scheme, bool]:
            return run_cascade(
                at_work.scheme, at_work.brittle, at_work.ramp, step, history, save, at_work, step_subdomain
            )

        if step_subdomain is not None:
            run(step_subdomain)
            step_subdomain.write_back()
            at_work, step_subdomain = cells, None
            history.last_equilibrium, history.collapse = {}, ""
        scheme, collapsed = run(None)
        if checkpoint is not None:
            checkpoint.remove()
    ramp = cells.ramp
    return finish(scheme, history, step, balance, ramp.target, cells.moved(), ramp.reference, "step", collapsed)


def not_computed(scene: Scene, previous: xr.Dataset) -> tuple[xr.Dataset, dict]:
    """The state before, as that of a step after a collapse: nothing is mined, nothing fails. What reads results leaves
    such steps out."""
    zero = {name for name in previous.attrs if name.startswith("energy_") and not isinstance(previous.attrs[name], str)}
    zero |= {"failed_particles", "failed_volume", "increments", "iterations", "cell_changes", "cell_splits"}
    zero |= {"overshoot_share", "truncated", "truncated_share", "truncated_volume", "loose_pieces", "loose_volume"}
    facts = {
        **dict.fromkeys(sorted(zero), 0),
        "step": scene.steps[-1],
        "step_index": len(scene.steps) - 1,
        "falls": "[]",
        "computed": 0,
    }
    strains = ("seismic_strain", "overshoot_strain", "later_strain", "plastic_strain_step")
    dataset = previous.isel(iteration=slice(-1, None)).assign({name: xr.zeros_like(previous[name]) for name in strains})
    logging.warning("the mine collapsed before; this step is not computed")
    return dataset.assign_attrs(facts), facts


class SolutionMonitor:
    """Monitor of a solution, a context: a progress bar on a terminal, and the last `state` next to the output when it
    fails."""

    def __init__(self, scene: Scene, name: str, failed_state: Path, state: Callable[[], State | None] | None = None):
        self.history = History(scene.solver.tolerance)
        self.name, self.state, self.path = f"{scene.mine} {name}", state, failed_state

    def __enter__(self) -> History:
        self.bar = self.history.bar = tqdm(desc=self.name, unit="it", disable=not sys.stderr.isatty(), leave=False)
        return self.history

    def __exit__(self, kind, error, traceback) -> None:
        self.bar.close()
        state = self.state() if isinstance(error, InputError) and self.state is not None else None
        if state is not None:
            try:
                with atomic_path(self.path) as temporary, temporary.open("wb") as file:
                    np.savez(file, **vars(state) | self.history.table())
                logging.info("last state in %s", self.path)
            except InputError as full:  # the user is to read why the stage failed, not this
                logging.warning("the last state is not kept: %s", full)
        elif kind is None:
            self.path.unlink(missing_ok=True)
            clear_parts(self.path)


def finish(
    scheme: Scheme,
    history: History,
    step: int,
    balance: Balance,
    target: np.ndarray,
    moved: np.ndarray,
    reference: float,
    stage: str,
    collapsed: bool = False,
) -> tuple[xr.Dataset, dict]:
    """Rate the state against strength and put it into its dataset; the second value is what the log reports.

    target (node, d) N: forces that act for good; moved (node, d) m: motion of the stage; reference N: what unbalanced
    forces were measured by in the end, 0 where nothing acts.
    """
    body = scheme.body
    model, state, volume = body.model, body.state, body.volume
    body.commit()
    energy = balance.facts(body, target, moved)
    conserved = mass_and_momentum(body, step)
    scheme.drop_work_arrays()  # as large as what is written now
    scene = model.scene
    rating = rate(model, state, volume)
    here = (state.failed == step) & (volume > 0.0) & (stage == "step")
    table = history.table()
    facts = {
        "stage": stage,
        "step": scene.steps[step],
        "step_index": step,
        "iterations": history.iteration,
        "unbalanced_ratio": float(table["unbalanced_ratio"][-1]),
        "unbalanced_force": norm(body.unbalanced) * scene.thickness,
        "unbalanced_reference": (reference or 1.0) * scene.thickness,
        "failed_particles": int(here.sum()),
        "failed_volume": float(volume[here].sum() * scene.thickness),
        **energy,
        **conserved,
        **hourglass_energy(body),
        "cell_changes": state.cell_changes,
        "cells": len(model.grid.cell_level),
        "finest_cells": int(model.grid.cells_per_level[-1]),
        "cell_splits": history.splits,
        "increments": history.increment,
        "overshoot_share": overshoot_share(state, volume, step) if stage == "step" else 0.0,
        "collapsed": int(collapsed),
        "collapse": history.collapse,
        "computed": 1,
        **truncation(model, state, volume, stage),
        **failed_at_boundary(model, state, volume),
        **describe_unsupported(
            model.grid, model.particles.distorted, model.unsupported, step, scene.thickness, scene.axes
        ),
        "falls": json.dumps(describe_falls(model, step)),
        "unheld_fill": json.dumps(model.unheld_fill(step)),
    }
    return state_dataset(model, state, model.material_volumes(step), rating, table, facts), facts


def hourglass_energy(body: Body) -> dict[str, float]:
    """Energy that the hourglass stiffness holds, J, in intact and in failed cells apart."""
    energy = hourglass_energies(body.state.hourglass_force, body.hourglass) * body.model.scene.thickness
    failed = np.zeros(len(energy), bool)
    failed[body.model.particles.cell[body.failed]] = True
    return {
        "hourglass_energy_intact": float(np.sum(energy[~failed])),
        "hourglass_energy_failed": float(np.sum(energy[failed])),
    }


def mass_and_momentum(body: Body, step: int) -> dict[str, float]:
    """Quantities that must be conserved: mass of rock and fill that are there, kg; net_force, N, which is momentum
    gained per second: the sum of what is unbalanced at free nodes; momentum_error: sum of the forces of cells on nodes,
    held ones too, over the sum of their sizes: 0 but for round-off (NaN where particles move, whose cells keep
    none)."""
    model, thickness = body.model, body.model.scene.thickness
    density = np.array([material.density for material in model.scene.materials.values()])
    there = model.material_volumes(step)
    forces = nodal_forces(body)
    size, net = float(np.abs(forces).sum()), float(np.abs(forces.sum(axis=0)).sum())
    return {
        "mass": float(np.sum(density[model.material] * there) * thickness),
        "net_force": float(np.linalg.norm(body.unbalanced.sum(axis=0)) * thickness),
        "momentum_error": np.nan if model.scene.solver.move else net / size if size > 0.0 else 0.0,
    }


def rate(model: Model, state: State, volume: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strength factor and excess shear stress (particle,), against the strength that the rock has now."""
    factor = np.full(model.particles.count, STRENGTH_FACTOR_CAP)  # where nothing can fail
    excess = np.zeros(model.particles.count)
    rock = np.flatnonzero(model.can_fail() & (volume > 0.0))
    make_rate_strength(model.law)(
        rock,
        state.stress + model.insitu,
        model.particles.material,
        model.intact_rows,
        model.residual_rows,
        model.strength_scale,
        state.failed >= 0,
        factor,
        excess,
    )
    return factor, excess


def truncation(model: Model, state: State, volume: np.ndarray, stage: str) -> dict:
    """Rock above strength that its coarse cells keep from failing: flag, share, volume, where.

    The share is of all rock that has failed so far or stands above strength now, fine cells that fail next included.
    Cells that follow the rock are split in the step that comes next: the elastic history keeps nothing from failing.
    """
    particles = model.particles
    failed = (state.failed >= 0) & (volume > 0.0)
    above = above_strength(model, state, np.flatnonzero(model.can_fail() & ~failed & (volume > 0.0)))
    coarse = above[model.grid.cell_level[particles.cell[above]] < model.grid.levels - 1]
    adaptive = model.scene.refinement is not None
    if not len(coarse) or (adaptive and stage == "elastic"):
        return {"truncated": 0, "truncated_share": 0.0, "truncated_volume": 0.0, "truncated_where": ""}
    share = volume[coarse].sum() / (volume[above].sum() + volume[failed].sum())
    names = ["xyz"[axis] for axis in model.scene.axes]
    box = zip(names, particles.position[coarse].min(axis=0), particles.position[coarse].max(axis=0), strict=True)
    where = ", ".join(f"{name} {low:.0f} to {high:.0f} m" for name, low, high in box)
    return {
        "truncated": 1,
        "truncated_share": float(share),
        "truncated_volume": float(volume[coarse].sum() * model.scene.thickness),
        "truncated_where": f"{where}; {TRUNCATION_REMEDY[adaptive]} would let it fail",
    }


def failed_at_boundary(model: Model, state: State, volume: np.ndarray) -> dict:
    """Failed rock in cells at faces of the domain that are not free: volume m3, names of the faces."""
    grid, scene = model.grid, model.scene
    failed = np.flatnonzero((state.failed >= 0) & (volume > 0.0))
    lower = grid.cell_index[model.particles.cell[failed]]
    upper = lower + grid.cell_width[model.particles.cell[failed]][:, None]
    there, names = np.zeros(len(failed), bool), []
    for axis in range(grid.dimension):
        for name, at in zip(FACES[2 * scene.axes[axis] :][:2], (lower == 0, upper == grid.shape), strict=True):
            if scene.boundary.get(name) != "free" and at[:, axis].any():
                there |= at[:, axis]
                names.append(name)
    size = float(volume[failed[there]].sum() * scene.thickness)
    return {"boundary_failed_volume": size, "boundary_failed_faces": ", ".join(names)}


def refuse_overstressed_virgin(model: Model) -> None:
    """Raise InputError if rock of any body stands above its intact strength before anything is mined."""
    above = above_strength(model, model.virgin_state(), np.flatnonzero(model.can_fail()))
    if len(above):
        first = above[0]
        name = list(model.scene.materials)[model.material[first]]
        where = ", ".join(f"{value:.10g}" for value in model.particles.position[first])
        raise InputError(
            f"insitu_stress: virgin rock of materials.{name} stands above its intact strength, first at ({where}) m: "
            "it would fail before anything is mined; check stress, depth and strength"
        )
