"""Stages of the target `export`: results in files for other programs, in the mine's own coordinates."""

from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    from workflow.mine import Mine


def step_settings(mine: "Mine", step: str) -> dict:
    """Settings of the files of a step: name and frame of the mine, and the names of the steps up to this one."""
    names = [one.name for one in mine.steps[: mine.step_index(step) + 1]]
    return {"mine": mine.name, "frame": mine.settings.frame.given(), "steps": names}


@stage("export", settings=lambda mine, wildcards: step_settings(mine, wildcards["step"]))
def export_step(job: Job) -> None:
    """stress and failed rock of a step for other programs"""
    from export.stage import export_step as write

    write(job.settings, job.input("grid"), job.input("state"), job.output("cells.vtu").parent)


@stage(
    "export",
    settings=lambda mine, wildcards: {
        "mine": mine.name,
        "frame": mine.settings.frame.given(),
        "steps": mine.mined_steps,
    },
)
def export(job: Job) -> None:
    """events for other programs, and what the files of all steps hold"""
    from export.stage import export_catalogues, write_contents

    contents = job.output("contents.csv")
    names = {"events": "catalog", "recorded_events": "record"}
    catalogues = {name: job.input(key) for name, key in names.items() if job.input_if_any(key)}
    export_catalogues(job.settings, catalogues, contents.parent, job.input_if_any("source_parameters"))
    folders = [path.parent for path in job.paths("steps")]
    write_contents(job.settings, dict(zip(job.settings["steps"], folders, strict=True)), contents)
