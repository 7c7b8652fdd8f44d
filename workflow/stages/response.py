"""Stages of what drives and stopes feel."""

from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    pass


@stage("response", settings=lambda mine, wildcards: mine.openings_slice())
def openings(job: Job) -> None:
    """Depth of failure, closure and stress at the walls of each excavation, by step, side and chainage"""
    from common.datasets import write_dataset
    from response.openings import read_and_measure
    from response.settings import OpeningSlice
    from response.table_csv import write_csv

    states, folder = job.paths("steps"), job.input("events")
    events = [folder / f"{state.stem}.nc" for state in states]
    settings, record = OpeningSlice.of(job.settings), job.input_if_any("record")
    found = read_and_measure(settings, job.input("grid"), states, events, record)
    found = found.assign_attrs(job.provenance())
    write_dataset(found, job.output("openings.nc"))
    write_csv(found, job.output("openings.csv"))
