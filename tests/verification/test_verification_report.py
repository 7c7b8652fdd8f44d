"""The page of all studies, and the verdict that makes the target fail."""

import subprocess
import sys
from pathlib import Path

import pytest

from catalogs.figures import style
from common.errors import InputError
from verification.known_misses import KnownMiss
from verification.report import write_report
from verification.rows import Row, read_rows, write_rows
from verification.studies import Study

ROOT = Path(__file__).parents[2]


CAUSE = "The hole is square."


def study(name: str, known: dict[str, float] | None = None) -> Study:
    """A study with these known misses: quantity and largest error."""
    misses = {quantity: KnownMiss(CAUSE, at_most) for quantity, at_most in (known or {}).items()}
    return Study(name, name, f"The {name}", "About <it> & more.", False, 1, False, {}, {}, misses, {})


@pytest.fixture
def results(tmp_path) -> Path:
    for name, obtained in (("good", 1.0), ("bad", 3.0)):
        rows = [Row.relative("closure, m", 1.0, obtained, 0.1, "a < b"), Row("events", 1.0, 5.0, 4.0)]
        write_rows(tmp_path / name / "rows.csv", [(name, row) for row in rows])
        with style.applied():
            figure = style.new_figure(4.0, 2.0)
            figure.add_subplot().plot([0, 1])
            style.save(figure, tmp_path / name / "figure.svg")
    return tmp_path


def verdict(summary: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "verification", "verdict", "--summary", str(summary), "--page", "report.html"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_the_page_shows_every_row_and_what_fails(results):
    page, summary = results / "report.html", results / "summary.csv"
    write_report([study("good"), study("bad")], results, results, page, summary)
    assert [(row["scene"], row["passed"]) for row in read_rows(summary)] == [
        ("good", "yes"),
        ("good", ""),
        ("bad", "no"),
        ("bad", ""),
    ]
    text = page.read_text()
    assert "1 of 4 rows fail." in text
    assert "About &lt;it&gt; &amp; more." in text
    assert text.count("data:image/svg+xml;base64,") == 2
    assert "http" not in text.split("</style>")[1]  # complete in itself


def test_the_verdict_fails_with_one_line_that_names_the_row(results):
    write_report([study("good"), study("bad")], results, results, results / "all.html", results / "all.csv")
    run = verdict(results / "all.csv")
    assert run.returncode == 1
    assert "1 of 4 rows fail (bad: closure, m); see report.html" in run.stderr.splitlines()[-1]
    write_report([study("good")], results, results, results / "good.html", results / "good.csv")
    assert verdict(results / "good.csv").returncode == 0


def test_a_known_miss_is_shown_with_its_figures_and_does_not_fail(results):
    page, summary = results / "report.html", results / "summary.csv"
    write_report([study("good"), study("bad", {"closure, m": 2.1})], results, results, page, summary)
    row = read_rows(summary)[2]
    assert (row["passed"], row["obtained"], row["error"], row["allowed"]) == ("known miss", "3", "2", "0.1")
    assert row["remark"].startswith(f"Cause: {CAUSE}")
    text = page.read_text()
    assert "None of 4 rows fails but those that are known to." in text
    assert "1 known miss." in text
    assert "Known misses</h2>" in text
    assert '<a href="#bad">bad</a>: The hole is square.' in text
    figures = "<td>1</td><td>3</td><td>2</td><td>0.1</td>"
    assert text.count(f'<td class="text">closure, m</td>{figures}') == 2  # there, and in the table of its study
    assert '<td class="passed">1</td>' in text  # of the study "good"
    assert '<td class="passed">0</td><td class="reported">0</td><td class="known">1</td>' in text  # "bad" passes none
    assert verdict(summary).returncode == 0


def test_a_failing_row_beside_a_known_miss_fails_by_itself(results):
    rows = [Row.relative("closure, m", 1.0, 3.0, 0.1), Row.relative("stress, Pa", 1.0, 3.0, 0.1)]
    write_rows(results / "bad" / "rows.csv", [("bad", row) for row in rows])
    write_report([study("bad", {"closure, m": 2.1})], results, results, results / "a.html", results / "a.csv")
    run = verdict(results / "a.csv")
    assert run.returncode == 1
    assert "1 of 2 rows fail, beside 1 known miss (bad: stress, Pa); see" in run.stderr.splitlines()[-1]


def test_a_known_miss_that_grows_fails(results):
    write_report([study("bad", {"closure, m": 1.9})], results, results, results / "a.html", results / "a.csv")
    assert read_rows(results / "a.csv")[0]["passed"] == "no"
    assert "Known to miss its bound by at most 1.9; this error is larger." in (results / "a.html").read_text()
    assert verdict(results / "a.csv").returncode == 1


def test_a_known_miss_that_passes_now_is_told_and_does_not_fail(results):
    write_report([study("good", {"closure, m": 1.9})], results, results, results / "a.html", results / "a.csv")
    assert "Known misses that pass now" in (results / "a.html").read_text()
    run = verdict(results / "a.csv")
    assert run.returncode == 0
    told = "config/verification/good.yaml: 'closure, m' passes now; take it off known_misses"
    assert [line for line in run.stderr.splitlines() if told in line]


@pytest.mark.parametrize(
    ("quantity", "message"), [("clossure, m", "'clossure, m' is not a row"), ("events", "'events' has no bound")]
)
def test_a_known_miss_that_explains_no_row_is_an_error(results, quantity, message):
    with pytest.raises(InputError, match=f"config/verification/bad.yaml: known_misses: {message}"):
        write_report([study("bad", {quantity: 9.0})], results, results, results / "a.html", results / "a.csv")


def test_a_missing_figure_is_an_error_that_names_it(results):
    (results / "good" / "figure.svg").unlink()
    with pytest.raises(InputError, match=r"figure\.svg"):
        write_report([study("good")], results, results, results / "a.html", results / "a.csv")
