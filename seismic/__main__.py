"""Command lines: `python -m seismic events` (one step), `catalog` and `closeness` (all steps)."""

import argparse
import logging

import numpy as np

from common.command_line import CommandLine
from common.datasets import read_dataset, write_dataset
from common.errors import InputError
from common.event_table import read_events, write_events
from common.provenance import provenance
from common.slices import read_slice
from common.stage import run_stage
from seismic.event_settings import EventSettings


def main(arguments: list[str] | None = None) -> None:
    """Parse the command line and run the stage it names."""
    parser = CommandLine(prog="python -m seismic", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    one = stages.add_parser("events", help="events of one mining step")
    one.add_argument("--step", required=True, help="steps/<step>.nc")
    every = stages.add_parser("catalog", help="the catalogue of all dated steps")
    every.add_argument("--events", required=True, nargs="+", help="events/<step>.nc of every step")
    every.add_argument("--csv", required=True, help="the same catalogue as a table")
    tried = stages.add_parser("closeness", help="sizes of events at several closenesses and link reaches")
    tried.add_argument("--steps", required=True, nargs="+", help="steps/<step>.nc of every dated step")
    for stage in (one, every, tried):
        stage.add_argument(
            "--settings",
            required=True,
            help="file of the configuration's slice, JSON (seismic.event_settings.EventSettings)",
        )
        stage.add_argument("--output", required=True, help="netCDF written")
        stage.add_argument("--log", help="log file; standard error without it")
    chosen = parser.parse_args(arguments)
    run, does = {
        "events": (events, "seismic events of one step, from its plastic strain"),
        "catalog": (catalog, "the catalogue of all dated steps"),
        "closeness": (closeness, "sizes of events at several values of closeness, and with shorter links"),
    }[chosen.stage]
    run_stage(f"{chosen.stage} {chosen.output}", chosen.log, lambda: run(chosen), does)


def events(chosen: argparse.Namespace) -> None:
    """Events of one mining step."""
    # here: the catalogue need not wait for numba and scikit-learn, nor be made again when they are used otherwise
    from common.part_centers import PLACE_VARIABLES
    from seismic.events import STEP_VARIABLES, extract_events

    settings = read_slice(chosen.settings)
    step = read_dataset(chosen.step, {*STEP_VARIABLES, *PLACE_VARIABLES})
    try:
        dataset, _ = extract_events(step, EventSettings.of(settings, "seismic"))
    except InputError as error:
        raise InputError(f"{chosen.step}: {error}") from error
    write_events(dataset.assign_attrs(provenance(settings, "seismic events", [chosen.step])), chosen.output)


def closeness(chosen: argparse.Namespace) -> None:
    """Sizes of events at several values of closeness, and with shorter links."""
    from common.part_centers import PLACE_VARIABLES
    from seismic.closeness import sizes_by_closeness
    from seismic.events import ROCK_VARIABLES

    settings = read_slice(chosen.settings)
    steps = (read_dataset(path, {*ROCK_VARIABLES, *PLACE_VARIABLES}) for path in chosen.steps)
    sizes = sizes_by_closeness(steps, EventSettings.of(settings, "seismic"))
    write_dataset(sizes.assign_attrs(provenance(settings, "seismic closeness", chosen.steps)), chosen.output)


def catalog(chosen: argparse.Namespace) -> None:
    """The catalogue of all dated steps."""
    from seismic.catalog import merge, write_csv

    settings = read_slice(chosen.settings)
    mine = EventSettings.of(settings, "seismic").mine
    merged = merge([read_events(path) for path in chosen.events])
    if merged.attrs["mine"] != mine:
        raise InputError(f"catalog: events are of mine {merged.attrs['mine']}, settings of {mine}")
    logging.info("catalogue of %d events, %d resolved", merged.sizes["event"], np.sum(merged["resolved"].values))
    write_events(merged.assign_attrs(provenance(settings, "seismic catalog", chosen.events)), chosen.output)
    write_csv(merged, chosen.csv)


if __name__ == "__main__":
    main()
