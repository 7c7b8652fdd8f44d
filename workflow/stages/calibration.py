"""Stages of a calibration: trials, the points of further trials, and the fit."""

from typing import Any

from common.job import Job
from workflow.stages import stage

# What instruments need of `response`, whose other modules use catalogs: a report that is worded anew runs no trial.
READS_INSTRUMENTS = ("field", "observation_settings", "observations", "readings", "rock", "scan_settings", "settings")


@stage(
    "mpm_core",
    "seismic",
    modules=(
        "workflow.run_mine",
        "catalogs.settings",
        "catalogs.records.times",
        *(f"response.{module}" for module in READS_INSTRUMENTS),
    ),
)
def trial(job: Job) -> None:
    """a run of the mine with other values of the calibrated quantities"""
    from common.event_table import write_events
    from common.observation_table import MODELLED, MODELLED_ERROR
    from mpm_core.simd.threads import use_threads
    from response.field import Values
    from response.observation_settings import ObservationSlice
    from response.observations import read_values, tabulate
    from seismic.catalog import join_extractions, merge
    from workflow.run_mine import run_stages

    use_threads(job.threads)
    by_step: dict[str, list] = {}
    collapsed, grid, values = "", None, list[Values]()
    instruments = ObservationSlice.of(job.settings["instruments"]) if "instruments" in job.settings else None
    for name, dataset, _ in run_stages(job.settings, job.output().with_suffix(".failed.npz")):
        grid = dataset if name == "grid" else grid
        if name.startswith("steps/") and dataset.attrs["collapsed"]:
            collapsed = collapsed or f"step {dataset.attrs['step']}: {dataset.attrs['collapse']}"
        if name.startswith("steps/") and instruments is not None:
            assert grid is not None
            values.append(read_values(instruments, grid, dataset, len(values)))
        if name.startswith("events/"):
            by_step.setdefault(name, []).append(dataset)
    # One catalogue for each setting of the extraction; the potency of undated steps came before the record.
    before = sum(float(sets[0].potency.sum()) for sets in by_step.values() if not sets[0].attrs["dated"])
    catalogues = [merge(list(sets)) for sets in zip(*by_step.values(), strict=True)]
    # The fit leaves out a trial that has collapsed, and says so.
    made = join_extractions(catalogues).assign_attrs(potency_before_record=before, collapsed=collapsed)
    if instruments is not None:
        table = tabulate(instruments, values)
        made = made.assign({field.name: table[field.name] for field in (MODELLED, MODELLED_ERROR)})
    write_events(made.assign_attrs(job.provenance()), job.output())


@stage("calibration")
def calibration_record(job: Job) -> None:
    """a look at the record before any trial: can it be calibrated to?"""
    from calibration.stages import record_stage

    record_stage(job.settings, record=job.input("record"), output=job.output())


@stage("response")
def calibration_readings(job: Job) -> None:
    """readings of instruments that a calibration uses"""
    from common.datasets import write_dataset
    from response.observation_settings import ObservationSlice
    from response.observations import tabulate_readings

    found = tabulate_readings(ObservationSlice.of(job.settings))
    write_dataset(found.assign_attrs(job.provenance()), job.output())


@stage("calibration")
def further(job: Job) -> None:
    """where further trials teach most"""
    from calibration.stages import further_stage

    further_stage(job.settings, **_data(job), output=job.output())


@stage("calibration")
def calibrate(job: Job) -> None:
    """the calibrated quantities, from all trials and the record"""
    from calibration.stages import fit_stage

    page, table = job.outputs[:2]
    fit_stage(job.settings, **_data(job), output=page, table=table)


def _data(job: Job) -> dict[str, Any]:
    """Files of trials and of what they are fitted to, by name; None for what does not count."""
    files = {name: job.input_if_any(name) for name in ("record", "readings")}
    return {"trials": job.paths("trials"), "finer": job.paths("finer"), **files}
