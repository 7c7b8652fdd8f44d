"""Stages of the mining plans: what each plan releases, and all of them side by side."""

import datetime
from pathlib import Path

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
    outcome, kept = found.assign_attrs(job.provenance()), _kept(job)
    if not kept.is_file() and not outcome.attrs.get("collapsed"):
        write_dataset(outcome, kept)
    write_dataset(outcome, job.output())


def _kept(job: Job) -> Path:
    """Path of the kept copy of an outcome, in a folder of forecasts. It is written before the outcome itself.

    A forecast cannot be made again once its months are recorded, and Snakemake removes an output before it is made
    anew and after a failure. The copy's name holds the date and what the outcome was made from. No rule writes or
    removes it.
    """
    folder = job.output().parents[2] / FORECASTS
    name = f"{job.settings['plan']}_{job.provenance()[MADE_FROM]}.nc"
    earlier = sorted(folder.glob(f"????-??-??_{name}"))
    return earlier[0] if earlier else folder / f"{datetime.date.today().isoformat()}_{name}"


@stage("plans")
def plans(job: Job) -> None:
    """all plans side by side, as a page and a table"""
    from plans.page import report_stage

    page, table = job.outputs[:2]
    several = {name: job.paths(name) for name in ("outcomes", "shaking", "loading", "openings")}
    report_stage(job.settings, grid=job.input("grid"), **several, output=page, table=table)
