"""Stages of the mechanics: grid, elastic equilibrium, mining steps, and the companion on cells of twice the size."""

import logging
from contextlib import ExitStack
from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    from workflow.mine import Mine


@stage("mpm_core", settings=lambda mine, wildcards: mine.grid_slice())
def grid(job: Job) -> None:
    """cells and nodes from the solids"""
    from common.datasets import write_dataset
    from mpm_core.simd.threads import use_threads
    from mpm_core.stages.first_kernels import compile_for_grid
    from mpm_core.stages.grid_stage import make_grid

    compile_for_grid(job.settings.get("plane"), job.threads)
    use_threads(job.threads)
    write_dataset(make_grid(job.settings, job.provenance()), job.output())


@stage("mpm_core", settings=lambda mine, wildcards: mine.mechanics_slice(0))
def elastic(job: Job) -> None:
    """elastic equilibrium of everything mined in history"""
    _solve(job)


@stage("mpm_core", settings=lambda mine, wildcards: mine.step_slice(wildcards["step"]))
def step(job: Job) -> None:
    """Equilibrium of rock that fails after this mining step"""
    _solve(job)


def _solve(job: Job) -> None:
    """Write elastic.nc, or steps/<step>.nc from the state of the step before."""
    from common.datasets import open_dataset, write_dataset
    from mpm_core.scene.scene import parse_scene
    from mpm_core.scene.step_settings import read_scene_attribute, scene_attribute, settings_up_to
    from mpm_core.simd.threads import use_threads
    from mpm_core.stages.checkpoint import Checkpoint, key_of
    from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
    from mpm_core.stages.first_kernels import compile_for_scene

    settings = job.settings
    if job.stage == "step":
        with open_dataset(job.input("state")) as before:
            settings = settings_up_to(read_scene_attribute(before.attrs), settings)
    provenance, scene, output = job.provenance(), parse_scene(settings), job.output()
    compile_for_scene(job.stage, scene, job.threads)
    use_threads(job.threads)
    failed_state = output.with_suffix(".failed.npz")
    with ExitStack() as files:  # gigabytes in a large mine, read once each
        cells = files.enter_context(open_dataset(job.input("grid")))
        if job.stage == "elastic":
            dataset, facts = elastic_stage(scene, cells, failed_state)
        else:
            state = job.input("state")
            before = files.enter_context(open_dataset(state))
            checkpoint = Checkpoint(output.with_suffix(".checkpoint.npz"), key_of(provenance, job.input("grid"), state))
            dataset, facts = mining_step(scene, cells, before, failed_state, checkpoint)
    for name, value in facts.items():
        logging.info("%s: %s", name, value)
    dataset.attrs |= provenance | scene_attribute(settings)
    write_dataset(dataset, output)


def companion_settings(mine: "Mine") -> dict:
    """Settings of all stages of a mine on cells of twice the size, as run_stages takes them."""
    return mine.coarser().run_slices()


@stage(
    "mpm_core",
    "seismic",
    modules=("workflow.run_mine",),
    settings=lambda mine, wildcards: companion_settings(mine),
)
def companion(job: Job) -> None:
    """The same mine on cells of twice the size: grid, steps, events and catalogue, in one job"""
    from common.datasets import write_dataset
    from common.event_table import write_events
    from mpm_core.simd.threads import use_threads
    from seismic.catalog import merge, write_csv
    from workflow.run_mine import run_stages

    use_threads(job.threads)
    provenance, folder, events = job.provenance(), job.output("grid.nc").parent, []
    for name, dataset, _ in run_stages(job.settings, folder.with_suffix(".failed.npz")):
        if name.startswith("events/"):
            events.append(dataset)
            write_events(dataset.assign_attrs(provenance), folder / f"{name}.nc")
        else:
            write_dataset(dataset.assign_attrs(provenance), folder / f"{name}.nc")
        logging.info("%s is done", name)
    catalog = merge(events)
    write_events(catalog.assign_attrs(provenance), folder / "catalog.nc")
    write_csv(catalog, folder / "catalog.csv")
