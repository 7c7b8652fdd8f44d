"""Typical mistakes, made in the template: the page quotes what they are told. The template itself has none."""

import re
from pathlib import Path

import pytest
from tiny_mines import merged

from common.errors import InputError
from workflow.configuration import load
from workflow.strict_yaml import read_yaml

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE = (ROOT / "config/mines/template.yaml").read_text(encoding="utf-8")
PAGE = (ROOT / "docs/how-to/typical-mistakes.md").read_text(encoding="utf-8")
POLYGON = "polygon: [[10 m, 20 m], [22 m, 20 m], [22 m, 40 m], [10 m, 40 m]]"
MISTAKES = {  # What the page quotes: what the template has, what a user writes instead.
    "has no unit; write it as text with one": ("finest_cell: 1.25 m", "finest_cell: 1.25"),
    "is not convertible to": ("zz: -0.027 MPa/m", "zz: -0.027 MPa"),
    "unknown key; did you mean": ("finest_cell", "finest_cel"),
    "is not one of the steps": ('step: "2024-01"', "step: 2024-01-01"),
    "is not one of the materials": ("fill: rockfill", "fill: paste"),
    "is before the end of the step before": ('start: "2024-02-01"', 'start: "2024-01-31"'),
    "this name stands twice": ("- name: stope_1", "- name: drive_1"),
    "this key stands twice": ("    width: 5 m", "    width: 5 m\n    width: 4 m"),
    "not YAML": ("  surface: 350 m", "\tsurface: 350 m"),
    "rock gains no strength by failing": ("residual: 2 MPa", "residual: 12 MPa"),
    "is above the friction angle": ("dilation_angle: {intact: 8 deg", "dilation_angle: {intact: 48 deg"),
    "it would fail before anything is mined": ("zz: -0.027 MPa/m", "zz: 0.027 MPa/m"),
    "lies above the ground": ("surface: 350 m", "surface: -350 m"),
    "its axes run north and north": ("  surface: 350 m", "  crs: EPSG:3031\n  surface: 350 m"),
    "is missing; paths resolve from": ("  # - {name: stope_2", "  - {name: stope_2"),
}


def lines(text: str, file: Path) -> list[str]:
    """Lines that a mine file of this text is refused with; none if it is taken."""
    file.write_text(text, encoding="utf-8")
    try:
        load(merged(read_yaml(file)), file)
    except InputError as error:
        return list(error.lines)
    return []


@pytest.mark.parametrize("quote", MISTAKES)
def test_each_mistake_is_told_as_the_page_quotes(quote, tmp_path):
    right, wrong = MISTAKES[quote]
    assert right in TEMPLATE
    told = lines(TEMPLATE.replace(right, wrong, 1), tmp_path / "mine.yaml")
    assert len(told) == 1
    assert quote in told[0]
    assert f'| "{quote}" |' in PAGE


def test_the_page_quotes_no_other_line_of_a_mine_file():
    part = PAGE.split("## In the mine file")[1].split("\n## ")[0]
    assert set(re.findall(r'^\| "([^"]+)" \|', part, re.MULTILINE)) == set(MISTAKES)


def test_the_template_has_no_mistake_and_explains_each_line(tmp_path):
    """Its optional lines have none either: files are missing that only a user has, and nothing else."""
    assert lines(TEMPLATE, tmp_path / "mine.yaml") == []
    keys = [
        line for line in TEMPLATE.splitlines() if re.match(r"^(# )? *(- )?\w+:", line) and not line.startswith("# -")
    ]
    assert len(keys) > 40
    assert [line for line in keys if not re.search(r"\S +# [A-Z]", line)] == []
    optional = re.sub(r"^(?:# (record:|  )|(  )# )", r"\1\2", TEMPLATE, flags=re.MULTILINE)
    assert optional.count("\n  latitude:") == optional.count("\nrecord:") == optional.count("\n  - {name: stope_2") == 1
    (tmp_path / "my_mine").mkdir()
    header = "Time,Easting,Northing,Elevation,Log Mo,Event Type"
    (tmp_path / "my_mine/events.csv").write_text(f"{header}\n2024-01-05 10:00:00,5,20,-190,9.5,Seismic\n")
    (told,) = lines(optional, tmp_path / "mine.yaml")
    assert "stopes.dxf is missing" in told
