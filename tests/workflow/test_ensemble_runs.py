"""`ensemble: n` for the tiny mine: members beside results that stand, and what is gathered from them."""

import numpy as np
import pytest
import xarray as xr
from tiny_mines import TINY, changed, edited, hashes, jobs, snakemake


@pytest.mark.slow
def test_members_run_beside_what_stands_and_are_gathered(spoiled, base):
    """Two members of two steps each: their own steps and events on the mine's grid and elastic state, the spread, the
    comparison, whose model they are part of, the report; nothing else of the mine itself is made again, nor anything at
    a second call."""
    results = spoiled / "results/tiny"
    before = hashes(results)
    with edited(base / "files" / "tiny.yaml", changed(TINY, ensemble=2)) as file:
        status, text = snakemake(file, spoiled)
        again = snakemake(file, spoiled, "--dry-run")
        drawn = snakemake(file, spoiled, "--dry-run", "results/tiny/ensemble/1/vtk/steps/2019-08.vtu")
    assert status == 0, text
    assert jobs(text) == {"step": 4, "events": 2, "comparison": 1, "report": 1, "report_page": 1, "all": 1}
    after = hashes(results)
    assert {path for path in before if after[path] != before[path]} <= {"comparison.nc"}
    steps = [f"{folder}/{step}.nc" for folder in ("steps", "events") for step in ("history", "2019-08")]
    assert set(after) - set(before) == {
        "spread.nc",
        *(f"ensemble/{member}/{file}" for member in (1, 2) for file in (*steps, "catalog.nc")),
    }

    stress = [
        xr.open_dataset(results / run / "steps/2019-08.nc").stress.values for run in ("", "ensemble/1", "ensemble/2")
    ]
    assert not any(np.array_equal(stress[i], stress[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    spread, catalog = xr.open_dataset(results / "spread.nc"), xr.open_dataset(results / "catalog.nc")
    assert spread.period.values.tolist() == ["2019-08", "all"]
    assert float(spread.potency[0, -1]) == float(catalog.potency.sum())
    for run in (1, 2):
        events = xr.open_dataset(results / f"ensemble/{run}/events/2019-08.nc")
        assert float(spread.potency[run, -1]) == float(events.potency.sum())
    cut = xr.open_dataset(results / "comparison.nc").cut
    assert spread.attrs["cut"] == float(cut)
    page = (results / "report.html").read_text()
    assert "Each of the 2 members has rock of its own" in page
    assert "Older than the configuration" not in page

    assert "Nothing to be done" in again[1]
    assert drawn[0] == 0, drawn[1]
    assert jobs(drawn[1]) == {}  # drawn on the mine's own grid
