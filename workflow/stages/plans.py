"""Stages of the mining plans: what each plan releases, and all of them side by side."""

import datetime
import shutil

from common.result_folders import FORECASTS
from workflow.stages import stage
from common.job import MADE_FROM, Job


@stage("plans")
def plan_outcome(job: Job) -> None:
    """what the runs of a plan made, and the hazard that follows"""
    from common.datasets import read_dataset, write_dataset
    from common.event_table import read_events
    from plans.outcome import make_outcome
    from plans.settings import OutcomeSlice

    settings = OutcomeSlice.of(job.settings, "plans")
    record = read_events(job.input("record")) if job.paths("record") else None
    comparison = read_dataset(job.input("comparison"), ["cut"]) if job.paths("comparison") else None
    found = make_outcome(settings, read_dataset(job.input("grid")), record, comparison)
    write_dataset(found.assign_attrs(job.record()), job.output())
    _keep(job)


def _keep(job: Job) -> None:
    """Lay a copy of the outcome into a folder of forecasts, by date.

    A forecast cannot be made again once its months are recorded, and Snakemake removes an output before it is made
    anew. The copy's name holds the date and what the outcome was made from. No rule writes or removes it.
    """
    folder = job.output().parents[2] / FORECASTS
    made = job.record()[MADE_FROM]
    if not list(folder.glob(f"*_{job.settings['plan']}_{made}.nc")):
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f".{made}.part"
        shutil.copyfile(job.output(), part)
        part.rename(folder / f"{datetime.date.today().isoformat()}_{job.settings['plan']}_{made}.nc")


@stage("plans")
def plans(job: Job) -> None:
    """all plans side by side, as a page and a table"""
    from common.datasets import read_dataset
    from plans.layout import read_outcome
    from plans.page import write_report
    from plans.settings import PlansReportSlice

    outcomes = [read_outcome(path) for path in job.paths("outcomes")]
    page, table = job.outputs
    settings = PlansReportSlice.of(job.settings, "plans")
    write_report(outcomes, read_dataset(job.input("grid")), settings, page, table, job.record()[MADE_FROM])
