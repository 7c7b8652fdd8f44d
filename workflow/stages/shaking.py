"""Stages of peak ground velocities and demands on support: of the mine, and of each of its plans."""

from common.job import Job
from workflow.stages import stage


@stage("shaking", settings=lambda mine, wildcards: mine.shaking_slice())
def shaking(job: Job) -> None:
    """Peak ground velocity at openings, and the demand on support"""
    from common.datasets import write_dataset
    from shaking.stage import shaking_stage
    from shaking.table import write_csv

    found = shaking_stage(
        job.settings,
        grid=job.input("grid"),
        catalog=job.input("catalog"),
        members=[folder.parent for folder in job.paths("members")],
        comparison=job.input_if_any("comparison"),
        failed_rock=job.input_if_any("failed_rock"),
    )
    write_csv(found, job.output("shaking.csv"))
    write_dataset(found.assign_attrs(job.provenance()), job.output("shaking.nc"))


@stage("shaking")
def plan_shaking(job: Job) -> None:
    """what a plan's openings feel"""
    from common.datasets import write_dataset
    from shaking.stage import plan_shaking_stage
    from shaking.table import write_csv

    found = plan_shaking_stage(
        job.settings,
        grid=job.input("grid"),
        outcome=job.input("outcome"),
        comparison=job.input_if_any("comparison"),
        failed_rock=job.input_if_any("failed_rock"),
    )
    write_csv(found, job.output("shaking.csv"))
    write_dataset(found.assign_attrs(job.provenance()), job.output("shaking.nc"))
