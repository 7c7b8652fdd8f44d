"""Command lines of the catalogue stages: scene, record, quakeml, compare, spread, grid_convergence, twin, vtk, report.

Each stage imports only what it needs: ObsPy and matplotlib take seconds, and most stages use neither. A rule runs its
stage again when what that stage imports has changed (common.sources): a stage's function has the stage's name.
"""

import argparse
import json
import logging
from collections.abc import Callable
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import read_dataset, write_dataset
from common.event_table import read_events, write_events
from common.provenance import made_from, provenance
from common.slices import read_slice
from common.stage import run_stage


def scene(chosen: argparse.Namespace) -> None:
    """A picture of what will be solved: cells, solids, record."""
    from catalogs.comparison_settings import PictureSlice
    from catalogs.figures.overview import write_overview

    record = read_events(chosen.record) if chosen.record else None
    steps = PictureSlice.of(read_slice(chosen.settings)).steps
    write_overview(read_dataset(chosen.grid), steps, record, chosen.output)


def record(chosen: argparse.Namespace) -> None:
    """The recorded catalogue as the configuration's `record` describes it."""
    from catalogs.records import read_record

    settings = read_slice(chosen.settings)
    made_of = provenance(settings, "catalogs record")  # before the record is read: it may be written to meanwhile
    frame = {"frame": json.dumps(settings["frame"])} if settings.get("frame") else {}
    write_events(read_record(settings).assign_attrs(frame | made_of), chosen.output)


def quakeml(chosen: argparse.Namespace) -> None:
    """A catalogue as QuakeML."""
    from catalogs.quakeml import write_quakeml

    write_quakeml(
        read_events(chosen.catalog), chosen.output, made_from=made_from({}, "catalogs quakeml", [chosen.catalog])
    )


def compare(chosen: argparse.Namespace) -> None:
    """The synthetic catalogue against the recorded one."""
    from catalogs import comparison
    from catalogs.comparison_settings import ComparisonSlice
    from catalogs.members import read_members

    settings = read_slice(chosen.settings)
    catalog = read_events(chosen.catalog)
    dated = [step["name"] for step in settings.get("steps", [])]
    members = read_members(chosen.members, dated, catalog.attrs["mine"])
    result = comparison.compare(
        catalog, read_events(chosen.record), ComparisonSlice.of(settings, "comparison"), members
    )
    of_members = [member / "events" / f"{step}.nc" for member in chosen.members for step in dated]
    made_of = provenance(settings, "catalogs compare", [chosen.catalog, chosen.record, *of_members])
    write_dataset(result.assign_attrs(made_of), chosen.output)


def spread(chosen: argparse.Namespace) -> None:
    """The runs of an ensemble against each other."""
    from catalogs.comparison_settings import SpreadSettings
    from catalogs.spread import gather

    settings = read_slice(chosen.settings)
    comparison = read_dataset(chosen.comparison) if chosen.comparison else None
    result = gather(chosen.runs, read_events(chosen.catalog), comparison, SpreadSettings.of(settings))
    folders = [run / folder for run in chosen.runs for folder in ("steps", "events")]
    of_runs = [folder / f"{step}.nc" for folder in folders for step in settings["steps"]]
    inputs = [*of_runs, chosen.catalog, *filter(None, [chosen.comparison])]
    write_dataset(result.assign_attrs(provenance(settings, "catalogs spread", inputs)), chosen.output)


def grid_convergence(chosen: argparse.Namespace) -> None:
    """The mine's run compared with the same run on cells of twice the size."""
    from catalogs.grid_convergence import compare

    settings = read_slice(chosen.settings)
    catalogs = [read_events(path) for path in (chosen.catalog, chosen.coarse_catalog)]
    states = [[read_dataset(path, ()).attrs for path in paths] for paths in (chosen.steps, chosen.coarse_steps)]
    result = compare(catalogs, states, read_dataset(chosen.coarse_grid, ()).attrs, settings)
    inputs = [*chosen.steps, *chosen.coarse_steps, chosen.catalog, chosen.coarse_catalog, chosen.coarse_grid]
    write_dataset(result.assign_attrs(provenance(settings, "catalogs grid_convergence", inputs)), chosen.output)


def twin(chosen: argparse.Namespace) -> None:
    """A modelled catalogue as a seismic system might have recorded it."""
    from catalogs.twin import write_twin

    count = write_twin(read_events(chosen.catalog), chosen.noise, chosen.cut, chosen.seed, chosen.output)
    logging.info("%d events", count)


def vtk(chosen: argparse.Namespace) -> None:
    """A catalogue's events for ParaView."""
    from catalogs.events_vtk import write_points

    write_points(read_events(chosen.catalog), chosen.output)


def report(chosen: argparse.Namespace) -> None:
    """The report for a geotechnical engineer, and its figures."""
    from catalogs.comparison_settings import ReportSlice
    from catalogs.report.page import write_report

    values = read_slice(chosen.settings)
    settings = ReportSlice.of(values)
    single = ["grid", "elastic", "catalog", "record", "comparison", "spread", "closeness", "grid_convergence"]
    single += ["forecast_scores"]
    inputs = [*chosen.steps, *chosen.events, *filter(None, (getattr(chosen, name) for name in single))]
    write_report(
        config=settings.config,
        default=settings.default,
        excavations=settings.excavations,
        insitu=settings.insitu,
        grid=chosen.grid,
        elastic=chosen.elastic,
        steps=chosen.steps,
        events=chosen.events,
        catalog=chosen.catalog,
        record=chosen.record,
        comparison=chosen.comparison,
        spread=chosen.spread,
        closeness=chosen.closeness,
        grid_convergence=chosen.grid_convergence,
        forecast_scores=chosen.forecast_scores,
        logs=chosen.logs,
        output=chosen.output,
        figures=chosen.figures,
        made_from=made_from(values, "catalogs report", inputs),
        processes=chosen.threads,
    )


def parser() -> CommandLine:
    """What each stage is given; every stage also takes --log."""
    top = CommandLine(prog="python -m catalogs", description=__doc__)
    stages = top.add_subparsers(dest="stage", required=True)

    def stage(name: str, function: Callable, *paths: str, settings: bool = False) -> CommandLine:
        one = stages.add_parser(name, help=function.__doc__)
        one.set_defaults(function=function)
        if settings:
            one.add_argument("--settings", type=Path, required=True, help="file of the configuration's slice, JSON")
        for path in paths:
            one.add_argument(f"--{path}", type=Path, required=True)
        one.add_argument("--log", type=Path)
        return one

    drawn = stage("scene", scene, "grid", "output", settings=True)
    drawn.add_argument("--record", type=Path)
    stage("record", record, "output", settings=True)
    stage("quakeml", quakeml, "catalog", "output")
    stage("vtk", vtk, "catalog", "output")
    compared = stage("compare", compare, "catalog", "record", "output", settings=True)
    compared.add_argument("--members", type=Path, nargs="*", default=[], help="folders with events of other runs")
    gathered = stage("spread", spread, "catalog", "output", settings=True)
    gathered.add_argument("--comparison", type=Path)
    gathered.add_argument("--runs", type=Path, nargs="+", required=True, help="folders of steps and events, own first")
    halved = stage(
        "grid_convergence", grid_convergence, "catalog", "coarse-catalog", "coarse-grid", "output", settings=True
    )
    for name in ("steps", "coarse-steps"):
        halved.add_argument(
            f"--{name}", type=Path, nargs="+", required=True, help="states of the dated steps, in order"
        )
    made = stage("twin", twin, "catalog", "output")
    made.add_argument("--noise", type=float, required=True, help="root mean square location error, m")
    made.add_argument("--cut", type=float, required=True, help="smallest log10 of potency in m3")
    made.add_argument("--seed", type=int, default=1)
    shown = stage("report", report, "grid", "output", "figures", settings=True)
    for name in (
        "elastic",
        "catalog",
        "record",
        "comparison",
        "spread",
        "closeness",
        "grid-convergence",
        "forecast-scores",
        "logs",
    ):
        shown.add_argument(f"--{name}", type=Path)
    shown.add_argument("--threads", type=int, default=1, help="processes that draw sections")
    for name in ("steps", "events"):
        shown.add_argument(f"--{name}", type=Path, nargs="*", default=[])
    return top


if __name__ == "__main__":
    arguments = parser().parse_args()
    stage, run = arguments.stage, arguments.function
    run_stage(f"{stage} {arguments.output}", arguments.log, lambda: run(arguments), run.__doc__)
