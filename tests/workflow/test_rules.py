"""What rules ask their modules: files, slices, options, threads; and what a run of a mine leaves unread."""

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr
from snakemake.cli import get_argument_parser
from snakemake.iocontainers import Wildcards
from tiny_mines import STILL, TINY, command

from common.datasets import write_dataset
from common.provenance import MADE_FROM, made_from
from workflow.folders import Folders
from workflow.result_files import ResultFiles
from workflow.rule_options import RuleOptions
from workflow.snakemake_command_line import asks_for_more
from workflow.stage_inputs import StageInputs

KINDS, STEPS = ("steps", "events"), ("history", "2019-08")
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


def running(**changes) -> SimpleNamespace:
    """What rules see of a workflow that runs here on two cores, with changes."""
    limits = SimpleNamespace(max_threads=changes.pop("max_threads", None), cores=changes.get("cores", 2))
    return SimpleNamespace(
        **{"local_exec": True, "remote_exec": False, "cores": 2, "resource_settings": limits} | changes
    )


@pytest.fixture
def files(accept) -> ResultFiles:
    """Of the tiny mine with an ensemble of two and a coarse companion."""
    return ResultFiles(Folders(accept(TINY, **ENSEMBLE)))


def test_each_folder_has_its_mine(accept):
    """The run's own, its companion, its members, and mines that were added."""
    folders, guest = Folders(accept(TINY, **ENSEMBLE)), accept(STILL)
    folders.add(Guests(guest))
    assert folders.mine_at("tiny") is folders.mine
    assert folders.mine_at("tiny/ensemble/2").perturbation == 2
    assert folders.mine_at("tiny/coarse").finest_cell == 2 * folders.mine.finest_cell
    assert folders.mine_at("guests/one") is guest
    assert folders.mine_at("guests/one/ensemble/1").name == guest.name
    assert (folders.threads("tiny/coarse"), folders.threads("guests/one")) == (64, 10)


@pytest.mark.parametrize(
    ("folder", "is_one"),
    [
        *(("tiny", True), ("tiny/coarse", True), ("tiny/ensemble/12", True), ("guests/one", False)),
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
    steps = [
        f"{run}{kind}/{step}.nc" for run in runs for kind in ("steps", "events") for step in ("history", "2019-08")
    ]
    others = ["catalog.nc", "catalog.csv", "catalog.xml", "closeness.nc", "record.nc", "comparison.nc", "spread.nc"]
    expected = ["grid.nc", "elastic.nc", *steps, *others, "grid_convergence.nc", "report.html"]
    assert sorted(made) == sorted(f"results/tiny/{name}" for name in expected)
    more = set(files.planned()) - set(made)
    assert {
        "results/tiny/twin.csv",
        "results/tiny/coarse/steps/2019-08.nc",
        "results/tiny/ensemble/2/catalog.nc",
    } <= more
    still = ResultFiles(Folders(accept(STILL)))
    assert sorted(still.all()) == [f"results/still/{name}" for name in ("elastic.nc", "grid.nc", "report.html")]


def test_a_step_starts_from_the_one_before(files):
    """The first one from the elastic state, which members share with their mine and the companion does not."""
    first = {mine: files.previous_state(cards(mine=mine, step="history")) for mine in ("tiny", "tiny/ensemble/1")}
    assert set(first.values()) == {"results/tiny/elastic.nc"}
    assert files.previous_state(cards(mine="tiny/coarse", step="history")) == "results/tiny/coarse/elastic.nc"
    assert files.grid(cards(mine="tiny/ensemble/2")) == "results/tiny/grid.nc"
    after = files.previous_state(cards(mine="tiny/ensemble/1", step="2019-08"))
    assert after == "results/tiny/ensemble/1/steps/history.nc"


def test_a_step_that_is_not_listed_ends_the_run_in_one_line(files):
    with pytest.raises(SystemExit, match=r"tiny: steps: no '2019-09'; there are history, 2019-08"):
        files.previous_state(cards(mine="tiny", step="2019-09"))


def test_rules_of_dated_steps_read_the_dated_ones(files):
    """The undated history has events, and no place in a catalogue's comparison."""
    own, coarse = cards(mine="tiny"), ["results/tiny/coarse/steps/2019-08.nc"]
    assert files.events(own) == ["results/tiny/events/2019-08.nc"]
    assert files.dated_steps(own) == ["results/tiny/steps/2019-08.nc"]
    assert files.coarse_dated_steps(own) == coarse
    assert files.member_events(own) == [f"results/tiny/ensemble/{number}/events/2019-08.nc" for number in (1, 2)]
    assert len(files.dated_results(own)) == 3 * 2


def test_options_follow_the_inputs(files, accept):
    """Members and comparison where there are any; the comparison is the mine's own."""
    options, own = RuleOptions(files, running(cores=1)), cards(mine="tiny")
    folders = "--members results/tiny/ensemble/1 results/tiny/ensemble/2"
    assert options.members(own, SimpleNamespace(members=["one"])) == folders
    assert options.members(own, SimpleNamespace(members=[])) == ""
    assert files.comparison(own) == "results/tiny/comparison.nc"
    assert files.comparison(cards(mine="tiny/coarse")) == []
    assert options.comparison(own, SimpleNamespace(comparison="c.nc")) == "--comparison c.nc"
    assert options.if_made("spread", "spread.nc", files.mine.members) == "--spread results/tiny/spread.nc"
    assert options.if_made("spread", "spread.nc", 0) == ""
    assert options.threads(own) == 64


@pytest.mark.parametrize("workflow", [{"cores": 1}, {"remote_exec": True}, {"local_exec": False}])
def test_each_job_has_cores_where_none_is_idle(files, workflow):
    """On one core, and on a cluster: there and where its jobs are sent from."""
    options, coarse = RuleOptions(files, running(**workflow)), cards(mine="tiny/coarse")
    assert (options.threads(coarse), options.reading_threads(coarse)) == (64, 1)
    assert [options.stage_cores(coarse, threads) for threads in (1, 64)] == [1, 64]
    assert [options.held_cores(coarse, threads) for threads in (1, 64)] == [0, 0]


def test_the_companion_and_events_run_in_idle_time(files):
    """Snakemake starts them while the mine's own step, or one of its ensemble's, has all cores but one of its count."""
    options = RuleOptions(files, running())
    folders = [cards(mine=mine) for mine in ("tiny", "tiny/ensemble/1", "tiny/coarse")]
    threads = [options.threads(folder) for folder in folders]
    assert threads == [1, 1, 0]
    assert [options.stage_cores(folder, own) for folder, own in zip(folders, threads, strict=True)] == [2, 2, 0]
    assert options.reading_threads(cards(mine="tiny")) == 0
    assert [options.in_idle_time(cards(mine="tiny"), threads) for threads in (0, 64)] == [1, 0]


def test_no_two_steps_on_all_cores_run_at_once(files):
    """The limit is what one of them takes; a step that the user gives fewer threads takes those."""
    limits = {}
    workflow = running(cores=8, register_resource=limits.__setitem__)
    options, own = RuleOptions(files, workflow), cards(mine="tiny")
    options.limit_jobs()
    threads = options.threads(own)
    assert limits["held_cores"] == options.held_cores(own, threads) == options.stage_cores(own, threads) == 8
    assert limits["in_idle_time"] >= 1
    assert options.first_threads(own) == 8  # so that nothing starts beside the record
    assert options.stage_cores(own, 3) == 3
    fewer = RuleOptions(files, running(cores=8, max_threads=7))
    assert fewer.stage_cores(own, fewer.threads(own)) == 7


def test_the_rules_are_read_where_snakemake_has_no_cores(files):
    """`--profile profiles/slurm` gives none, and says that its jobs run elsewhere after the rules are read."""
    limits = {}
    settings = SimpleNamespace(cores=None)  # workflow.cores raises
    workflow = SimpleNamespace(local_exec=True, resource_settings=settings, register_resource=limits.__setitem__)
    RuleOptions(files, workflow).limit_jobs()
    assert list(limits) == ["in_idle_time"]


def test_a_folder_of_records_is_no_input(files, accept):
    """A file is; a mine that compares nothing has none."""
    assert Path(files.record_data()).name == "record.csv"
    files.mine.change("record", reader="elk_creek")
    assert files.record_data() == []
    assert ResultFiles(Folders(accept(STILL))).record_data() == []


@pytest.mark.parametrize("config", ["this", "another"])
def test_a_result_of_another_configuration_is_made_again(files, tmp_path, monkeypatch, config):
    """It stands, with its inputs; what it says that it was made from decides."""
    monkeypatch.chdir(tmp_path)
    dag = SimpleNamespace(forcefiles=set())
    workflow = SimpleNamespace(is_main_process=True, execution_settings=None, dryrun=False, dag=dag)
    stages, own = StageInputs(files, workflow), cards(mine="tiny", step="2019-08")
    inputs = stages.inputs_of("seismic events", "events/{step}", step="results/{mine}/steps/{step}.nc").callable
    expected = {"step": "results/tiny/steps/2019-08.nc"}
    assert inputs(own) == expected
    values = files.mine.slice_of("events/2019-08") if config == "this" else {}
    empty_dataset(expected["step"], {})
    empty_dataset("results/tiny/events/2019-08.nc", {MADE_FROM: made_from(values, "seismic events", expected.values())})
    assert inputs(own) == expected
    assert dag.forcefiles == (set() if config == "this" else {"results/tiny/events/2019-08.nc"})


@pytest.mark.parametrize("given", ["this", "another"])
def test_a_trial_of_other_values_is_run_again_without_a_note_of_snakemake(files, tmp_path, monkeypatch, given):
    """As after a job that ended while Snakemake was not running."""
    monkeypatch.chdir(tmp_path)
    dag = SimpleNamespace(forcefiles=set())
    workflow = SimpleNamespace(is_main_process=True, execution_settings=None, dryrun=False, dag=dag)
    path = "results/tiny/{trial}.nc"
    made = StageInputs(files, workflow).named_inputs(
        "calibration trial", path, lambda cards: {"of": cards.trial}, unread=("grid",), grid="g"
    )
    own = cards(trial="2")
    assert made.callable(own) == {"grid": "g"}
    values = {"of": "2" if given == "this" else "3"}
    empty_dataset(path.format(trial="2"), {MADE_FROM: made_from(values, "calibration trial")})
    assert made.callable(own) == {"grid": "g"}
    assert dag.forcefiles == (set() if given == "this" else {"results/tiny/2.nc"})


def empty_dataset(path: str, attributes: dict) -> None:
    """A result that holds nothing."""
    write_dataset(xr.Dataset(attrs=attributes), path)


def test_slices_are_named_by_mine_and_stage(files, tmp_path, monkeypatch):
    """Written when the run begins; a rule without a wildcard `mine` is of the run's own."""
    monkeypatch.chdir(tmp_path)
    stages = StageInputs(files, SimpleNamespace(is_main_process=True, execution_settings=None, dryrun=True))
    scene = stages.slice_of("scene")(cards())
    step = stages.step_slice(cards(mine="tiny/coarse", step="history"))
    event = stages.event_slice(cards(mine="tiny", step="2019-08"))
    assert scene.startswith("results/tiny/slices/scene.")
    assert step.startswith("results/tiny/coarse/slices/steps/history.")
    assert event.startswith("results/tiny/slices/events/2019-08.")
    assert not (tmp_path / "results").exists()
    stages.slices.begin()
    assert all((tmp_path / path).is_file() for path in (scene, step, event))


@pytest.mark.parametrize(
    ("words", "more"),
    [
        ("", False),
        ("all results/tiny/report.html ./results/tiny/vtk/elastic.vtu --configfile verification.yaml", False),
        ("verification", True),
        ("results/tiny/report.html results/verification/jaeger/rows.csv", True),
        ("all --forcerun stability", True),
        ("--until stability", True),
        ("--prioritize results/stability/points/walls.json", True),
        ("--forcerun grid --until all", False),
        ("--lint", True),
        ("--list-rules", True),
        ("--target-jobs grid:mine=tiny/coarse", False),
        ("--target-jobs grid:mine=verification/jaeger/dip_40", True),
        ("--target-jobs answer:study=jaeger", True),
    ],
)
def test_other_rules_are_read_when_a_target_needs_them(words, more):
    """Names of rules, files, and jobs that another process has planned."""
    arguments = get_argument_parser().parse_args(words.split())
    assert asks_for_more(arguments, {"all", "grid"}.__contains__, "tiny") == more


PRINT_MODULES = """
import sys
from snakemake.cli import main
try:
    main(sys.argv[1:])
finally:
    print("read:", *(name for name in sys.modules if name.split(".")[0] == "verification"))
"""


@pytest.mark.parametrize(("target", "is_read"), [("all", False), ("results/stability/points/size.json", True)])
def test_a_run_of_a_mine_imports_nothing_of_the_verification(tiny_file, tmp_path, target, is_read):
    """Its rules are read only if one of them is asked for."""
    line = command(tiny_file, tmp_path, "--dry-run", target)[3:]
    done = subprocess.run([sys.executable, "-c", PRINT_MODULES, *line], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    read = next(words for words in done.stdout.splitlines() if words.startswith("read:")).split()[1:]
    assert bool(read) == is_read, read
