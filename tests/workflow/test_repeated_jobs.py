"""What a run says before it starts of the results that it replaces."""

import json

import pytest

from common.costs import Costs
from workflow.repeated_jobs import RepeatedJob, notice

SETTINGS = {"materials": {"host": {"cohesion": {"intact": 1e6}, "density": 2800.0}}, "solver": {"increments": 2}}


@pytest.fixture
def job(tmp_path):
    """A job whose output stands, with an earlier description and a log."""

    def made(rule="step", now=None, before=None, seconds=60.0, threads=2, number=1) -> RepeatedJob:
        folder = tmp_path / rule / str(number)
        folder.mkdir(parents=True)
        for name, values in (("old", before), ("new", now)):
            if values is not None:
                (folder / f"{name}.json").write_text(json.dumps(values))
        (folder / "out.nc").touch()
        line = Costs(seconds, seconds, 0.0, 100.0).closing_line(rule)
        (folder / "log").write_text(f"2026-01-01 INFO at work\n2026-01-01 INFO {line}\n")
        return RepeatedJob(rule, folder / "new.json", folder / "out.nc", folder / "log", threads)

    return made


def described(settings=SETTINGS, code="a", **files) -> dict:
    return {"settings": settings, "code": code, "files": files}


def changed(**values) -> dict:
    return SETTINGS | {"materials": {"host": SETTINGS["materials"]["host"] | values}}


def test_what_runs_again_with_its_time_and_the_key_that_changed(job):
    """Jobs of few threads take their share of the cores: 2 x 60 s, and 60 s on one of two cores."""
    again = [
        job(now=described(changed(cohesion={"intact": 2e6})), before=described()),
        job(number=2),
        job("companion", threads=1),
    ]
    assert notice(again, 2) == (
        "runs again, and replaces results: step (2), companion; about 2 min, by the times of the last run\n"
        "because of changes: materials.host.cohesion.intact"
    )


def test_a_first_run_says_nothing(job):
    first = job(now=described())
    first.output.unlink()
    assert notice([first], 2) == ""
    assert notice([], 2) == ""


def test_keys_of_the_mine_file_stand_for_those_of_stages(job):
    """The report's job holds the mine file as written; the others hold SI units."""
    old, new = ({"config": {"solver": {"tolerance": value}, "steps": []}, "insitu": {}} for value in (1e-3, "1e-4"))
    again = [
        job(now=described({"solver": {"tolerance": 1e-4}}), before=described({"solver": {"tolerance": 1e-3}})),
        job("report", now=described(new), before=described(old), seconds=3.0),
    ]
    assert notice(again, 2).endswith("because of changes: solver.tolerance")


@pytest.mark.parametrize(
    ("now", "before", "says"),
    [
        (described(code="b"), described(code="a"), "the program"),
        (described(**{"record.csv": "2"}), described(**{"record.csv": "1"}), "record.csv"),
        (described(changed(a=1, b=2, c=3, density=4)), described(), "materials.host.density, materials.host.a, mat"),
        (described(changed(a=1, b=2, c=3, density=4)), described(), " and 1 more"),
    ],
)
def test_other_reasons(job, now, before, says):
    assert says in notice([job(now=now, before=before)], 2).splitlines()[1]


@pytest.mark.parametrize("before", [None, [], {}, {"settings": 3, "code": "a"}, {"settings": {}}])
def test_a_description_that_tells_nothing_gives_no_traceback(job, before):
    again = job(now=described(), before=before)
    again.log.write_text("")
    assert notice([again], 2).startswith("runs again, and replaces results: step")
    assert "about" not in notice([again], 2)
