"""A mine of four bodies with a schedule, and files of solids in all formats, for tests."""

import copy
import csv
import os
from pathlib import Path

import ezdxf
import numpy as np
import omf
import pytest
import yaml
from tiny_mines import TINY, merged

from common.errors import InputError
from mpm_core.geometry import build_shape
from workflow.configuration import load

HEAD = ["body", "start", "end", "filled", "fill"]
UNDATED = {key: value for key, value in TINY.items() if key not in ("steps", "excavations", "record")}
UNDATED |= {"materials": {**TINY["materials"], "paste": TINY["materials"]["fill"]}}
LAYERS = ["A", "B", "C", "D"]


def solid(number: int, edge: float = 4.0):
    """A box by itself among 20 in a row."""
    low = np.array([1.0 + 5 * (number % 20), 1.0 + 5 * (number // 20), 40.0])
    shape = {"name": "b", "shape": "box", "lower": low.tolist(), "upper": (low + edge).tolist()}
    return build_shape(shape, 3)


def write_dxf(path: Path, layers: list[str], first: int = 0) -> Path:
    """A drawing with a box on each layer."""
    drawing = ezdxf.new("R2000")
    drawing.header["$INSUNITS"] = 6
    for number, layer in enumerate(layers, first):
        body = solid(number)
        for facet in body.facets:
            drawing.modelspace().add_3dface(body.vertices[facet], dxfattribs={"layer": layer})
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.saveas(path)
    return path


def write_table(path: Path, rows: list[tuple], head: list[str] = HEAD) -> Path:
    """A CSV file; rows may be shorter than the head."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *([*row, *[""] * (len(head) - len(row))] for row in rows)])
    return path


@pytest.fixture(name="mine")
def scheduled_mine(tmp_path):
    """The mine of a table, rows or the text of its file, and of solids, by default those of a drawing with four."""

    def loaded(table, *, name="year.csv", solids=None, base=UNDATED, more=None, **schedule):
        solids = solids or [{"file": "stopes.dxf"}]
        if solids[0]["file"] == "stopes.dxf" and not (tmp_path / "stopes.dxf").exists():
            write_dxf(tmp_path / "stopes.dxf", LAYERS)
        if isinstance(table, str):
            (tmp_path / name).write_text(table, encoding="utf-8")
        elif table is not None:
            write_table(tmp_path / name, table)
        text = copy.deepcopy(base) | {"schedule": {"file": name, "solids": solids, **schedule}} | (more or {})
        (tmp_path / "mine.yaml").write_text(yaml.safe_dump(text, sort_keys=False))
        return load(merged(text), tmp_path / "mine.yaml")

    return loaded


@pytest.fixture(name="lines")
def lines_of_mistakes(mine, tmp_path):
    """The lines that such a mine is refused with, without the names of the mine's file and of the folder."""

    def refused(*args, **kwargs) -> list[str]:
        with pytest.raises(InputError) as error:
            mine(*args, **kwargs)
        return [
            line.removeprefix(f"{tmp_path}/mine.yaml: ").replace(_shown(tmp_path), "") for line in error.value.lines
        ]

    return refused


def _shown(folder: Path) -> str:
    return f"{os.path.relpath(folder)}/"


def steps_of(mine) -> dict[str, tuple[str, str]]:
    """Step that mines each body, and step that fills it."""
    return {
        entry.name: (entry.step, "" if entry.fill_material is None else entry.fill_step) for entry in mine.excavations
    }


RIGHT = [
    ("A", "2024-01-02", "2024-01-20", "2024-02-10", "paste"),
    ("B", "2024-01-15", "2024-02-05", "2024-04-01", "paste"),
    ("C", "2024-03-01", "2024-03-31", "", "none"),
    ("D", "", "planned", "", "paste"),
]


def write_omf(path: Path, names: list[str]) -> None:
    project = omf.Project(name="mine")
    project.elements = [
        omf.SurfaceElement(
            name=name, geometry=omf.SurfaceGeometry(vertices=solid(number).vertices, triangles=solid(number).facets)
        )
        for number, name in enumerate(names)
    ]
    omf.OMFWriter(project, str(path))


def write_gocad(path: Path, names: list[str]) -> None:
    lines = []
    for number, name in enumerate(names):
        lines += ["GOCAD TSurf 1", "HEADER {", f"name:{name}", "}", "TFACE"]
        lines += ["VRTX {} {} {} {}".format(place, *vertex) for place, vertex in enumerate(solid(number).vertices)]
        lines += [*("TRGL {} {} {}".format(*facet) for facet in solid(number).facets), "END"]
    path.write_text("\n".join(lines) + "\n")


def write_obj(path: Path, names: list[str], key: str = "o") -> None:
    lines, before = [], 1
    for number, name in enumerate(names):
        body = solid(number)
        lines += [f"{key} {name}", *("v {} {} {}".format(*vertex) for vertex in body.vertices)]
        lines += ["f {} {} {}".format(*(facet + before)) for facet in body.facets]
        before += len(body.vertices)
    path.write_text("\n".join(lines) + "\n")


def write_stl(path: Path, names: list[str]) -> None:
    lines = []
    for number, name in enumerate(names):
        lines.append(f"solid {name}")
        for corners in solid(number).corners(np.zeros(3)):
            vertices = ["vertex {} {} {}".format(*corner) for corner in corners]
            lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    path.write_text("\n".join(lines) + "\n")
