"""What rules ask their modules: files, jobs, cores."""

import re

import pytest
from snakemake.iocontainers import Wildcards
from tiny_mines import STILL, TINY

from common.job import read_job
from workflow import BASE
from workflow.folders import Folders
from workflow.result_files import ResultFiles
from workflow.rule_inputs import RuleInputs
from workflow.rule_resources import RuleResources

ENSEMBLE = {"ensemble": 2, "grid_convergence": True}


def cards(**values) -> Wildcards:
    """Wildcards of a job."""
    return Wildcards(fromdict=values)


class Guests:
    """Mines that somebody adds to the run's own."""

    pattern = "guests/[a-z]+"

    def __init__(self, mine):
        self.mine_at = {"guests/one": mine}.__getitem__

    def threads_at(self, place: str) -> int:
        return len(place)


@pytest.fixture
def files(accept) -> ResultFiles:
    """Of the tiny mine with an ensemble of two and a coarse companion."""
    return ResultFiles(Folders(accept(TINY, **ENSEMBLE)))


def test_each_folder_has_its_mine(accept):
    """The run's own, its companion, its members, and mines that were added."""
    folders, guest = Folders(accept(TINY, **ENSEMBLE)), accept(STILL)
    folders.add(Guests(guest))
    assert folders.mine_at("tiny") is folders.mine
    assert folders.mine_at("tiny/ensemble/2").realization == 2
    assert folders.mine_at("tiny/coarse").finest_cell == 2 * folders.mine.finest_cell
    assert folders.mine_at("guests/one") is guest
    assert folders.mine_at("guests/one/ensemble/1").name == guest.name
    assert (folders.threads("tiny/coarse"), folders.threads("guests/one")) == (64, 10)


@pytest.mark.parametrize(
    ("folder", "is_one"),
    [
        *(("tiny", True), ("tiny/coarse", False), ("tiny/ensemble/12", True), ("guests/one", False)),
        *(
            ("tiny/ensemble/0", False),
            ("tiny/coarse/ensemble/1", False),
            ("tinyest", False),
            ("verification/a/b", False),
        ),
    ],
)
def test_only_folders_of_the_run_are_taken(accept, folder, is_one):
    """The wildcard `mine` takes nothing else."""
    assert bool(re.fullmatch(Folders(accept(TINY)).pattern, folder)) == is_one


def test_a_plan_names_every_result(files, accept):
    """Of the mine and its members; and nothing that a mine without dates has not."""
    made = files.all()
    runs = ("", "ensemble/1/", "ensemble/2/")
    steps = [f"{run}{result}" for run in runs for result in ("steps/history.nc", "steps/2019-08.nc", "events")]
    others = [
        "catalog.nc",
        "catalog.csv",
        "catalog.xml",
        "event_rules.nc",
        "source_parameters.nc",
        "record.nc",
        "openings.csv",
        "comparison.nc",
        "spread.nc",
    ]
    expected = ["grid.nc", "elastic.nc", *steps, *others, "grid_convergence.nc", "report.html", "figures"]
    assert sorted(made) == sorted(f"results/tiny/{name}" for name in expected)
    still = ResultFiles(Folders(accept(STILL)))
    assert sorted(still.all()) == [
        f"results/still/{name}" for name in ("elastic.nc", "figures", "grid.nc", "report.html")
    ]


def test_a_step_starts_from_the_one_before(files):
    """The first one from the elastic state, which members share with their mine and the companion does not."""
    first = {mine: files.previous_state(cards(mine=mine, step="history")) for mine in ("tiny", "tiny/ensemble/1")}
    assert set(first.values()) == {"results/tiny/elastic.nc"}
    assert files.grid(cards(mine="tiny/ensemble/2")) == "results/tiny/grid.nc"
    after = files.previous_state(cards(mine="tiny/ensemble/1", step="2019-08"))
    assert after == "results/tiny/ensemble/1/steps/history.nc"


def test_a_step_that_is_not_listed_ends_the_run_in_one_line(files):
    with pytest.raises(SystemExit, match=r"tiny: steps: no '2019-09'; there are history, 2019-08"):
        files.previous_state(cards(mine="tiny", step="2019-09"))


def test_rules_of_dated_steps_read_the_dated_ones(files):
    """The undated history has events, and no place in a catalogue's comparison."""
    own = cards(mine="tiny")
    assert files.states(own) == ["results/tiny/steps/history.nc", "results/tiny/steps/2019-08.nc"]
    assert files.dated_states(own) == ["results/tiny/steps/2019-08.nc"]
    assert files.member_events() == [f"results/tiny/ensemble/{number}/events" for number in (1, 2)]
    assert files.member_states() == [f"results/tiny/ensemble/{number}/steps/2019-08.nc" for number in (1, 2)]


def test_a_file_for_paraview_needs_what_makes_its_stage(files):
    """Steps of a companion and events are in a folder that is made as a whole."""
    made = files.made_by("{stage}")
    assert made(cards(mine="tiny", stage="steps/history")) == "results/tiny/steps/history.nc"
    assert made(cards(mine="tiny/coarse", stage="steps/history")) == "results/tiny/coarse/steps"
    assert made(cards(mine="tiny", stage="events/history")) == "results/tiny/events"
    assert files.grid_of_any(cards(mine="tiny/coarse")) == "results/tiny/coarse/grid.nc"
    assert files.grid_of_any(cards(mine="tiny/ensemble/1")) == "results/tiny/grid.nc"


def test_a_step_leaves_one_of_snakemakes_cores_to_the_companion(files):
    """It uses all of them. A member, which has no companion, takes them all, so that no two steps run at once."""
    own, member = cards(mine="tiny"), cards(mine="tiny/ensemble/1")
    resources = RuleResources(files, 8)
    assert [resources.threads(one) for one in (own, member)] == [7, 64]
    assert [resources.used_threads(own, 7), resources.used_threads(member, 8)] == [8, 8]
    alone = RuleResources(files, 1)
    assert (alone.threads(own), alone.used_threads(own, 1), alone.all_cores(own)) == (64, 1, 1)


def test_a_job_on_a_cluster_uses_the_cores_that_it_was_given(files):
    """Snakemake has no cores of its own there."""
    resources = RuleResources(files, None)
    assert (resources.threads(cards(mine="tiny")), resources.used_threads(cards(mine="tiny"), 16)) == (64, 16)
    assert resources.all_cores(cards()) == 1


def test_a_job_is_written_with_the_inputs_of_its_rule(files, tmp_path, monkeypatch):
    """Where the wildcard says; a rule without one is of the run's own mine. What the scene has none of is left out."""
    monkeypatch.chdir(tmp_path)
    inputs = RuleInputs(files.folders)
    step = inputs.of("step", "{step}", grid=files.grid, state=files.previous_state)
    member = cards(mine="tiny/ensemble/1", step="2019-08")
    assert step["grid"](member) == "results/tiny/grid.nc"
    written = step["job"](member)
    assert written.startswith("results/tiny/ensemble/1/jobs/step/2019-08/")
    job = read_job(written)
    assert job.inputs == {"grid": ["results/tiny/grid.nc"], "state": ["results/tiny/ensemble/1/steps/history.nc"]}
    assert job.settings == files.mine.member(1).step_slice("2019-08")
    trial = inputs.of("trial", "{trial}", settings=lambda cards: {"of": cards.trial}, finer=[])["job"]
    assert trial(cards(trial="2")).startswith("results/tiny/jobs/trial/2/")
    assert read_job(trial(cards(trial="2"))).inputs == {}
    assert trial(cards(trial="2")) != trial(cards(trial="3"))


@pytest.mark.parametrize("name", ["baselines", "plans", "calibration"])
def test_pictures_beside_a_page_are_outputs_of_its_rule(name):
    """Snakemake makes no other file again where it is missing."""
    source, rules = BASE / name / "page.py", BASE / f"workflow/rules/{name}.smk"
    saved = {"".join(names) for names in re.findall(r'"(\w+)": draw_|page\.parent / "(\w+)\.svg"', source.read_text())}
    (outputs,) = re.findall(r"output:\n        page=.*?\n    log:", rules.read_text(), re.DOTALL)
    named = set(re.findall(r"(\w+)\.svg", outputs)) | set(re.findall(r'"(\w+)"', outputs))
    if "figures=TRIALS.figures" in outputs:  # which follow from the terms
        made = (BASE / "workflow/calibration_trials.py").read_text()
        named |= set(re.findall(r'"(\w+)"', made.split("def figures")[1].split("\n\n")[0]))
    assert saved
    assert saved <= named
