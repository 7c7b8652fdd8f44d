"""Mining plans: the mine of each, what it shares with the mine file's plan, and what is refused."""

import pytest
import yaml
from tiny_mines import DEFAULT, FLAT, NEXT_STEP, TINY, box, changed, merged, write_mine

from common.costs import Costs
from common.errors import InputError
from workflow.configuration import load
from workflow.folders import Folders
from workflow.mining_plans import MiningPlans
from workflow.plan_outcomes import PlanOutcomes
from workflow.result_files import ResultFiles

SWAPPED = {"excavations": {"stope_1": {"step": "2019-09"}, "stope_2": {"step": "2019-08"}}, "steps": [NEXT_STEP]}
LONGER = {"excavations": {"stope_2": {"step": "2019-09"}}, "steps": [NEXT_STEP]}


@pytest.fixture
def folders(tmp_path):
    """Folders of a mine that is the tiny one with these plans and other values."""

    def made(plans: dict, **values) -> Folders:
        file = write_mine(changed(TINY, plans=plans, **values), tmp_path / "mine.yaml")
        default = yaml.safe_load(DEFAULT.read_text())
        mine = load(merged(yaml.safe_load(file.read_text())), file, default)
        return Folders(mine, MiningPlans(mine, file))

    return made


def homes(folders: Folders, place: str) -> dict[str, str]:
    """Where each stage of a plan's folder has its result."""
    steps = folders.mine_at(place).mined_steps
    stages = ["grid", "elastic", *(f"{kind}/{step}" for step in steps for kind in ("steps", "events"))]
    return {stage: folders.home(place, stage) for stage in stages}


def own(found: dict[str, str], place: str) -> list[str]:
    """Stages that a folder has itself."""
    return [stage for stage, home in found.items() if home == place]


def test_a_plan_is_the_mine_with_its_changes(folders):
    """Excavations by name, steps of the same name replaced, others at the end; nothing else differs."""
    shorter = {"name": "2019-08", "start": "2019-08-01", "end": "2019-08-16"}
    found = folders({"longer": LONGER | {"steps": [shorter, NEXT_STEP]}})
    mine, plan = found.mine, found.mine_at("tiny/plans/longer")
    assert [(step.name, step.end) for step in plan.listed_steps] == [
        ("history", None),
        ("2019-08", "2019-08-16"),
        ("2019-09", "2019-10-01"),
    ]
    assert {entry.name: entry.step for entry in plan.excavations} == {
        "drive": "history",
        "stope_1": "2019-08",
        "stope_2": "2019-09",
    }
    assert plan.name == mine.name
    assert plan.grid_slice() == mine.grid_slice()
    assert [step.name for step in mine.listed_steps] == ["history", "2019-08"]  # the mine's own is as it was


def test_a_plan_computes_only_what_differs(folders):
    """A step more: that step alone. The other order: all steps after history."""
    found = folders({"longer": LONGER, "swapped": SWAPPED})
    place = "tiny/plans/longer"
    assert own(homes(found, place), place) == ["steps/2019-09", "events/2019-09"]
    place = "tiny/plans/swapped"
    assert own(homes(found, place), place) == ["steps/2019-08", "events/2019-08", "steps/2019-09", "events/2019-09"]


def test_a_plan_computes_nothing_that_an_earlier_plan_has(folders):
    """Two plans that begin with the other order: the second has the first one's steps, and goes on. The order in the
    mine file decides; a member has those of the member of its number."""
    further = {"name": "2019-10", "start": "2019-10-01", "end": "2019-11-01"}
    plans = {
        "swapped": SWAPPED,
        "swapped_longer": {
            "excavations": SWAPPED["excavations"] | {"drive_2": {"step": "2019-10"}},
            "steps": [NEXT_STEP, further],
        },
    }
    drive_2 = box("drive_2", "planned", [50, 50, 60], [58, 58, 64])
    found = folders(plans, excavations=[*TINY["excavations"], drive_2], ensemble=1)
    for run in ("", "/ensemble/1"):
        place = f"tiny/plans/swapped_longer{run}"
        assert own(homes(found, place), place) == ["steps/2019-10", "events/2019-10"]
        assert found.home(place, "steps/2019-08") == f"tiny/plans/swapped{run}"
        assert found.home(place, "steps/history") == f"tiny{run}"


def test_other_dates_change_events_alone(folders):
    """Rock knows no dates: steps are shared, events are not."""
    later = {"name": "2019-08", "start": "2019-08-10", "end": "2019-09-01"}
    found = folders({"later": {"steps": [later]}})
    place = "tiny/plans/later"
    assert own(homes(found, place), place) == ["events/2019-08"]


def test_a_step_between_ends_what_is_shared(folders):
    """A step that mines something else before: a later step of the same name and excavations is another one."""
    found = folders({"other": {"excavations": {"stope_2": {"step": "history"}}}})
    place = "tiny/plans/other"
    assert own(homes(found, place), place)[0] == "grid"  # cells of what the first step mines are split at once
    shared = [stage for stage, home in homes(found, place).items() if home == "tiny"]
    assert shared == []


def test_runs_of_a_plan_share_with_the_same_run_of_the_mine(folders):
    """A member with the member of its number, as far as the mine has it; the companion with the companion."""
    found = folders({"longer": LONGER}, ensemble=2, hazard={"runs": 1})
    last = ["steps/2019-09", "events/2019-09"]
    for run in ("ensemble/2", "coarse"):
        place = f"tiny/plans/longer/{run}"
        assert own(homes(found, place), place) == last
        assert found.home(place, "steps/2019-08") == f"tiny/{run}"
    assert found.home("tiny/plans/longer/ensemble/2", "elastic") == "tiny"
    assert found.home("tiny/plans/longer/ensemble/3", "steps/history") == "tiny/plans/longer/ensemble/3"


def test_a_plan_may_be_another_file(folders, tmp_path):
    """Its name and its plans do not count, its paths are relative to it; alike it shares all."""
    other = changed(TINY, name="elsewhere", plans={"of_its_own": LONGER})
    write_mine(other, tmp_path / "deeper" / "other.yaml")
    found = folders({"file": {"file": "deeper/other.yaml"}})
    plan = found.mine_at("tiny/plans/file")
    assert plan.name == "tiny"
    assert plan.path("record.csv").resolve() == (tmp_path / "deeper/record.csv").resolve()
    assert set(homes(found, "tiny/plans/file").values()) == {"tiny"}


@pytest.mark.parametrize("kind", ["changes", "file"])
def test_what_no_plan_uses_refuses_none(folders, tmp_path, kind):
    """A face, a filter of the record, readings and a forecast that fit the dates of the mine file, not those of the
    plan."""
    (tmp_path / "gap.csv").write_text("date,value\n2019-08-20,470\n2019-08-30,510\n")
    gap = {"name": "gap", "start": ["25 m", "35 m", "40 m"], "end": ["25 m", "35 m", "50 m"], "file": "gap.csv"}
    observations = {"closures": [gap | {"units": "mm", "error": "2 mm"}]}
    later = {"name": "2019-08", "start": "2020-08-01", "end": "2020-09-01"}
    positions = [
        {"date": "2019-07-01", "ends": [["10 m", "30 m"], ["10 m", "70 m"]]},
        {"date": "2019-10-01", "ends": [["60 m", "30 m"], ["60 m", "70 m"]]},
    ]
    plan = {"steps": [later]}
    if kind == "file":
        other = changed(TINY, face={"positions": positions}, steps=[{"name": "history"}, later])
        write_mine(changed(other, **{"record.file": "missing.csv"}), tmp_path / "deeper/other.yaml")
        plan = {"file": "deeper/other.yaml"}
    found = folders({"p": plan}, face={"positions": positions}, observations=observations)
    assert found.mine.settings.face
    assert found.mine.settings.observations
    assert found.mine_at("tiny/plans/p").settings.face is None
    assert found.mine_at("tiny/plans/p").listed_steps[1].start == "2020-08-01"


def outcomes(folders: Folders, tmp_path) -> PlanOutcomes:
    return PlanOutcomes(ResultFiles(folders), tmp_path / "mine.yaml")


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"steps": [{"name": "history"}], "excavations": TINY["excavations"][:1]}, "steps: none has dates"),
        ({"grid.levels": 1}, "grid.levels: 1; the mine file has runs on cells of twice the size"),
    ],
)
def test_a_file_that_can_be_no_plan_is_refused_before_the_mechanics(folders, tmp_path, values, line):
    write_mine(changed(TINY, **values), tmp_path / "other.yaml")
    found = outcomes(folders({"other": {"file": "other.yaml"}}, grid_convergence=True), tmp_path)
    with pytest.raises(SystemExit, match=rf"mine.yaml: plans.other.file: other.yaml: {line}") as ended:
        assert found.checked_names
    assert len(str(ended.value).splitlines()) == 1


def test_a_flat_file_is_no_plan(folders, tmp_path):
    write_mine(FLAT, tmp_path / "other.yaml")
    found = outcomes(folders({"other": {"file": "other.yaml"}}), tmp_path)
    with pytest.raises(SystemExit, match=r"plans\.other\.file: other.yaml: plane: xz; plans need a mine in three dim"):
        assert found.checked_names


def test_sections_in_which_a_file_differs_are_named(folders, tmp_path):
    """Not those of its sequence, nor one that is written in other units."""
    same = changed(TINY, excavations=[{**one, "step": "history"} for one in TINY["excavations"]])
    write_mine(same, tmp_path / "same.yaml")
    write_mine(changed(same, **{"solver.tolerance": 0.02, "seismic.closeness": 0.5}), tmp_path / "other.yaml")
    plans = {"same": {"file": "same.yaml"}, "other": {"file": "other.yaml"}, "longer": LONGER}
    found = outcomes(folders(plans), tmp_path)
    assert {name: found.differs_in(name) for name in plans} == {
        "same": [],
        "other": ["solver", "seismic"],
        "longer": [],
    }
    assert found.outcome_slice("other")["differs_in"] == ["solver", "seismic"]


def test_an_outcome_knows_the_runs_of_the_other_plans(folders, tmp_path):
    """All of them, each once for each plan: files that plans share are told by their paths. They are inputs of the
    outcome."""
    found = outcomes(folders({"longer": LONGER}, grid_convergence=True, hazard={"runs": 1}), tmp_path)
    compared = found.outcome_slice("mine_file")["compared_runs"]
    assert [(run["kind"], run["events"]) for run in compared] == [
        ("own", ["results/tiny/events/2019-08.nc", "results/tiny/plans/longer/events/2019-09.nc"]),
        (
            "coarse",
            [
                f"results/tiny/{of}coarse/events/{step}.nc"
                for of, step in (("", "2019-08"), ("plans/longer/", "2019-09"))
            ],
        ),
    ]
    folders = {path.rpartition("/")[0] for run in compared for path in run["events"]}
    assert folders <= set(found.results("mine_file"))
    assert [len(run["events"]) for run in found.outcome_slice("longer")["compared_runs"]] == [1, 1]


@pytest.mark.parametrize(("values", "runs"), [({}, 5), ({"ensemble": 7}, 8), ({"hazard": {"runs": 2}}, 2)])
def test_plans_have_the_runs_that_a_verdict_needs(folders, tmp_path, values, runs):
    """Five without a word of it; a larger ensemble counts. Members of a plan share what the mine's members have."""
    found = outcomes(folders({"longer": LONGER}, **values), tmp_path)
    for plan, place in (("mine_file", "tiny"), ("longer", "tiny/plans/longer")):
        kinds = [kind for kind, _ in found.runs(plan) if kind in ("own", "member")]
        assert kinds == ["own", *["member"] * (runs - 1)]
        assert found.runs(plan)[runs - 1][1] == f"{place}/ensemble/{runs - 1}"
    home = found.folders.home(f"tiny/plans/longer/ensemble/{runs - 1}", "steps/2019-08")
    assert home == f"tiny/ensemble/{runs - 1}"


def test_the_cost_of_plans_is_told_before_they_run(folders, tmp_path, monkeypatch, capsys):
    """Five runs of the mine with two steps each, and of the plan one step more; a step took two minutes."""
    monkeypatch.chdir(tmp_path)
    found = outcomes(folders({"longer": LONGER}, grid_convergence=False), tmp_path)
    found.outcomes()
    said = capsys.readouterr().err
    assert said.startswith("tiny: plans: 2 plans with 5 runs each (hazard.runs, ensemble) need ")
    assert said.endswith("15 more steps (time not known yet)\n")
    found.outcomes()
    assert capsys.readouterr().err == ""
    for path in ("results/tiny/steps/2019-08.nc", "results/tiny/steps/history.nc", "logs/tiny/steps/2019-08.log"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(f"{Costs(120.0, 200.0, 0.0, 900.0).closing_line('step')}\n")
    found.tell_cost()
    assert "13 more steps (about 26 min)" in capsys.readouterr().err


def test_the_cost_of_coarse_runs_is_that_of_the_own_one(folders, tmp_path, monkeypatch, capsys):
    """All steps are made; two runs on cells of twice the size are missing, of which one took ten minutes."""
    monkeypatch.chdir(tmp_path)
    found = outcomes(folders({"longer": LONGER}, grid_convergence=True, hazard={"runs": 1}), tmp_path)
    for folder in [folder for plan in found.checked_names for kind, folder in found.runs(plan) if kind != "coarse"]:
        steps = [f"steps/{step}" for step in found.folders.mine_at(folder).mined_steps]
        for path in [tmp_path / found.files.result(folder, one) for one in ("grid", "elastic", *steps)]:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
    (tmp_path / "logs/tiny").mkdir(parents=True)
    (tmp_path / "logs/tiny/coarse.log").write_text(f"{Costs(600.0, 900.0, 0.0, 900.0).closing_line('companion')}\n")
    found.tell_cost()
    assert capsys.readouterr().err.endswith(" need 2 more runs on cells of twice the size (about 20 min)\n")


@pytest.mark.parametrize(
    ("plans", "line"),
    [
        ({"a": {}}, "plans.a: changes nothing; give excavations, steps, or the file of another mine file"),
        (
            {"a": {"excavations": {"stope_3": {"step": "2019-08"}}}},
            "plans.a.excavations.stope_3: no excavation of the mine file; did you mean stope_2?",
        ),
        (
            {"mine_file": LONGER},
            "plans.mine_file: this is what the plan of the mine file itself is called; choose another name",
        ),
        (
            {"a": LONGER, "A": LONGER},
            "plans.A: differs from another plan in capitals alone, which are the same folder on some disks",
        ),
        ({"a": {"file": "none.yaml"}}, "no such file"),
        ({"a": {"file": "b.yaml", "steps": [NEXT_STEP]}}, "plans.a.file: stands beside changes"),
        ({"a": {"excavations": {"stope_1": {"stepp": "2019-08"}}}}, "did you mean step?"),
    ],
)
def test_a_wrong_plan_is_refused_with_the_mine(folders, plans, line):
    with pytest.raises(InputError) as refused:
        folders(plans)
    assert line in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("plan", "line"),
    [
        (
            {"excavations": {"stope_1": {"step": "2019-10"}}},
            "plans.a: .*excavations.stope_1.step: '2019-10' is not one",
        ),
        ({"excavations": {"stope_1": {"fill": "host"}}}, "plans.a: .*excavations.stope_1.fill: .*only elastic fill"),
        ({"steps": [{"name": "2019-09"}]}, "plans.a: .*steps.2019-09: an undated step is history"),
    ],
)
def test_a_plan_that_is_no_mine_ends_the_run_when_it_is_asked_for(folders, plan, line):
    """In one line that names it."""
    found = folders({"a": plan})
    with pytest.raises(SystemExit, match=line) as ended:
        found.mine_at("tiny/plans/a")
    assert len(str(ended.value).splitlines()) == 1


def test_drawn_rock_needs_a_calibration(folders):
    found = folders({"longer": LONGER})
    with pytest.raises(SystemExit, match="run `snakemake calibrate` first"):
        found.mine_at("tiny/plans/longer/drawn_rock/1")


def test_an_excavation_has_not_the_name_of_all_of_them(folders):
    entries = [*TINY["excavations"], TINY["excavations"][-1] | {"name": "any", "step": "planned"}]
    with pytest.raises(InputError, match=r"excavations\.any: 'any' means all openings in results"):
        folders({}, excavations=entries)


def test_an_excavation_that_is_made_needs_a_file_of_its_own(folders, monkeypatch):
    """It stands in no list that a plan could change."""
    made = [TINY["excavations"][-1] | {"name": "lv_1"}]
    monkeypatch.setattr("workflow.mines.elk_creek.schedule", lambda *_, **options: (TINY["steps"], made))
    source = {"source": "elk_creek", "folder": ".", "start": "2019-08-01", "end": "2019-09-01"}
    values = {"excavations": TINY["excavations"][:-1], "excavations_from": source, "steps": []}
    with pytest.raises(InputError) as refused:
        folders({"a": {"excavations": {"lv_1": {"step": "2019-08"}}}}, **values)
    line = "plans.a.excavations.lv_1: comes from excavations_from, which a plan cannot change; give plans.a.file"
    assert line in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_names_of_likelihoods_change_the_page_alone(folders, tmp_path):
    slices = []
    for name in ("rare", "seldom"):
        hazard = {"distances": ["5 m"], "magnitudes": {"felt": 0.5}, "likelihoods": {name: 0, "likely": 0.5}}
        found = outcomes(folders({"longer": LONGER}, hazard=hazard), tmp_path)
        slices.append((found.outcome_slice("longer"), found.report_slice()))
    assert slices[0][0] == slices[1][0]
    assert slices[0][1] != slices[1][1]
    assert slices[0][0]["hazard"]["magnitudes"] == {"felt": 0.5}
