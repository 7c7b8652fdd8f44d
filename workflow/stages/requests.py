"""Stages that run on request: pictures, files for ParaView, a record for a mine that has none."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    from workflow.mine import Mine


@stage("catalogs", modules=("workflow.quote",), settings=lambda mine, wildcards: mine.picture_slice())
def scene(job: Job) -> None:
    """A picture of what will be solved: cells, solids, record."""
    from catalogs.figures.overview import write_overview
    from catalogs.records import read_record
    from catalogs.settings import PictureSlice
    from common.datasets import read_dataset
    from common.errors import InputError

    record, mistakes, grid = None, job.settings.get("record_mistakes", ""), read_dataset(job.input("grid"))
    if "record" in job.settings:
        # The record's own stage would end the run: what a user looks for here is in the solids, too.
        try:
            record = read_record(job.settings["record"])
        except InputError as error:
            mistakes = str(error)
    notes = [f"The record is not drawn: {mistakes}"] if mistakes else []
    for note in notes:
        logging.warning(note)
    steps = PictureSlice.of({"steps": job.settings["steps"]}).steps
    notes += quote_of(job.logs, grid.attrs.get("config_hash"), len(steps))
    write_overview(grid, steps, record, job.output(), notes)


def quote_of(logs: Path | None, made_of: str | None, steps: int) -> list[str]:
    """What `snakemake quote` foresaw for the grid with this hash of its settings and so many steps, as a sentence; none
    where nobody asked."""
    import json

    from workflow.quote import Quote

    try:
        kept = json.loads(((logs or Path()) / "quote.json").read_text(encoding="utf-8"))
        one = Quote(**kept["own"])
        told = f"On cells of {one.cell:.3g} m with {kept['cores']} core{'s' * (kept['cores'] > 1)}, {one.text()}."
        # Without listed steps a mine has its history alone, which no step of its own computes.
        return [told] if kept["made_of"][0] == made_of and max(kept["steps"], 1) == steps else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def quote_settings(mine: "Mine") -> dict:
    """Settings of stage `quote`."""
    from workflow.quote import quote_slice

    return quote_slice(mine)


@stage(
    "mpm_core",
    "seismic",
    "catalogs",
    modules=("workflow.run_mine", "workflow.pilot", "workflow.quote"),
    settings=lambda mine, wildcards: quote_settings(mine),
)
def quote(job: Job) -> None:
    """what the mine will take, and how wrong its cells leave it"""
    import json
    from dataclasses import asdict

    from common.datasets import atomic_path
    from common.job import config_hash
    from workflow.quote import Quotes, text_of

    quotes = Quotes(job.settings, job.code, job.threads)
    text = text_of(quotes)
    for line in text.splitlines():
        logging.info("%s", line)
    own = quotes.own
    half = quotes.half(own)
    grid, rock = job.settings["grids"][str(job.settings["cell"])], job.settings["pilots"][-1]["elastic"]
    values = {
        "own": asdict(own),
        "half": half and asdict(half),
        "pilot": asdict(quotes.pilot),
        "cores": job.threads,
        "steps": job.settings["steps"],
        "members": job.settings["members"],
        "companion": job.settings["companion"],
        "made_of": [config_hash(grid), config_hash(rock)],
    }
    with atomic_path(job.output("quote.json")) as temporary:
        temporary.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    with atomic_path(job.output("quote.txt")) as temporary:
        temporary.write_text(text, encoding="utf-8")


@stage("catalogs", settings=lambda mine, wildcards: {"noise": 10.0, "cut": -3.0, "seed": 1})
def twin(job: Job) -> None:
    """A modelled catalogue as a seismic system might have recorded it.

    noise: root mean square location error, m; cut: smallest log10 of potency in m3.
    """
    from catalogs.sources.twin import write_twin
    from common.event_table import read_events

    count = write_twin(read_events(job.input("catalog")), **job.settings, path=job.output())
    logging.info("%d event%s", count, "s" * (count != 1))


@stage("mpm_core")
def vtk(job: Job) -> None:
    """a state for ParaView"""
    from common.datasets import read_dataset
    from mpm_core.files.state_datasets import read_edge_nodes, read_grid, read_pieces
    from mpm_core.files.state_vtk import write_vtu

    state, first = read_dataset(job.settings["state"]), read_dataset(job.input("grid"))
    write_vtu(read_grid(state)[0], read_pieces(first), read_edge_nodes(first), state, job.output())


@stage("catalogs")
def vtk_events(job: Job) -> None:
    """A catalogue's events for ParaView."""
    from catalogs.sources.events_vtk import write_points
    from common.event_table import read_events

    write_points(read_events(Path(job.settings["events"])), job.output())


@stage("mpm_core", settings=lambda mine, wildcards: mine.solids_slice())
def vtk_solids(job: Job) -> None:
    """the solids for ParaView"""
    from mpm_core.files.state_vtk import INDEX, write_solids
    from mpm_core.scene.scene_solids import read_solids
    from mpm_core.settings import GridSlice
    from mpm_core.stages.grid_stage import domain_of

    settings = GridSlice.of(job.settings)
    domain, may_miss = domain_of(settings), {"rock_bodies": settings.far_field is not None}
    groups = {
        group: read_solids(getattr(settings, group), group, domain, may_miss.get(group, False)) for group in INDEX
    }
    write_solids(groups, settings.plane, settings.mined, job.output())
