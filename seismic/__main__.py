"""Command lines: `python -m seismic events` (one step) and `python -m seismic catalog` (all steps)."""

import argparse
import json
import logging

import numpy as np

from pipeline.datasets import read_dataset
from pipeline.errors import InputError
from pipeline.event_table import read_events, write_events
from pipeline.progress import log_compilation
from pipeline.provenance import provenance
from pipeline.stage import run_stage
from seismic.catalog import merge, write_csv


def main(arguments: list[str] | None = None) -> None:
    """Parse the command line and run the stage it names."""
    parser = argparse.ArgumentParser(prog="python -m seismic", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    events = stages.add_parser("events", help="events of one mining step")
    events.add_argument("--step", required=True, help="steps/<step>.nc")
    catalog = stages.add_parser("catalog", help="the catalogue of all dated steps")
    catalog.add_argument("--events", required=True, nargs="+", help="events/<step>.nc of every step")
    catalog.add_argument("--csv", required=True, help="the same catalogue as a table")
    for stage in (events, catalog):
        stage.add_argument(
            "--settings",
            required=True,
            help="JSON: mine, closeness, cluster, seismic_fraction, frame; start, end of a step",
        )
        stage.add_argument("--output", required=True, help="netCDF written")
        stage.add_argument("--log", help="log file; standard error without it")
    chosen = parser.parse_args(arguments)
    run, does = {
        "events": (_events, "seismic events of one step, from its plastic strain"),
        "catalog": (_catalog, "the catalogue of all dated steps"),
    }[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), does)


def _events(chosen: argparse.Namespace) -> None:
    # here: the catalogue need not wait for numba and scikit-learn
    from seismic.events import VARIABLES, dated, extract_events

    log_compilation()
    settings = _settings(chosen.settings)
    step = read_dataset(chosen.step, VARIABLES)
    if dates := {key: settings[key] for key in ("start", "end") if key in settings}:
        step = dated(step, **dates)
    others = {key: value for key, value in settings.items() if key not in dates}
    try:
        dataset, _ = extract_events(step, others)
    except InputError as error:
        raise InputError(f"{chosen.step}: {error}") from error
    write_events(dataset.assign_attrs(provenance(settings, "seismic")), chosen.output)


def _catalog(chosen: argparse.Namespace) -> None:
    settings = _settings(chosen.settings)
    catalog = merge([read_events(path) for path in chosen.events])
    if catalog.attrs["mine"] != settings.get("mine"):
        raise InputError(f"catalog: events are of mine {catalog.attrs['mine']}, settings of {settings.get('mine')}")
    logging.info("catalogue of %d events, %d resolved", catalog.sizes["event"], np.sum(catalog["resolved"].values))
    write_events(catalog.assign_attrs(provenance(settings, "seismic")), chosen.output)
    write_csv(catalog, chosen.csv)


def _settings(text: str) -> dict:
    """Settings from JSON text. Raises InputError."""
    try:
        settings = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"--settings: not JSON ({error}): give one JSON object") from error
    if not isinstance(settings, dict):
        raise InputError("--settings: not a JSON object: give one JSON object")
    return settings


if __name__ == "__main__":
    main()
