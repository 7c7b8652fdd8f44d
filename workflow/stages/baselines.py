"""Stages of the baselines: catalogues from elastic stress alone, and all models beside the record."""

from collections.abc import Callable, Sequence

from common.job import Job
from workflow.stages import stage


@stage("baselines")
def flaws(job: Job) -> None:
    """catalogues of flaws that slip in the elastic stress of each step"""
    from baselines.catalogues import flaw_stage

    _draw(job, flaw_stage)


@stage("baselines")
def excess_shear(job: Job) -> None:
    """catalogues of events where mining raises excess shear stress"""
    from baselines.catalogues import excess_shear_stage

    _draw(job, excess_shear_stage)


def _draw(job: Job, runs_of: Callable[..., Sequence]) -> None:
    """Write the runs of a baseline: the first is its catalogue, all together are another file."""
    from baselines.catalogues import join_runs
    from common.event_table import write_events

    runs = runs_of(job.settings, job.paths("states"), job.input("record"), job.input("comparison"))
    catalog, together = job.outputs
    write_events(runs[0].assign_attrs(job.provenance()), catalog)
    write_events(join_runs(runs).assign_attrs(job.provenance()), together)


@stage("catalogs", modules=("workflow.stages.catalogue",))
def earlier_record(job: Job) -> None:
    """The recorded catalogue from an earlier date on."""
    from workflow.stages.catalogue import record

    record(job)


@stage("baselines")
def baselines(job: Job) -> None:
    """all models beside the record, as a page and a table"""
    from baselines.page import report_stage

    names = ("grid", "catalog", "flaws", "excess_shear", "record", "comparison", "earlier")
    report_stage(
        job.settings,
        **{name: job.input(name) for name in names},
        members=[path.parent for path in job.paths("members")],
        output=job.output("report.html"),
        table=job.output("scores.csv"),
        months=job.output("months.csv"),
        rates=job.output("rates.csv"),
        alerts=job.output("alerts.csv"),
        states=job.paths("states"),
        csep=job.output("csep") if job.writes("csep") else None,
    )
