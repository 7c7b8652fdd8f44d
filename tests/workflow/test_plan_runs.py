"""`snakemake plans` for the tiny mine: what runs, what is shared, what stands after it."""

import pytest
import xarray as xr
from tiny_mines import FLAT, NEXT_STEP, STILL, TINY, changed, edited, hashes, jobs, snakemake, write_mine

PLANS = {
    "swapped": {
        "excavations": {"stope_1": {"step": "2019-09"}, "stope_2": {"step": "2019-08"}},
        "steps": [NEXT_STEP],
    },
    "longer": {"excavations": {"stope_2": {"step": "2019-09"}}, "steps": [NEXT_STEP]},
}
HAZARD = {
    "distances": ["5 m", "15 m"],
    "magnitudes": {"small": -1.5, "large": 0.5},
    "likelihoods": {"rare": 0, "likely": 0.5},
}


@pytest.mark.slow
def test_plans_of_the_tiny_mine(spoiled, base):
    """Only steps that differ are computed; the mine's own results stay as they are; a second call has nothing to do;
    another class of chance makes no step again."""
    results = spoiled / "results/tiny"
    before = hashes(results)
    mine = changed(TINY, plans=PLANS, hazard=HAZARD)
    with edited(base / "files" / "tiny.yaml", mine) as file:
        status, text = snakemake(file, spoiled, "plans")
        again = snakemake(file, spoiled, "--dry-run", "plans")
    assert status == 0, text
    assert jobs(text) == {"mining_step": 3, "events": 3, "plan_outcome": 3, "plans": 1}
    assert "Nothing to be done" in again[1]
    after = hashes(results)
    assert {name: after[name] for name in before} == before
    steps = {"swapped": ("2019-08", "2019-09"), "longer": ("2019-09",)}
    made = {
        f"plans/{plan}/{kind}/{step}.nc" for plan, own in steps.items() for step in own for kind in ("steps", "events")
    }
    made |= {f"plans/{plan}/outcome.nc" for plan in ("mine_file", *PLANS)}
    assert set(after) - set(before) == made | {"plans/plans.csv"}

    outcome = {plan: xr.open_dataset(results / f"plans/{plan}/outcome.nc") for plan in ("mine_file", *PLANS)}
    own, longer = outcome["mine_file"], outcome["longer"]
    assert longer.step.values.tolist() == ["2019-08", "2019-09"]
    for name in ("whole_potency", "energy_released", "failed_volume"):
        assert float(longer[name][0, 0]) == float(own[name][0, 0])
    events = [xr.open_dataset(results / f"{folder}events/{step}.nc") for folder, step in (
        ("", "2019-08"), ("plans/longer/", "2019-09"))]  # fmt: skip
    assert longer.whole_potency[0].values.tolist() == [float(one.potency.sum()) for one in events]

    page = (results / "plans/report.html").read_text()
    assert all(plan in page for plan in PLANS)

    other = changed(mine, **{"hazard.magnitudes": {"small": -1.0}})
    with edited(base / "files" / "tiny.yaml", other) as file:
        status, text = snakemake(file, spoiled, "--dry-run", "plans")
    assert jobs(text) == {"plan_outcome": 3, "plans": 1}


@pytest.mark.parametrize(
    ("mine", "line"),
    [
        (STILL, "steps: none has dates; plans are compared by dated steps"),
        (FLAT, "plane: xz; plans need a mine in three"),
    ],
)
def test_mines_without_plans_are_refused(mine, line, tmp_path):
    """In one line."""
    file = write_mine(mine, tmp_path / "mine.yaml")
    status, text = snakemake(file, tmp_path, "--dry-run", "plans")
    assert status != 0
    assert line in text
    assert "Traceback" not in text
