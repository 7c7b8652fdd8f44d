"""The target `export`: all files of a tiny mine, with and without dates, once and not again."""

import numpy as np
import pandas as pd
import pytest
from tiny_mines import TINY, snakemake, write_mine

from common.event_table import read_events

STEP_FILES = {"cells.vtu", "failed_rock.dxf", "failed_rock.omf", "failed_rock.csv"}


@pytest.mark.slow
def test_files_of_every_step_and_of_the_catalogue(tmp_path):
    file = write_mine(TINY, tmp_path / "files" / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "export")
    assert status == 0, text
    folder = tmp_path / "results" / "tiny" / "export"
    contents = pd.read_csv(folder / "contents.csv")
    assert {path.name for path in (folder / "steps").iterdir()} == set(contents["step"])
    for step in contents["step"]:
        assert {path.name for path in (folder / "steps" / step).iterdir()} == STEP_FILES
    failed, enclosed = contents["failed rock volume [m3]"], contents["within its surface volume [m3]"]
    assert failed.max() > 0
    np.testing.assert_allclose(enclosed, failed, rtol=0.01)
    catalog = read_events(tmp_path / "results" / "tiny" / "catalog.nc")
    table = pd.read_csv(folder / "events.csv")
    np.testing.assert_allclose(table[["x [m]", "y [m]", "z [m]"]], catalog["location"].values, atol=1e-3)
    status, text = snakemake(file, tmp_path, "--dry-run", "export")
    assert status == 0
    assert "Nothing to be done" in text


@pytest.mark.slow
def test_a_mine_without_dates_has_its_rock_alone(tmp_path):
    values = {key: TINY[key] for key in TINY if key not in ("record", "comparison")}
    values["steps"] = [{"name": step["name"]} for step in TINY["steps"]]
    file = write_mine(values, tmp_path / "files" / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "export")
    assert status == 0, text
    folder = tmp_path / "results" / "tiny" / "export"
    assert {path.name for path in folder.iterdir()} == {"contents.csv", "steps"}
