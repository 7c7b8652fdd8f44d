"""Command lines: `python -m baselines flaws` and `excess_shear` (catalogues), and `report` (the page)."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from common.command_line import CommandLine
from common.datasets import read_dataset
from common.event_table import read_events, write_events
from common.provenance import provenance
from common.slices import read_slice
from common.stage import run_stage


def flaws(chosen: argparse.Namespace) -> None:
    """catalogues of flaws that slip in the elastic stress of each step"""
    from baselines.drawing import draw_flaws
    from baselines.settings import FlawSlice

    _draw(chosen, "baselines flaws", FlawSlice, draw_flaws)


def excess_shear(chosen: argparse.Namespace) -> None:
    """catalogues of events where mining raises excess shear stress"""
    from baselines.drawing import draw_excess_shear
    from baselines.settings import StressSlice

    _draw(chosen, "baselines excess_shear", StressSlice, draw_excess_shear)


def _draw(chosen: argparse.Namespace, command: str, kind: Any, draw: Callable[..., Sequence[xr.Dataset]]) -> None:
    """Draw the runs of a baseline: the first is its catalogue, all together are another file."""
    from baselines.catalogue import Asked, join_runs

    values = read_slice(chosen.settings)
    settings = kind.of(values)
    asked = Asked.of(read_events(chosen.record), read_dataset(chosen.comparison), settings.steps)
    runs = draw([Path(path) for path in chosen.states], asked, settings)
    made_of = provenance(values, command, [*chosen.states, chosen.record, chosen.comparison])
    write_events(runs[0].assign_attrs(made_of), chosen.output)
    write_events(join_runs(runs).assign_attrs(made_of), chosen.runs)


def report(chosen: argparse.Namespace) -> None:
    """all models beside the record, as a page and a table"""
    from baselines.catalogue import split_runs
    from baselines.models import beside_record
    from baselines.months import beside_months, write_months, write_rates
    from baselines.page import write_page, write_table
    from baselines.settings import BaselineReportSlice
    from catalogs.members import read_members

    settings = BaselineReportSlice.of(read_slice(chosen.settings))
    grid, steps = read_dataset(chosen.grid), [step.name for step in settings.comparison.steps]
    flawed = read_events(chosen.flaws)
    found = beside_record(
        [read_events(chosen.catalog), *read_members(chosen.members, steps, settings.mine)],
        read_dataset(chosen.comparison),
        split_runs(flawed),
        split_runs(read_events(chosen.excess_shear)),
        read_events(chosen.record),
        float(grid.attrs["fine_cell"]),
        settings.comparison,
    )
    months = beside_months(found, read_events(chosen.earlier), float(grid.attrs["fine_cell"]), settings)
    write_table(Path(chosen.table), found)
    write_months(Path(chosen.months), months)
    write_rates(Path(chosen.rates), months)
    write_page(Path(chosen.output), settings.mine, found, flawed.attrs, grid, settings.planned, settings.flaws, months)


def main() -> None:
    """Parse the command line and run the stage it names."""
    parser = CommandLine(prog="python -m baselines", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    for name in ("flaws", "excess_shear"):
        stage = stages.add_parser(name)
        stage.add_argument("--states", required=True, nargs="+", help="states of elastic rock, in order")
        stage.add_argument("--runs", required=True, help="all runs written, netCDF")
    page = stages.add_parser("report")
    page.add_argument("--grid", required=True)
    page.add_argument("--catalog", required=True, help="the mine's own catalogue")
    page.add_argument("--members", nargs="*", default=[], help="folders with events of the mine's other runs")
    page.add_argument("--flaws", required=True, help="all runs of the seeded flaws")
    page.add_argument("--excess-shear", required=True, help="all runs of excess shear stress")
    page.add_argument("--earlier", required=True, help="record from an earlier date on, or the record itself")
    page.add_argument("--months", required=True, help="table of the gains of maps written, CSV")
    page.add_argument("--rates", required=True, help="table of numbers by metres and days written, CSV")
    page.add_argument("--table", required=True, help="table of the scores written, CSV")
    for stage in stages.choices.values():
        stage.add_argument("--record", required=True)
        stage.add_argument("--comparison", required=True, help="the mine's own comparison with the record")
        stage.add_argument("--settings", required=True, help="file of the configuration's slice, JSON")
        stage.add_argument("--output", required=True)
        stage.add_argument("--log", help="log file; standard error without it")
    chosen = parser.parse_args()
    run = {"flaws": flaws, "excess_shear": excess_shear, "report": report}[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), run.__doc__ or "")


if __name__ == "__main__":
    main()
