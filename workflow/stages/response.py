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
