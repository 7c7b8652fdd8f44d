"""Stages of a calibration: trials, the points of further trials, and the fit."""

from common.job import Job
from workflow.stages import stage


@stage("mpm_core", "seismic", modules=("workflow.run_mine",))
def trial(job: Job) -> None:
    """a run of the mine with other values of the calibrated quantities"""
    from common.event_table import write_events
    from mpm_core.simd.threads import use_threads
    from seismic.catalog import join_extractions, merge
    from workflow.run_mine import run_stages

    use_threads(job.threads)
    by_step: dict[str, list] = {}
    collapsed = ""
    for name, dataset, _ in run_stages(job.settings, job.output().with_suffix(".failed.npz")):
        if name.startswith("steps/") and dataset.attrs["collapsed"]:
            collapsed = collapsed or f"step {dataset.attrs['step']}: {dataset.attrs['collapse']}"
        if name.startswith("events/"):
            by_step.setdefault(name, []).append(dataset)
    # One catalogue for each setting of the extraction; the potency of undated steps came before the record.
    before = sum(float(sets[0].potency.sum()) for sets in by_step.values() if not sets[0].attrs["dated"])
    catalogues = [merge(list(sets)) for sets in zip(*by_step.values(), strict=True)]
    # The fit leaves out a trial that has collapsed, and says so.
    made = join_extractions(catalogues).assign_attrs(potency_before_record=before, collapsed=collapsed)
    write_events(made.assign_attrs(job.provenance()), job.output())


@stage("calibration")
def calibration_record(job: Job) -> None:
    """a look at the record before any trial: can it be calibrated to?"""
    from calibration.stages import record_stage

    record_stage(job.settings, record=job.input("record"), output=job.output())


@stage("calibration")
def further(job: Job) -> None:
    """where further trials teach most"""
    from calibration.stages import further_stage

    trials, finer = job.paths("trials"), job.paths("finer")
    further_stage(job.settings, trials=trials, finer=finer, record=job.input("record"), output=job.output())


@stage("calibration")
def calibrate(job: Job) -> None:
    """the calibrated quantities, from all trials and the record"""
    from calibration.stages import fit_stage

    trials, finer = job.paths("trials"), job.paths("finer")
    page, table = job.outputs[:2]
    fit_stage(job.settings, trials=trials, finer=finer, record=job.input("record"), output=page, table=table)
