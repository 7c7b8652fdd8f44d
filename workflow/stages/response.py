"""Stages of what drives and stopes feel."""

from common.job import Job
from workflow.stages import stage


@stage("response", settings=lambda mine, wildcards: mine.openings_slice())
def openings(job: Job) -> None:
    """Depth of failure, closure and stress at the walls of each excavation, by step, side and chainage"""
    from common.datasets import write_dataset
    from common.opening_table import FIELDS
    from response.openings import read_and_measure
    from response.settings import OpeningSlice
    from response.table_csv import write_csv

    states, folder = job.paths("steps"), job.input("events")
    events = [folder / f"{state.stem}.nc" for state in states]
    settings, record = OpeningSlice.of(job.settings), job.input_if_any("record")
    found = read_and_measure(settings, job.input("grid"), states, events, record)
    found = found.assign_attrs(job.provenance())
    write_dataset(found, job.output("openings.nc"))
    write_csv(found, FIELDS, job.output("openings.csv"))


@stage("response")
def plan_openings(job: Job) -> None:
    """Openings of a plan: those of its own run by step, and those of all runs after the last step"""
    from common.datasets import write_dataset
    from common.opening_table import FIELDS
    from response.run_openings import plan_tables
    from response.settings import PlanOpeningSlice
    from response.table_csv import write_csv

    settings = PlanOpeningSlice.of(job.settings)
    own, runs = plan_tables(settings, job.input("grid"), job.input_if_any("record"))
    write_csv(own, FIELDS, job.output("openings.csv"))
    write_dataset(own.assign_attrs(job.provenance()), job.output("openings.nc"))
    write_dataset(runs.assign_attrs(job.provenance()), job.output("opening_runs.nc"))


@stage("response", settings=lambda mine, wildcards: mine.observations_slice())
def observations(job: Job) -> None:
    """Stress, displacement, extension and closure where instruments are, beside their readings"""
    from common.datasets import read_dataset, write_dataset
    from common.observation_table import FIELDS
    from response.observation_settings import ObservationSlice
    from response.observations import observe
    from response.rock import VARIABLES
    from response.table_csv import write_csv

    grid = read_dataset(job.input("grid"))
    states = (read_dataset(path, VARIABLES) for path in job.paths("steps"))
    found = observe(ObservationSlice.of(job.settings), grid, states)
    found = found.assign_attrs(job.provenance())
    write_dataset(found, job.output("observations.nc"))
    write_csv(found, FIELDS, job.output("observations.csv"))


@stage("response", settings=lambda mine, wildcards: mine.loading_slice())
def loading(job: Job) -> None:
    """Energy that mining releases, plastic work, loading stiffness and excess shear stress, by step and opening"""
    _measure_loading(job)


@stage("response")
def plan_loading(job: Job) -> None:
    """Energy that mining by a plan releases, plastic work, loading stiffness and excess shear stress"""
    _measure_loading(job)


def _measure_loading(job: Job) -> None:
    """Write the table of loading measures of a mine or of a plan."""
    from common.datasets import write_dataset
    from common.loading_table import FIELDS
    from response.loading import read_and_measure
    from response.loading_settings import LoadingSlice
    from response.table_csv import write_csv

    settings, states = LoadingSlice.of(job.settings), job.paths("steps")
    found = read_and_measure(settings, job.input("grid"), job.input("elastic"), states)
    found = found.assign_attrs(job.provenance())
    write_dataset(found, job.output("loading.nc"))
    write_csv(found, FIELDS, job.output("loading.csv"))


@stage("response", settings=lambda mine, wildcards: mine.scans_slice())
def scans(job: Job) -> None:
    """Overbreak of scanned voids by wall, beside the rock that has failed there"""
    from common.datasets import read_dataset, write_dataset
    from common.scan_table import FIELDS
    from response.rock import VARIABLES
    from response.scan_settings import ScanSlice
    from response.scans import compare_scans
    from response.table_csv import write_csv

    grid = read_dataset(job.input("grid"))
    states = (read_dataset(path, VARIABLES) for path in job.paths("steps"))
    found = compare_scans(ScanSlice.of(job.settings), grid, states)
    found = found.assign_attrs(job.provenance())
    write_dataset(found, job.output("scans.nc"))
    write_csv(found, FIELDS, job.output("scans.csv"))
