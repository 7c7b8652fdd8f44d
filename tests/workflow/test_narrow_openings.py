"""Notes on openings that are too narrow for the cells, before anything runs."""

import copy
import os

import pytest
import trimesh
import yaml
from tiny_mines import ROOT

from workflow import cells_across
from workflow.configuration import load_mine
from workflow.narrow_openings import notes

MEMORY = cells_across.MEMORY / "demo"
DEMO = yaml.safe_load((ROOT / "config/mines/demo.yaml").read_text())


@pytest.fixture(autouse=True)
def _working_directory(tmp_path, monkeypatch):
    """What is measured is remembered in the working directory."""
    monkeypatch.chdir(tmp_path)


def mine_of(folder, cell: str, stopes: list[dict]):
    """The demo with other openings in cells of a size."""
    values = {key: value for key, value in copy.deepcopy(DEMO).items() if key not in ("plans", "record", "calibration")}
    values |= {"excavations": stopes, "grid": {"finest_cell": cell, "buffer_cells": 1}}
    path = folder / "demo.yaml"
    path.write_text(yaml.safe_dump(values))
    return load_mine(path)


def metres(point: list[float]) -> list[str]:
    return [f"{value} m" for value in point]


def stope(name: str, lower, upper, step: str, filled: str | None = None, **more) -> dict:
    shape = {} if "file" in more else {"shape": "box", "lower": metres(lower), "upper": metres(upper)}
    fill = {"fill": "none"} if filled is None else {"fill": "fill", "filled": filled}
    return {"name": name, "step": step} | shape | fill | more


def tabular(number: int, step: str, filled: str, thickness: float = 6.0) -> dict:
    """A steep stope of a thin lode, one beside the other."""
    return stope(
        f"stope_{number}", [95.0, 20.0 * number, 980.0], [95.0 + thickness, 20.0 * number + 20, 1010.0], step, filled
    )


@pytest.mark.parametrize(("cell", "told"), [("4 m", True), ("1.6 m", False)])
def test_a_drive_of_fewer_than_three_cells_is_told(tmp_path, cell, told):
    """4.8 m, wherever it lies: 1.2 cells of 4 m, three of 1.6 m. A planned one is not mined yet."""
    path = [metres(point) for point in ([62.3, 30.0, 994.0], [64.0, 100.0, 984.0], [80.0, 170.0, 974.0])]
    drive = {
        "name": "drive",
        "step": "history",
        "shape": "tunnel",
        "width": "4.8 m",
        "height": "4.8 m",
        "path": path,
        "fill": "none",
    }
    lines = notes(mine_of(tmp_path, cell, [drive, drive | {"name": "planned", "step": "planned", "width": "2 m"}]))
    expected = [
        "excavations: narrow for cells of 4 m, too little rock fails around them (cells across, of those needed): "
        "drive 1.2 of 3; grid.finest_cell: 1.6 m is small enough"
    ]
    assert lines == (expected if told else [])


def test_cells_that_fill_needs_are_told(tmp_path):
    """Stopes two cells thick; fill of the step that mines one holds it, and so does that of a wide one."""
    stopes = [tabular(number, "2019-08", "2019-09") for number in range(7)]
    stopes += [
        tabular(7, "2019-08", "2019-08"),
        tabular(8, "2019-08", "planned"),
        tabular(9, "2019-08", "2019-09", 13.0),
    ]
    *_, line = notes(mine_of(tmp_path, "3 m", stopes))
    assert line == (
        "excavations: fill may not hold the walls of 7 of 8 filled in a later step; it needs 4 cells across: "
        "stope_0 2.0, stope_1 2.0, stope_2 2.0, stope_3 2.0, stope_4 2.0 and 2 more; use grid.finest_cell: 1.5 m, or "
        "fill them in the step that mines them"
    )


def test_solids_of_files_are_measured(tmp_path):
    """A box of 6 m in a file. What is no solid, or encloses nothing, is left to the stage that reads it."""
    box = trimesh.creation.box(extents=[6.0, 30.0, 30.0])
    box.apply_translation([95.0, 50.0, 990.0])
    box.export(tmp_path / "stope.stl")
    entry = stope("scanned", None, None, "2019-08", file="stope.stl")
    (tmp_path / "broken.stl").write_text("no solid")
    sheet = trimesh.Trimesh([[90, 50, 980], [91, 50, 980], [90, 60, 990], [91, 60, 990]], [[0, 1, 2], [1, 3, 2]])
    trimesh.util.concatenate([sheet, sheet.copy()]).export(tmp_path / "sheet.stl")
    others = [stope(name, None, None, "2019-08", file=f"{name}.stl") for name in ("broken", "sheet")]
    mine = mine_of(tmp_path, "3 m", [entry])
    (line,) = notes(mine)
    assert "scanned 2.0 of 3" in line
    odd = [mine.excavations[0].model_copy(update={"name": one["name"], "file": one["file"]}) for one in others]
    mine.excavations = [*mine.excavations, *odd]
    assert notes(mine) == [line]


def test_a_second_start_measures_only_what_has_changed(tmp_path, monkeypatch):
    """Neither solids of shapes nor of files; a file that is replaced, another shape and other cells are measured."""
    calls = []
    measure = cells_across.cells_across
    monkeypatch.setattr(cells_across, "cells_across", lambda solid, *more: calls.append(solid) or measure(solid, *more))

    def measured(cell: str, thickness: float = 6.0) -> list[str]:
        calls.clear()
        mine = mine_of(tmp_path, cell, [tabular(0, "2019-08", "2019-09", thickness), scanned])
        assert "narrow for" in notes(mine)[0]
        return [solid.name for solid in calls]

    scanned = stope("scanned", None, None, "2019-08", file="stope.stl")
    for width in (6.0, 5.0):
        box = trimesh.creation.box(extents=[width, 30.0, 30.0])
        box.apply_translation([95.0, 50.0, 990.0])
        box.export(tmp_path / "stope.stl")
        os.utime(tmp_path / "stope.stl", ns=(int(width), int(width)))  # within a clock's tick of each other
        assert measured("3 m") == (["stope_0", "scanned"] if width == 6.0 else ["scanned"])
        assert measured("3 m") == []
    assert measured("3 m", 7.0) == ["stope_0"]
    assert measured("4 m", 7.0) == ["stope_0", "scanned"]
    MEMORY.write_text('{"half": [')
    assert measured("4 m", 7.0) == ["stope_0", "scanned"]
    assert measured("4 m", 7.0) == []
