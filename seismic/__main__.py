"""Command lines: `python -m seismic events` (one step) and `python -m seismic catalog` (all steps)."""

import argparse
import logging

import numpy as np

from pipeline.datasets import read_dataset, write_dataset
from pipeline.errors import InputError
from pipeline.progress import log_compilation
from pipeline.provenance import provenance
from pipeline.slices import read_slice
from pipeline.stage import run_stage
from seismic.catalog import merge, write_csv
from seismic.settings import EventSettings


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
            help="file of the configuration's slice, JSON (seismic.settings.EventSettings)",
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
    from seismic.events import VARIABLES, extract_events

    log_compilation()
    settings = read_slice(chosen.settings)
    step = read_dataset(chosen.step, VARIABLES)
    try:
        dataset, _ = extract_events(step, settings)
    except InputError as error:
        raise InputError(f"{chosen.step}: {error}") from error
    write_dataset(dataset.assign_attrs(provenance(settings, "seismic")), chosen.output)


def _catalog(chosen: argparse.Namespace) -> None:
    settings = read_slice(chosen.settings)
    mine = EventSettings.of(settings, "seismic").mine
    catalog = merge([read_dataset(path) for path in chosen.events])
    if catalog.attrs["mine"] != mine:
        raise InputError(f"catalog: events are of mine {catalog.attrs['mine']}, settings of {mine}")
    logging.info("catalogue of %d events, %d resolved", catalog.sizes["event"], np.sum(catalog["resolved"].values))
    write_dataset(catalog.assign_attrs(provenance(settings, "seismic")), chosen.output)
    write_csv(catalog, chosen.csv)


if __name__ == "__main__":
    main()
