"""Bodies of files of solids and rows of a table find each other by name; what is left over is one line each."""

import ezdxf
import pytest
from scheduled_mines import LAYERS, RIGHT, write_dxf, write_gocad, write_obj, write_omf, write_stl


def test_more_mistakes_than_a_screen_holds_are_all_told(lines, tmp_path):
    names = [f"S{number}" for number in range(50)]
    write_dxf(tmp_path / "many.dxf", names)
    found = lines([("none of them", "", "planned")], solids=[{"file": "many.dxf"}])
    assert len(found) == 51
    assert not [line for line in found if "more mistakes" in line]


def test_a_slip_is_told_with_the_name_that_may_be_meant(lines, tmp_path):
    write_dxf(tmp_path / "one.dxf", ["STOPE_12"])
    found = lines([("STOPE_21", "", "planned")], solids=[{"file": "one.dxf"}])
    assert found == [
        "schedule.file: year.csv: row 1: STOPE_21: no body of the solids has this name; did you mean STOPE_12?",
        "schedule.solids: one.dxf: STOPE_12: has no row in year.csv; did you mean STOPE_21?",
    ]


def test_blanks_of_names_do_not_matter(mine, tmp_path):
    write_dxf(tmp_path / "blanks.dxf", ["ST 1 ", "ST  2"])
    made = mine([("st  1", "", "2024-01-20"), ("ST 2", "", "planned")], solids=[{"file": "blanks.dxf"}])
    assert [(entry.name, entry.layer) for entry in made.excavations] == [("ST_1", "ST 1 "), ("ST__2", "ST  2")]


@pytest.mark.parametrize(
    ("layer", "cell", "remedy"),
    [
        ("007", "7", "; did you mean 007?"),
        ("L7_001", "L07_1", "; did you mean L7_001?"),
        ("12-03", "2024-03-12 00:00:00", "; a program has made a date of it: let the column be text, and write the "
         "name again"),
    ],
)  # fmt: skip
def test_names_that_a_spreadsheet_has_changed_are_told_with_a_remedy(lines, tmp_path, layer, cell, remedy):
    write_dxf(tmp_path / "one.dxf", [layer])
    found = lines([(cell, "", "planned")], solids=[{"file": "one.dxf"}])
    assert found[0] == f"schedule.file: year.csv: row 1: {cell}: no body of the solids has this name{remedy}"


def test_a_body_without_a_name_is_not_left_out(lines, tmp_path):
    write_omf(tmp_path / "s.omf", ["A", "", "B"])
    assert lines([("A", "", "planned"), ("B", "", "planned")], solids=[{"file": "s.omf"}]) == [
        "schedule.solids[0]: s.omf: 1 of 3 bodies have no name: name them, and export it again"
    ]


def test_a_body_in_two_files_is_told(lines, tmp_path):
    write_dxf(tmp_path / "one.dxf", ["A", "B"])
    write_dxf(tmp_path / "two.dxf", ["C", "b"], 5)
    rows = [(name, "", "2024-01-20") for name in "ABC"]
    found = lines(rows, solids=[{"file": "one.dxf"}, {"file": "two.dxf"}])
    assert found == [
        "schedule.solids: two.dxf: b: one.dxf has a body of this name already; rename one, or choose bodies with layer "
        "or element"
    ]


def test_a_name_of_the_table_and_of_the_file_is_told(lines):
    found = lines(RIGHT, more={"excavations": [{"name": "B", "step": "2024-01", "file": "stopes.dxf", "layer": "A"}]})
    assert "schedule.file: year.csv: row 2: B: this name stands twice" in found


@pytest.mark.parametrize(
    ("file", "write"),
    [
        ("s.omf", write_omf),
        ("s.ts", write_gocad),
        ("s.obj", write_obj),
        ("g.obj", lambda path, names: write_obj(path, names, "g")),
        ("s.stl", write_stl),
    ],
)
def test_bodies_of_other_formats(mine, tmp_path, file, write):
    """Also those of a pattern alone."""
    write(tmp_path / file, ["A", "B", "C", "D", "TOPO"])
    made = mine(RIGHT, solids=[{"file": file, "element": "?", "units": "m"}])
    assert [entry.given() for entry in made.excavations][:2] == [
        {
            "name": "A",
            "step": "2024-01",
            "file": file,
            "element": "A",
            "units": "m",
            "fill": "paste",
            "filled": "2024-03",
        },
        {
            "name": "B",
            "step": "2024-02",
            "file": file,
            "element": "B",
            "units": "m",
            "fill": "paste",
            "filled": "planned",
        },
    ]
    assert [entry.name for entry in made.excavations] == LAYERS


def test_a_file_for_each_body_is_called_by_its_name(mine, tmp_path):
    """STL files of one solid, whatever the solid is called in them; a drawing with one layer."""
    (tmp_path / "stopes").mkdir()
    for name in "abc":
        write_stl(tmp_path / "stopes" / f"{name}.stl", ["export"])
    write_dxf(tmp_path / "d.dxf", ["0"])
    made = mine(RIGHT, solids=[{"file": "stopes/*.stl"}, {"file": "d.dxf"}])
    assert [entry.name for entry in made.excavations] == LAYERS
    assert [entry.file for entry in made.excavations] == [*(f"stopes/{name}.stl" for name in "abc"), "d.dxf"]
    assert made.excavations[3].layer == "0"


def test_names_that_no_excavation_may_have_are_written_with_underscores(mine, tmp_path):
    write_dxf(tmp_path / "odd.dxf", ["Stope 12-3.5", "B"])
    made = mine([("stope 12-3.5", "", "2024-01-20"), ("B", "", "planned")], solids=[{"file": "odd.dxf"}])
    assert [(entry.name, entry.layer) for entry in made.excavations] == [("Stope_12-3_5", "Stope 12-3.5"), ("B", "B")]


def test_a_name_that_is_too_long_is_told(lines, tmp_path):
    name = "L" * 70
    write_dxf(tmp_path / "long.dxf", [name])
    (line,) = lines([(name, "", "planned")], solids=[{"file": "long.dxf"}])
    assert line.startswith(f"schedule.file: year.csv: row 1: {name}: name: 'LLL")


def test_a_hidden_layer_is_a_body_if_the_table_names_it(mine, tmp_path):
    path = write_dxf(tmp_path / "hidden.dxf", ["A", "B", "OLD"])
    drawing = ezdxf.readfile(path)
    drawing.layers.add("B").off()
    drawing.layers.add("OLD").freeze()
    drawing.saveas(path)
    made = mine(RIGHT[:2], solids=[{"file": "hidden.dxf"}])
    assert [entry.name for entry in made.excavations] == ["A", "B"]
