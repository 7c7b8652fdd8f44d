"""Command lines: `python -m plans outcome` (of one plan), `report` (the page) and `score` (of kept forecasts)."""

import argparse
import json
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import read_events
from common.provenance import made_from, provenance
from common.slices import read_slice
from common.stage import run_stage


def outcome(chosen: argparse.Namespace) -> None:
    """what the runs of a plan made, and the hazard that follows"""
    from plans.outcome import make_outcome
    from plans.settings import OutcomeSlice

    if (chosen.record is None) != (chosen.comparison is None):
        raise InputError("plans outcome: give both --record and --comparison, or neither")
    values = read_slice(chosen.settings)
    settings = OutcomeSlice.of(values, "plans")
    record = read_events(chosen.record) if chosen.record else None
    comparison = read_dataset(chosen.comparison, ["cut"]) if chosen.comparison else None
    found = make_outcome(settings, read_dataset(chosen.grid), record, comparison)
    files = [path for run in (*settings.runs, *settings.recorded_runs) for path in (*run.events, *run.states)]
    files += [path for run in settings.compared_runs for path in run.events]
    # a run of the mine may be one of the plan, too
    inputs = [chosen.grid, *dict.fromkeys(files), *filter(None, [chosen.record, chosen.comparison])]
    write_dataset(found.assign_attrs(provenance(values, "plans outcome", inputs)), chosen.output)


def report(chosen: argparse.Namespace) -> None:
    """all plans side by side, as a page and a table"""
    from plans.layout import read_outcome
    from plans.page import write_report
    from plans.settings import PlansReportSlice

    values = read_slice(chosen.settings)
    identity = made_from(values, "plans report", [chosen.grid, *chosen.outcomes])
    outcomes = [read_outcome(path) for path in chosen.outcomes]
    settings = PlansReportSlice.of(values, "plans")
    write_report(outcomes, read_dataset(chosen.grid), settings, chosen.output, chosen.table, identity)


def score(chosen: argparse.Namespace) -> None:
    """how good kept forecasts were"""
    from plans import score_sentences, scores
    from plans.layout import read_outcome
    from plans.settings import ScoreSlice

    values = read_slice(chosen.settings)
    settings = ScoreSlice.of(values, "forecasts")
    made_of = provenance(values, "plans score", [chosen.record, chosen.grid])
    forecasts = [read_outcome(one.file) for one in settings.forecasts]
    found = scores.score(forecasts, read_events(chosen.record), read_dataset(chosen.grid), settings)
    told = json.dumps(score_sentences.sentences(found), ensure_ascii=False)
    write_dataset(found.assign_attrs(made_of, sentences=told), chosen.output)


def main() -> None:
    """Parse the command line and run the stage it names."""
    parser = CommandLine(prog="python -m plans", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    one = stages.add_parser("outcome")
    one.add_argument("--record", type=Path)
    one.add_argument("--comparison", type=Path, help="of the mine with the record")
    page = stages.add_parser("report")
    page.add_argument("--outcomes", type=Path, nargs="+", required=True, help="outcome.nc of each plan, in order")
    page.add_argument("--table", type=Path, required=True, help="table written, CSV")
    kept = stages.add_parser("score")
    kept.add_argument("--record", type=Path, required=True)
    for stage in stages.choices.values():
        stage.add_argument("--grid", type=Path, required=True)
        stage.add_argument("--settings", type=Path, required=True, help="file of the configuration's slice, JSON")
        stage.add_argument("--output", type=Path, required=True)
        stage.add_argument("--log", type=Path, help="log file; standard error without it")
    chosen = parser.parse_args()
    run = {"outcome": outcome, "report": report, "score": score}[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), run.__doc__ or "")


if __name__ == "__main__":
    main()
