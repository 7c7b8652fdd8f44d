"""The picture of the scene of a mine file that is being written: it does without a record that cannot be read."""

import pytest
from tiny_mines import TINY, changed, snakemake, write_mine

CSV = {"reader": "csv", "file": "events.csv", "location_error": "10 m", "columns": {"time": "t", "x": "x", "y": "y"}}
CSV["columns"] |= {"z": "z", "log_potency": "P"}


@pytest.mark.parametrize(
    ("record", "content", "said"),
    [
        ({}, "t,x,y,z,size\n", "events.csv: column 'P' (record.columns.log_potency) is missing"),
        ({}, None, "events.csv is missing"),
        ({"reader": "cvs"}, "t,x,y,z,P\n", "record.reader: 'cvs' is not one of quakeml, csv, elk_creek"),
    ],
)
def test_a_record_that_cannot_be_read_is_left_out_of_the_picture_in_one_line(tmp_path, record, content, said):
    """The picture is there, and the terminal says why it lacks the record. All other targets end at once."""
    file = write_mine(changed(TINY, record=CSV | record), tmp_path / "files" / "tiny.yaml")
    if content is not None:
        (file.parent / "events.csv").write_text(content)
    status, text = snakemake(file, tmp_path, "scene")
    assert status == 0, text
    (line,) = [line for line in text.splitlines() if "The record is not drawn" in line]
    assert said in line
    assert "Traceback" not in text
    assert (tmp_path / "results" / "tiny" / "scene.png").read_bytes().startswith(b"\x89PNG")
    status, text = snakemake(file, tmp_path, "results/tiny/record.nc")
    assert status
    assert said in text


def test_mistakes_elsewhere_end_it(tmp_path):
    file = write_mine(changed(TINY, record=CSV | {"reader": "cvs"}, plane="zz"), tmp_path / "files" / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "scene")
    assert status
    assert "plane" in text
    assert "record.reader" in text
