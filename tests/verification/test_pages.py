"""Pages of the studies: their blocks, what is written into them, and one line for each mistake."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

from catalogs.figures import style
from common.errors import InputError
from verification.benchmarks.study import COLUMNS
from verification.frame import load
from verification.made import Made, is_older
from verification.page_tables import Columns, Counts, Cross, Pivot, rows_table, with_interval
from verification.pages import (
    BLOCK,
    FIGURE_WIDTHS,
    INDEX,
    MAX_FIGURE_BYTES,
    OLDER,
    PAGES,
    POINTS_OF,
    ROOT,
    check_blocks,
    draw,
    older_pages,
    rewrite,
    studies,
)
from verification.rows import Row, judge, parse_known_misses, read_rows, write_texts
from verification.stability.points import Point

MADE = replace(Made.now(), date="2026-01-02T03:04:05+00:00")
WRITTEN = sorted(PAGES.glob("*.md"))
MISSED = "filled, 4 cells across, mean, unturned: spread of potency over placements"  # a known miss of the study walls


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def block_of(name: str, pages: Path) -> str:
    """What stands between the markers of a study."""
    (found,) = (match[3] for page in pages.glob("*.md") for match in BLOCK.finditer(text_of(page)) if match[2] == name)
    return found


def test_every_study_has_one_block_and_every_block_a_study():
    check_blocks({page: text_of(page) for page in WRITTEN})
    named = [match[2] for page in WRITTEN for match in BLOCK.finditer(text_of(page))]
    assert sorted(named) == sorted([INDEX, *studies()])
    files = {path.stem for path in (ROOT / "config" / "verification").glob("*.yaml")}
    assert {name for name in files - set(named) if not name.startswith(POINTS_OF)} == set()


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_a_page_is_well_formed(page):
    text = text_of(page)
    assert len(re.findall(r"^# ", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)) == 1
    pictures = re.findall(r"!\[(.*?)\]\((.+?)\)", text)
    assert all(alternative for alternative, _ in pictures)
    assert all(0 < (PAGES / file).stat().st_size < MAX_FIGURE_BYTES for _, file in pictures)
    for _, _, body, _ in BLOCK.findall(text):
        tables = [line for line in body.splitlines() if line.startswith("|")]
        assert tables or "makes them." in body
        for table in re.findall(r"(?:^\|.*\n)+", body, re.MULTILINE):
            assert len({line.replace(r"\|", "").count("|") for line in table.splitlines()}) == 1
    for file in re.findall(r"\]\((\.\./[^)#]+)", text):
        assert (PAGES / file).exists(), file


def is_part_of(excerpt, whole) -> bool:
    """Whether a value of YAML is another one from which keys of sections and entries of lists were left out."""
    if isinstance(excerpt, dict) and isinstance(whole, dict):
        return all(key in whole and is_part_of(value, whole[key]) for key, value in excerpt.items())
    if isinstance(excerpt, list) and isinstance(whole, list):
        left = iter(whole)
        return all(any(is_part_of(entry, other) for other in left) for entry in excerpt)
    return excerpt == whole


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_an_excerpt_of_an_input_is_in_its_file(page):
    """An excerpt is YAML by itself, and its keys stand in the sections in which they stand in the file."""
    text = text_of(page)
    files = [yaml.safe_load(text_of(PAGES / file)) for file in re.findall(r"\((\.\./\.\./config/[^)]+\.yaml)\)", text)]
    for excerpt in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL):
        assert any(is_part_of(yaml.safe_load(excerpt), file) for file in files)


def test_no_figure_is_left_over():
    shown = {file for page in WRITTEN for file in re.findall(r"\]\((figures/[^)]+)\)", text_of(page))}
    assert {f"figures/{file.name}" for file in (PAGES / "figures").iterdir()} == shown


@pytest.fixture
def results(tmp_path) -> Path:
    """Results of two studies, made at the commit that is checked out."""
    for name, rows in (
        ("jaeger", [Row.relative("dip_00: strength, MPa", 60.0, 60.1, 0.005), Row("events", 1.0, 5.0, 4.0)]),
        ("walls", walls(2.4)),
    ):
        table = tmp_path / "results" / "verification" / name / "table.csv"
        write_texts(table, [row.texts(name) for row in rows])
        MADE.write(table)
        with style.applied():
            figure = style.new_figure(4.0, 2.0)
            figure.add_subplot().plot([0, 1])
            style.save(figure, table.parent / "figure.svg")
    return tmp_path / "results"


def walls(obtained: float) -> list[Row]:
    """A row for each known miss of the study walls."""
    return [Row.relative(row, 2.0, obtained, 0.04) for row in known_misses("walls")]


def known_misses(study: str) -> dict:
    text = yaml.safe_load(text_of(ROOT / "config" / "verification" / f"{study}.yaml"))
    return parse_known_misses(text["known_misses"])


@pytest.fixture
def pages(tmp_path) -> Path:
    """A copy of the pages, with empty blocks."""
    folder = tmp_path / "pages"
    folder.mkdir()
    for page in WRITTEN:
        (folder / page.name).write_text(BLOCK.sub(r"\1\4", text_of(page)))
    return folder


def test_a_block_has_rows_counts_date_commit_and_figure(results, pages):
    assert rewrite(results, pages) == ["jaeger", "walls"]
    block = block_of("jaeger", pages)
    versions = f"numpy {MADE.numpy} and numba {MADE.numba}"
    assert block.startswith(f"Made on 2026-01-02 at commit `{MADE.commit}` with {versions}. 2 rows, 1 judged")
    assert "2 rows, 1 judged: 1 passes, 0 known misses, 0 fail." in block
    assert "| strength, MPa | dip_00 | 60.1 | 60 | 0.0017 | 0.005 | passes |" in block
    assert "| events |  | 5 | 1 | 4 |  | reported |" in block
    assert (pages / "figures" / "jaeger.png").read_bytes().startswith(b"\x89PNG")
    assert "No results are kept here yet." in block_of("kirsch", pages)
    overview = block_of(INDEX, pages)
    assert re.search(
        r"^\| \[Specimens with weak planes\]\(jaeger\.md\) \|.*\| 1 \| 1 \| 0 \| 0 \|$", overview, re.MULTILINE
    )
    assert re.search(r"^\| \[Kirsch's hole\]\(kirsch\.md\) \|.*\| no results \|  \|  \|  \|$", overview, re.MULTILINE)


def test_a_figure_keeps_the_colours_of_its_lines_apart(tmp_path):
    with style.applied():
        figure = style.new_figure(6.0, 4.0)
        axes = figure.add_subplot()
        axes.imshow(np.linspace(0, 1, 400).reshape(20, 20), cmap="viridis")  # many colours over most of the figure
        for colour, place in ((style.MODELLED, 5), (style.BOTH, 15)):
            axes.axvline(place, color=colour, linewidth=1.5)
        style.save(figure, tmp_path / "figure.svg")
    draw(tmp_path / "figure.svg", tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as picture:
        assert picture.width == FIGURE_WIDTHS[0]
        found = np.array([colour for _, colour in picture.convert("RGB").getcolors()])
    for colour in (style.MODELLED, style.BOTH):
        expected = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
        assert np.abs(found - expected).max(axis=1).min() <= 8
    assert (tmp_path / "figure.png").stat().st_size < MAX_FIGURE_BYTES


def test_a_known_miss_is_marked_and_explained(results, pages):
    rewrite(results, pages)
    block = block_of("walls", pages)
    assert (
        f"| spread of potency over placements | {MISSED.partition(': ')[0]} | 2.4 | 2 | 0.2 | 0.04 | **fails** |"
        in block
    )
    judged = judge([row.texts("walls") for row in walls(2.09)], known_misses("walls"))
    write_texts(results / "verification" / "walls" / "table.csv", judged)
    rewrite(results, pages)
    block = block_of("walls", pages)
    row = f"| spread of potency over placements | {MISSED.partition(': ')[0]} |"
    assert f"{row} 2.09 | 2 | 0.045 | 0.04 | **known miss** |" in block
    assert "Causes of the known misses:" in block


def test_writing_twice_changes_nothing_and_a_changed_row_its_block_alone(results, pages):
    rewrite(results, pages)
    once = {file: file.read_bytes() for file in pages.rglob("*.*")}
    rewrite(results, pages)
    assert {file: file.read_bytes() for file in pages.rglob("*.*")} == once
    table = results / "verification" / "jaeger" / "table.csv"
    table.write_text(table.read_text().replace("60.1", "60.2"))
    rewrite(results, pages)
    assert [file.name for file, content in once.items() if file.read_bytes() != content] == ["jaeger.md"]
    assert "| 60.2 |" in block_of("jaeger", pages)


def test_studies_without_results_keep_their_block(results, pages):
    rewrite(results, pages)
    kept = block_of("jaeger", pages)
    (results / "verification" / "jaeger" / "table.csv").unlink()
    assert rewrite(results, pages) == ["walls"]
    assert block_of("jaeger", pages) == kept


def test_a_mistake_is_one_line(results, pages, tmp_path):
    def fails(message: str, folder: Path = results) -> None:
        with pytest.raises(InputError, match=message) as error:
            rewrite(folder, pages)
        assert "\n" not in str(error.value)

    fails("none: no such folder", tmp_path / "none")
    (tmp_path / "empty").mkdir()
    fails(r"holds neither verification/<study>/table\.csv nor", tmp_path / "empty")
    rows = results / "verification" / "jaeger" / "table.csv"
    unknown = results / "verification" / "jager" / "table.csv"
    unknown.parent.mkdir()
    rows.rename(unknown)
    fails("has no study 'jager'")
    unknown.rename(rows)
    page = pages / "jaeger.md"
    text = text_of(page)
    page.write_text(text.replace("<!-- end of results -->", ""))
    fails(r"jaeger\.md: needs '<!-- results: STUDY -->'")
    page.write_text(text.replace("results: jaeger", "results: jager"))
    fails(r"jaeger\.md: 'jager' is not a study")
    page.write_text(text.replace("results: jaeger", "results: kirsch"))
    fails("the results of 'kirsch' stand in")
    page.unlink()
    fails("no page has '<!-- results: jaeger -->'")
    page.write_text(text.replace("- **Checks:**", ""))
    fails(r"jaeger\.md: needs a line '- \*\*Checks:\*\* \.\.\.'")


def test_results_that_do_not_say_what_they_were_made_from_are_refused(results, pages):
    """In a folder that is no checkout, and by a version that wrote no such file."""
    table = results / "verification" / "jaeger" / "table.csv"
    replace(MADE, commit="unknown").write(table)
    with pytest.raises(InputError, match="was made in no git checkout"):
        rewrite(results, pages)
    (table.parent / "made.json").unlink()
    with pytest.raises(InputError, match=r"has no made\.json beside it"):
        rewrite(results, pages)


def test_results_older_than_the_numerics_are_marked_and_listed(results, pages):
    """Also without results, and the mark goes once they are made again. No such commit counts as older."""
    assert is_older("0123456")
    table = results / "verification" / "jaeger" / "table.csv"
    replace(MADE, commit="0123456-dirty").write(table)
    rewrite(results, pages)
    block = block_of("jaeger", pages)
    assert "0 fail. They are *older than the numerics*: `tests/golden` has changed since.\n" in block
    assert not OLDER.search(block_of("walls", pages))
    assert older_pages(pages) == ["jaeger.md: jaeger was made at commit 0123456-dirty"]
    page = pages / "jaeger.md"
    page.write_text(OLDER.sub("", text_of(page)))
    assert rewrite(None, pages) == []
    assert block_of("jaeger", pages) == block
    MADE.write(table)
    rewrite(results, pages)
    assert not OLDER.search(block_of("jaeger", pages))
    assert older_pages(pages) == []


def test_costs_of_variants_stand_below_the_rows(results, pages):
    costs = results / "verification" / "jaeger" / "costs.csv"
    costs.write_text("variant,cells,levels,finest_cell_m,steps,seconds,memory_MiB\ndip_00,12000,1,1.0,2,3.5,300\n")
    rewrite(results, pages)
    block = block_of("jaeger", pages)
    assert "Cells, time and memory of each variant:" in block
    assert "| dip_00 | 12,000 | 1 | 1 | 2 | 3.5 | 300 |" in block


def test_a_pivot_marks_what_has_no_bound_and_what_misses_it(tmp_path):
    rows = [
        Row.relative(f"{size}: {name}", 2.0, 1.0, bound) for size in "ab" for name, bound in (("x", 0.9), ("y", None))
    ]
    write_texts(tmp_path / "table.csv", [row.texts("s") for row in [*rows, Row.relative("c: x", 2.0, 1.0, 0.1)]])
    pivot = Pivot("Change", r"(?P<row>\w): (?P<column>\w)", "change, %")
    assert pivot.lines(read_rows(tmp_path / "table.csv")) == [
        "Change:",
        "",
        "|  | x | y |",
        "| --- | --- | --- |",
        "| a | -50.0 | *-50.0* |",
        "| b | -50.0 | *-50.0* |",
        "| c | **-50.0 fails** |  |",
    ]


def test_a_colon_in_brackets_splits_no_quantity_and_a_bar_no_cell():
    row = {"quantity": "b of a | c (error: worst)", "passed": "yes"} | dict.fromkeys(
        ("obtained", "expected", "error", "allowed"), ""
    )
    assert rows_table([row])[2] == r"| b of a \| c (error: worst) |  |  |  |  |  | passes |"


def test_tables_of_measuring_studies():
    table = pd.DataFrame({"code": ["ours", "ours", "theirs"], "cells": [10, 20, 10], "wall_s": [1.0, 2.0, 3.25]})
    assert Columns("All", ("code", "wall_s")).lines(table)[2:5] == [
        "| code | wall s |",
        "| --- | --- |",
        "| ours | 1 |",
    ]
    large = pd.DataFrame({"cells": [9999, 12345], "wall_s": [9999.4, 12345.4]})
    assert Columns("Large", ("cells", "wall_s")).lines(large)[4:] == ["| 9999 | 9999 |", "| 12,345 | 12,345 |"]
    theirs = Columns("Theirs", ("code", "wall_s"), ("code", ("theirs",))).lines(table)
    assert theirs[4:] == ["| theirs | 3.25 |"]
    assert Columns("Once", ("code",)).lines(table)[4:] == ["| ours |", "| theirs |"]
    assert Counts("Runs", "code", "cells").lines(table)[4:] == ["| ours | 1 | 1 |", "| theirs | 1 | 0 |"]
    crossed = Cross("Time", ("code",), "cells", "wall_s").lines(table)
    assert crossed[2:] == ["| code | 10 | 20 |", "| --- | --- | --- |", "| ours | 1 | 2 |", "| theirs | 3.25 |  |"]
    crossed = Cross("Time", ("code",), "cells", "wall_s", ("code", ("theirs",))).lines(table)
    assert crossed[2:] == ["| code | 10 |", "| --- | --- |", "| theirs | 3.25 |"]
    words = pd.DataFrame({"scene": ["stope", "hole"], "setting": ["cell", "cell"], "price": ["2 x", "no speed"]})
    crossed = Cross("Prices", ("setting",), "scene", "price").lines(words)
    assert crossed[2:] == ["| setting | hole | stope |", "| --- | --- | --- |", "| cell | no speed | 2 x |"]
    assert Columns("Nobody", ("code",), ("code", ("nobody",))).lines(table) == []


def test_columns_on_pages_are_columns_of_their_tables():
    for study, columns in (
        ("benchmarks", set(COLUMNS)),
        ("stability", set(Point.__dataclass_fields__)),
        ("extremes", set(Point.__dataclass_fields__)),
    ):
        for table in (shown for shown in load(study).shown if shown.file == "table"):
            names = {
                Columns: lambda table: table.names,
                Counts: lambda table: (table.row, table.column),
                Cross: lambda table: (*table.by, table.column, table.value),
            }[type(table)](table)
            assert {*names, *getattr(table, "chosen", ())[:1]} <= columns


def test_a_cell_shows_the_interval_that_its_remark_states():
    row = {"obtained": "1.51234", "remark": "gob of 30 MPa, factor 1.12; 95% interval over instruments -1.2 to 2.1e+03"}
    assert with_interval(row) == "1.51 (-1.2 to 2.1e+03)"
    assert with_interval(row | {"remark": "9 of 10; interval from the residuals of panel 1"}) == "1.51"
