"""Stages that compare a mine's catalogue with others, and the report."""

from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    from workflow.mine import Mine


def comparison_settings(mine: "Mine") -> dict:
    """Settings of each comparison that a mine has."""
    has_record = mine.settings.record is not None
    return {
        "comparison": mine.comparison_slice() if has_record else {},
        "spread": mine.spread_slice() if mine.members else {},
        "grid_convergence": mine.convergence_slice() if mine.has_companion else {},
        "forecast_scores": mine.forecast_slice() if has_record and mine.settings.forecasts else {},
    }


@stage("catalogs", "plans", settings=lambda mine, wildcards: comparison_settings(mine))
def comparison(job: Job) -> None:
    """The synthetic catalogue against the recorded one, other runs of the model, larger cells, and kept forecasts"""
    from common.datasets import write_dataset
    from common.event_table import read_events

    catalog = read_events(job.input("catalog"))
    compared = _with_record(job, catalog) if job.writes("comparison.nc") else None
    found = {
        "comparison.nc": compared,
        "spread.nc": _with_members(job, catalog, compared) if job.writes("spread.nc") else None,
        "grid_convergence.nc": _with_companion(job, catalog) if job.writes("grid_convergence.nc") else None,
        "forecast_scores.nc": _with_forecasts(job) if job.writes("forecast_scores.nc") else None,
    }
    for name, dataset in found.items():
        if dataset is not None:
            write_dataset(dataset.assign_attrs(job.provenance()), job.output(name))


def _with_record(job: Job, catalog):
    """comparison.nc"""
    from catalogs.compare.comparison import compare
    from catalogs.compare.spread import read_members
    from catalogs.settings import ComparisonSlice
    from common.event_table import read_events

    settings = job.settings["comparison"]
    dated = [one["name"] for one in settings["steps"]]
    folders = [path.parent for path in job.paths("members")]
    members = read_members(folders, dated, catalog.attrs["mine"])
    settings = settings | {"members": len(members)}  # those that have collapsed are left out
    record = read_events(job.input("record"))
    return compare(catalog, record, ComparisonSlice.of(settings, "comparison"), members)


def _with_members(job: Job, catalog, compared):
    """spread.nc"""
    from catalogs.compare.spread import gather
    from catalogs.settings import SpreadSettings

    runs = [path.parent for path in (job.input("catalog"), *job.paths("members"))]
    return gather(runs, catalog, compared, SpreadSettings.of(job.settings["spread"]))


def _with_companion(job: Job, catalog):
    """grid_convergence.nc"""
    from catalogs.compare.cell_error import FRONT_VARIABLES
    from catalogs.compare.grid_convergence import compare_cells
    from common.datasets import read_dataset
    from common.event_table import read_events

    settings, coarse = job.settings["grid_convergence"], job.input("coarse").parent
    folders = [job.input("catalog").parent, coarse]
    states = [
        [read_dataset(folder / f"steps/{name}.nc", FRONT_VARIABLES) for name in settings["steps"]] for folder in folders
    ]
    catalogs = [catalog, read_events(coarse / "catalog.nc")]
    return compare_cells(catalogs, states, read_dataset(coarse / "grid.nc", ()).attrs, settings)


def _with_forecasts(job: Job):
    """forecast_scores.nc"""
    from plans.scores import score_stage

    return score_stage(job.settings["forecast_scores"], record=job.input("record"), grid=job.input("grid"))


@stage("catalogs", settings=lambda mine, wildcards: mine.report_slice())
def report(job: Job) -> None:
    """The report for a geotechnical engineer, and its figures."""
    from catalogs.report.page import write_report
    from catalogs.settings import ReportSlice

    names = [path.stem for path in job.paths("steps")]
    several = {
        "steps": job.paths("steps"),
        "events": [folder / f"{name}.nc" for folder in job.paths("events") for name in names],
    }
    paths = {name: job.input(name) for name in job.inputs if name not in several}
    page, figures = job.outputs
    write_report(paths | several, ReportSlice.of(job.settings), page, figures, logs=job.logs, processes=job.threads)
