"""The frame of studies: cases to one table, what it was made from, and the verdict that makes a target fail."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
from running import run_study

from catalogs.figures import style
from common.costs import Costs
from common.errors import InputError
from verification import frame, made
from verification.frame import (
    MEASURING,
    MeasuringStudy,
    costs_of,
    give_verdict,
    load,
    measure_case,
    write_answer,
    write_summary,
    write_tables,
)
from verification.made import Made, is_older, oldest
from verification.results import Results
from verification.rows import KnownMiss, Row, judge, read_rows, write_texts
from verification.studies import Study

ROOT = Path(__file__).parents[2]
CAUSE = "The hole is square."
MADE = Made("abc1234", "2026-01-02T03:04:05+00:00", "2.0", "0.60")


def rows_of(obtained: float, quantity: str = "closure, m") -> list[Row]:
    return [Row.relative(quantity, 1.0, obtained, 0.1, "a < b"), Row("events", 1.0, 5.0, 4.0)]


def write(table: Path, rows: list[Row], known: dict[str, float] | None = None) -> Path:
    """A table as the rule `answer` writes it: verdicts with the known misses, by quantity and largest error."""
    misses = {quantity: KnownMiss(CAUSE, at_most) for quantity, at_most in (known or {}).items()}
    write_texts(table, judge([row.texts(table.parent.name) for row in rows], misses))
    MADE.write(table)
    return table


@pytest.fixture
def good(tmp_path) -> Path:
    return write(tmp_path / "good" / "table.csv", rows_of(1.0))


def verdict(table: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "verification", "verdict", "verification", "--table", str(table)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_the_summary_has_the_rows_of_all_studies_and_is_as_old_as_the_oldest(good, tmp_path):
    bad = write(tmp_path / "bad" / "table.csv", rows_of(3.0))
    first = Made("1234567", "2025-12-31T00:00:00+00:00", "1.9", "0.59")
    first.write(bad)
    summary = tmp_path / "table.csv"
    write_summary([str(good), str(bad)], summary)
    found = [(row["scene"], row["passed"]) for row in read_rows(summary)]
    assert found == [("good", "yes"), ("good", ""), ("bad", "no"), ("bad", "")]
    assert Made.read(summary) == first


def test_the_verdict_fails_with_one_line_that_names_the_row(good, tmp_path):
    bad = write(tmp_path / "bad" / "table.csv", rows_of(3.0))
    write_summary([str(good), str(bad)], tmp_path / "table.csv")
    run = verdict(tmp_path / "table.csv")
    assert run.returncode == 1
    assert f"1 of 4 rows fail (bad: closure, m); see {tmp_path / 'table.csv'}" in run.stderr.splitlines()[-1]
    run = verdict(good)
    assert run.returncode == 0
    assert f"verification: no row of 2 fails; see {good}" in run.stdout


def test_a_table_without_verdicts_is_reported_and_never_fails(tmp_path, capsys):
    table = tmp_path / "table.csv"
    table.write_text("scene,quantity,share\nstope,potency,0.5\n")
    give_verdict("catalog_spread", table)
    assert capsys.readouterr().out == f"catalog_spread: 1 rows; see {table}\n"


def test_a_known_miss_keeps_its_numbers_and_does_not_fail(tmp_path, capsys):
    table = write(tmp_path / "bad" / "table.csv", rows_of(3.0), {"closure, m": 2.1})
    row = read_rows(table)[0]
    assert (row["passed"], row["obtained"], row["error"], row["allowed"]) == ("known miss", "3", "2", "0.1")
    assert row["remark"] == f"Cause: {CAUSE} a < b"
    give_verdict("verification", table)
    assert "no row of 2 fails, beside 1 known miss; see" in capsys.readouterr().out


def test_a_failing_row_beside_a_known_miss_fails_by_itself(tmp_path):
    rows = [Row.relative("closure, m", 1.0, 3.0, 0.1), Row.relative("stress, Pa", 1.0, 3.0, 0.1)]
    table = write(tmp_path / "bad" / "table.csv", rows, {"closure, m": 2.1})
    with pytest.raises(InputError, match=r"^1 of 2 rows fail, beside 1 known miss \(bad: stress, Pa\); see"):
        give_verdict("verification", table)


def test_a_known_miss_that_grows_fails(tmp_path):
    table = write(tmp_path / "bad" / "table.csv", rows_of(3.0), {"closure, m": 1.9})
    row = read_rows(table)[0]
    assert row["passed"] == "no"
    assert row["remark"].startswith("Known to miss its bound by at most 1.9; this error is larger.")
    with pytest.raises(InputError, match="1 of 2 rows fail"):
        give_verdict("verification", table)


def test_a_known_miss_that_passes_now_is_told_and_does_not_fail(tmp_path):
    table = write(tmp_path / "good" / "table.csv", rows_of(1.0), {"closure, m": 1.9})
    run = verdict(table)
    assert run.returncode == 0
    told = "config/verification/good.yaml: 'closure, m' passes now; take it off known_misses"
    assert [line for line in run.stderr.splitlines() if told in line]


@pytest.fixture
def jaeger(tmp_path, monkeypatch):
    """A function that answers the study jaeger, with rows and known misses that are made up."""

    def answered(known: dict[str, float]) -> Path:
        figure = style.new_figure(4.0, 2.0)
        figure.add_subplot().plot([0, 1])
        misses = {quantity: KnownMiss(CAUSE, at_most) for quantity, at_most in known.items()}
        study = Study("jaeger", "jaeger", "Jaeger", 1, False, {}, {}, misses, {})
        monkeypatch.setattr(frame, "load_study", lambda path: study)
        monkeypatch.setattr("verification.answers.jaeger.answer", lambda results: (rows_of(3.0), figure))
        paths = [tmp_path / "results" / name for name in ("table.csv", "figure.svg", "costs.csv")]
        write_answer("jaeger", *paths)
        return paths[0]

    return answered


def test_an_answer_has_verdicts_figure_costs_and_what_it_was_made_from(jaeger):
    table = jaeger({"closure, m": 2.1})
    assert [row["passed"] for row in read_rows(table)] == ["known miss", ""]
    assert {path.name for path in table.parent.iterdir()} == {"table.csv", "figure.svg", "costs.csv", "made.json"}
    commit = subprocess.run(["git", "rev-parse", "--short=7", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    assert Made.read(table).commit.removesuffix("-dirty") == commit.stdout.strip()


@pytest.mark.parametrize(
    ("quantity", "message"), [("clossure, m", "'clossure, m' is not a row"), ("events", "'events' has no bound")]
)
def test_a_known_miss_that_explains_no_row_is_an_error(jaeger, quantity, message):
    with pytest.raises(InputError, match=f"config/verification/jaeger.yaml: known_misses: {message}"):
        jaeger({quantity: 9.0})


def test_costs_of_variants_are_those_of_grid_and_mechanics(tmp_path):
    results = run_study("jaeger", tmp_path, ["dip_40"])
    results["dip_40"].costs = lambda stage: Costs(2.0, 20.0, 5.0, 100.0 if stage == "elastic" else 50.0)
    (row,) = costs_of(results).to_dict("records")
    assert (row["variant"], row["steps"], row["memory_MiB"]) == ("dip_40", 2, 100.0)
    assert row["seconds"] == 8.0
    assert row["cells"] == results["dip_40"].grid.sizes["cell"]
    assert costs_of(Results(results.study, {})).empty


def test_cases_become_the_rows_of_one_table(tmp_path, monkeypatch):
    """In the order of the cases, with all figures, as old as the oldest case; NaN comes back."""

    def figures(results):
        return {"one": style.new_figure(2.0, 2.0), "two": style.new_figure(2.0, 2.0)}

    study = MeasuringStudy(
        lambda case, inputs, threads: {
            "case": case,
            "files": inputs["files"],
            "threads": threads,
            "error": float("nan"),
        },
        lambda results: {"table": pd.DataFrame(list(results.values())), "more": pd.DataFrame({"x": [1]})},
        figures,
        (),
        ("case",),
    )
    monkeypatch.setattr(frame, "load", lambda name: study)
    paths = [tmp_path / "cases" / f"{case}.json" for case in "ba"]
    for path in paths:
        measure_case("made_up", path.stem, {"files": ["x"]}, 3, path)
    text = json.loads(paths[1].read_text())
    text["made"] |= {"date": "2020-01-01T00:00:00+00:00", "commit": "old"}
    paths[1].write_text(json.dumps(text))
    write_tables("made_up", [str(path) for path in paths], tmp_path / "table.csv")
    table = pd.read_csv(tmp_path / "table.csv")
    assert table.case.to_list() == ["b", "a"]
    assert table.threads.to_list() == [3, 3]
    assert table.error.isna().all()
    assert (tmp_path / "more.csv").is_file()
    assert {path.name for path in tmp_path.glob("*.svg")} == {"one.svg", "two.svg"}
    assert Made.read(tmp_path / "table.csv").commit == "old"


@pytest.mark.parametrize("name", MEASURING)
def test_every_measuring_study_declares_its_tables(name):
    study = load(name)
    assert study.names
    assert {shown.file for shown in study.shown} <= {"table", *MEASURING[name].tables}  # outputs of its rule


def test_a_study_that_is_none_is_one_line():
    with pytest.raises(InputError, match="no measuring study 'kirsch'; there are tradeoff, "):
        load("kirsch")


def git(folder: Path, *words: str) -> str:
    names = ["-c", "user.name=n", "-c", "user.email=e@example.org"]
    return subprocess.run(["git", "-C", folder, *names, *words], capture_output=True, text=True, check=True).stdout


@pytest.fixture(autouse=True)
def no_pins_of_another_checkout() -> Iterator[None]:
    """Tests after this one read those of the project again."""
    yield
    made.pinned_mechanics.cache_clear()


@pytest.fixture
def checkout(tmp_path, monkeypatch) -> Path:
    """A checkout with one commit of pinned results, which takes the place of this one."""
    monkeypatch.setattr(made, "ROOT", tmp_path)
    made.pinned_mechanics.cache_clear()
    git(tmp_path, "init", "-q")
    (tmp_path / made.PINS).mkdir(parents=True)
    (tmp_path / "catalogs").mkdir()
    for name in made.GOLDEN:
        write_pins(tmp_path / name, "one", "one")
    (tmp_path / "catalogs/law.py").write_text("one\n")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "one")
    return tmp_path


def write_pins(golden: Path, state: str, page: str) -> None:
    """A golden file with one variable of a state, and one line of a page."""
    pins = {"tiny/steps/2019-08.nc": {"stress": ["float64 (particle 5)", state, 5, 0, 1, 2]}}
    golden.write_text(json.dumps({"processor": {}, "files": pins | {"tiny/report.html": {"Steps": [page]}}}))


def commit_all(checkout: Path) -> str:
    """Commit what has changed. Returns the commit."""
    git(checkout, "commit", "-q", "-a", "-m", "more")
    made.pinned_mechanics.cache_clear()
    return Made.now().commit


def test_results_are_older_once_a_pinned_result_of_the_mechanics_has_changed(checkout):
    """Not where another file has, or a pinned page; a commit that is not known counts as older, and what was not
    committed does."""
    golden, first = checkout / made.GOLDEN[1], Made.now().commit
    assert not is_older(first)
    write_pins(golden, "one", "two")
    (checkout / "catalogs/law.py").write_text("two\n")
    assert Made.now().commit == f"{first}-dirty"
    commit_all(checkout)
    assert not is_older(first)
    assert is_older(first, ("catalogs",))  # which an answer without scenes names
    assert is_older(first, (*made.NUMERICS, "catalogs"))
    write_pins(golden, "two", "two")
    dirty = Made.now().commit
    last = commit_all(checkout)
    assert is_older(first)
    assert is_older(dirty)
    assert not is_older(dirty, ("catalogs",))
    assert not is_older(last)
    text = json.loads(golden.read_text())
    text["files"]["laws/steps/2019-08.nc"] = text["files"]["tiny/steps/2019-08.nc"]
    golden.write_text(json.dumps(text))
    commit_all(checkout)
    assert not is_older(last)  # Pinned later only.
    del text["files"]["tiny/steps/2019-08.nc"]
    golden.write_text(json.dumps(text))
    commit_all(checkout)
    assert is_older(last)
    assert is_older("0123456")
    assert oldest([MADE, Made("x", "2026-01-01T00:00:00+00:00", "", "")]).commit == "x"


def test_outside_of_a_checkout_no_commit_is_known(tmp_path, monkeypatch):
    monkeypatch.setattr(made, "ROOT", tmp_path)
    made.pinned_mechanics.cache_clear()
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert Made.now().commit == "unknown"
    assert is_older("unknown")
    with pytest.raises(InputError, match=r"table\.csv: has no made\.json beside it"):
        Made.read(tmp_path / "table.csv")
