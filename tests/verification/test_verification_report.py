"""The page of all studies, and the verdict that makes the target fail."""

import subprocess
import sys
from pathlib import Path

import pytest

from catalogs.figures import style
from pipeline.errors import InputError
from verification.report import write_report
from verification.rows import Row, read_rows, write_rows
from verification.studies import Study

ROOT = Path(__file__).parents[2]


def study(name: str) -> Study:
    return Study(name, name, f"The {name}", "About <it> & more.", False, 1, False, {}, {}, {})


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


def test_a_missing_figure_is_an_error_that_names_it(results):
    (results / "good" / "figure.svg").unlink()
    with pytest.raises(InputError, match=r"figure\.svg"):
        write_report([study("good")], results, results, results / "a.html", results / "a.csv")
