"""Stages from plastic strain to the synthetic catalogue, and the recorded one."""

import json
import logging
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from common.job import Job
from workflow.stages import stage

if TYPE_CHECKING:
    from workflow.mine import Mine


@stage("catalogs", settings=lambda mine, wildcards: mine.record_slice())
def record(job: Job) -> None:
    """The recorded catalogue as the configuration's `record` describes it."""
    from catalogs.records import read_record
    from common.event_table import write_events

    frame = {"frame": json.dumps(job.settings["frame"])} if job.settings.get("frame") else {}
    write_events(read_record(job.settings).assign_attrs(frame | job.provenance()), job.output())


@stage(
    "seismic",
    modules=("catalogs.sources.openings", "catalogs.sources.event_labels"),
    settings=lambda mine, wildcards: mine.events_slice() | {"openings": openings_of(mine)},
)
def events(job: Job) -> None:
    """Seismic events of all steps, from their plastic strain, and the catalogue of the dated ones"""
    from catalogs.sources.event_labels import label_events
    from common.datasets import read_dataset
    from common.event_table import read_events, write_events
    from common.processes import call_all
    from seismic.catalog import merge

    folder, provenance = job.output("events"), job.provenance()
    folder.mkdir(parents=True, exist_ok=True)
    steps = {one["name"]: one for one in job.settings["steps"]}
    files = {name: folder / f"{name}.nc" for name in steps}
    states = dict(zip(steps, job.paths("steps"), strict=True))

    def extract(name: str) -> None:
        extracted = _events_of(states[name], job.settings["seismic"] | steps[name]["dates"])
        write_events(extracted.assign_attrs(provenance), files[name])

    call_all({name: partial(extract, name) for name in steps}, job.threads)
    dated = [name for name in steps if steps[name]["dates"]["start"]]
    merged = merge([read_events(files[name]) for name in dated or steps])
    logging.info("catalogue of %d events, %d resolved", merged.sizes["event"], int(merged["resolved"].sum()))
    grid = read_dataset(job.input("grid"))
    merged = label_events(merged, grid, job.settings["openings"], list(steps))
    write_events(merged.assign_attrs(provenance), job.output("catalog.nc"))


def openings_of(mine: "Mine") -> list[dict]:
    """Name of each excavation, and the places in the order of steps that it is mined and filled in, -1 for none."""
    return [
        {
            "name": entry.name,
            "mined": mine.step_index(entry.step),
            "filled": mine.step_index(entry.fill_step) if entry.fill_material is not None else -1,
        }
        for entry in mine.excavations
    ]


def _events_of(state: Path, settings: dict):
    """Events of one step. Raises InputError that names the file of its state."""
    from common.datasets import read_dataset
    from common.errors import InputError
    from common.part_centers import PLACE_VARIABLES
    from seismic.event_settings import EventSettings
    from seismic.events import STEP_VARIABLES, extract_events

    try:
        return extract_events(
            read_dataset(state, {*STEP_VARIABLES, *PLACE_VARIABLES}), EventSettings.of(settings, "seismic")
        )[0]
    except InputError as error:
        raise InputError(f"{state}: {error}") from error


@stage("seismic", "catalogs", settings=lambda mine, wildcards: mine.catalogue_slice())
def catalogue(job: Job) -> None:
    """The catalogue as a table and as QuakeML, source parameters, and sizes of events by several rules"""

    import numpy as np

    from catalogs.sources.event_labels import append_columns, label_columns
    from catalogs.sources.quakeml import write_quakeml
    from catalogs.sources.source_parameters import parameters, table_columns
    from common.datasets import read_dataset, write_dataset
    from common.event_table import read_events
    from common.part_centers import PLACE_VARIABLES
    from seismic.catalog import write_csv
    from seismic.event_settings import EventSettings
    from seismic.events import ROCK_VARIABLES, sizes_by_rule

    catalog, settings = read_events(job.input("catalog")), EventSettings.of(job.settings, "seismic")
    if job.writes("catalog.xml"):
        write_quakeml(catalog, job.output("catalog.xml"))
    energy = np.full(catalog.sizes["event"], np.nan)

    def states() -> Iterator:
        for path in job.paths("steps"):
            state = read_dataset(path, {*ROCK_VARIABLES, *PLACE_VARIABLES, "material"})
            own = np.flatnonzero(catalog["step"].values == state.attrs["step"])
            energy[own] = _energies_of(state, settings)
            yield state

    sizes = sizes_by_rule(states(), settings)
    write_dataset(sizes.assign_attrs(job.provenance()), job.output("event_rules.nc"))
    found = parameters(catalog, energy, settings.dimension, settings.thickness, job.provenance())
    write_dataset(found, job.output("source_parameters.nc"))
    write_csv(catalog, job.output("catalog.csv"))
    append_columns(label_columns(catalog) | table_columns(found), job.output("catalog.csv"))


def _energies_of(state, settings):
    """Energy (event,) J of the drop of strength of a step's events, in the order of the catalogue."""
    import numpy as np

    from catalogs.sources.source_parameters import drop_energies
    from seismic.events import failed_rock

    rock = failed_rock(state, settings)
    event, resolved = rock.events(settings)
    moduli = json.loads(state.attrs["elastic_moduli"])
    by_material = np.array([moduli[name] for name in json.loads(state.attrs["material_names"])])
    lame, shear = by_material[state["material"].values[rock.source]].T
    strain, volume = state["seismic_strain"].values[rock.source], state["volume"].values[rock.source]
    own = settings.seismic_fraction * drop_energies(strain, volume, lame, shear)
    return np.bincount(event, own, minlength=len(resolved))
