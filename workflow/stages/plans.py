"""Stages of the mining plans: what each plan releases, and all of them side by side."""

import datetime
import shutil

from common.job import MADE_FROM, Job
from common.result_folders import FORECASTS
from workflow.stages import stage


@stage("plans")
def plan_outcome(job: Job) -> None:
    """what the runs of a plan made, and the hazard that follows"""
    from common.datasets import write_dataset
    from plans.outcome import outcome_stage

    files = {name: job.input_if_any(name) for name in ("record", "comparison")}
    found = outcome_stage(job.settings, grid=job.input("grid"), **files)
    write_dataset(found.assign_attrs(job.provenance()), job.output())
    _keep(job)


def _keep(job: Job) -> None:
    """Lay a copy of the outcome into a folder of forecasts, by date.

    A forecast cannot be made again once its months are recorded, and Snakemake removes an output before it is made
    anew. The copy's name holds the date and what the outcome was made from. No rule writes or removes it.
    """
    folder = job.output().parents[2] / FORECASTS
    made = job.provenance()[MADE_FROM]
    if not list(folder.glob(f"*_{job.settings['plan']}_{made}.nc")):
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f".{made}.part"
        shutil.copyfile(job.output(), part)
        part.rename(folder / f"{datetime.date.today().isoformat()}_{job.settings['plan']}_{made}.nc")


@stage("plans")
def plans(job: Job) -> None:
    """all plans side by side, as a page and a table"""
    from plans.page import report_stage

    page, table = job.outputs
    outcomes = job.paths("outcomes")
    report_stage(job.settings, grid=job.input("grid"), outcomes=outcomes, output=page, table=table)
