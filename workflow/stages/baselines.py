"""Stages of the baselines: catalogues from elastic stress alone, and all models beside the record."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from workflow.stages import stage
from common.job import Job


@stage("baselines")
def flaws(job: Job) -> None:
    """catalogues of flaws that slip in the elastic stress of each step"""
    from baselines.drawing import draw_flaws
    from baselines.settings import FlawSlice

    _draw(job, FlawSlice, draw_flaws)


@stage("baselines")
def excess_shear(job: Job) -> None:
    """catalogues of events where mining raises excess shear stress"""
    from baselines.drawing import draw_excess_shear
    from baselines.settings import StressSlice

    _draw(job, StressSlice, draw_excess_shear)


def _draw(job: Job, kind: Any, draw: Callable[..., Sequence]) -> None:
    """Write the runs of a baseline: the first is its catalogue, all together are another file."""
    from baselines.catalogue import Asked, join_runs
    from common.datasets import read_dataset
    from common.event_table import read_events, write_events

    settings = kind.of(job.settings)
    asked = Asked.of(read_events(job.input("record")), read_dataset(job.input("comparison")), settings.steps)
    runs = draw([Path(path) for path in job.paths("states")], asked, settings)
    catalog, together = job.outputs
    write_events(runs[0].assign_attrs(job.record()), catalog)
    write_events(join_runs(runs).assign_attrs(job.record()), together)


@stage("catalogs")
def earlier_record(job: Job) -> None:
    """The recorded catalogue from an earlier date on."""
    from workflow.stages.catalogue import record

    record(job)


@stage("baselines")
def baselines(job: Job) -> None:
    """all models beside the record, as a page and a table"""
    from baselines.catalogue import split_runs
    from baselines.models import beside_record
    from baselines.months import beside_months, write_months, write_rates
    from baselines.page import write_page, write_table
    from baselines.settings import BaselineReportSlice
    from catalogs.members import read_members
    from common.datasets import read_dataset
    from common.event_table import read_events

    settings = BaselineReportSlice.of(job.settings)
    grid, steps = read_dataset(job.input("grid")), [step.name for step in settings.comparison.steps]
    cell = float(grid.attrs["fine_cell"])
    flawed = read_events(job.input("flaws"))
    members = read_members([Path(path).parent for path in job.paths("members")], steps, settings.mine)
    found = beside_record(
        [read_events(job.input("catalog")), *members],
        read_dataset(job.input("comparison")),
        split_runs(flawed),
        split_runs(read_events(job.input("excess_shear"))),
        read_events(job.input("record")),
        cell,
        settings.comparison,
    )
    earlier = beside_months(found, read_events(job.input("earlier")), cell, settings)
    write_table(job.output("scores.csv"), found)
    write_months(job.output("months.csv"), earlier)
    write_rates(job.output("rates.csv"), earlier)
    page = job.output("report.html")
    write_page(page, settings.mine, found, flawed.attrs, grid, settings.planned, settings.flaws, earlier)
