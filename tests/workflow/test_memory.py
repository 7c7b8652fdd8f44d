"""What rules ask for in memory: by the size of the grid, as soon as there is one."""

import re
from typing import get_args

import numpy as np
import pytest
import xarray as xr
from tiny_mines import TINY, snakemake

from common.datasets import write_dataset
from mpm_core.settings import SolverSettings
from mpm_core.stages.stage_memory import BASE_BYTES, stage_bytes
from mpm_core.stages.step_cells import SCHEMES
from workflow.rule_resources import COMPILING, mechanics_mb, reading_mb


@pytest.fixture
def grid(tmp_path):
    """A grid of a million cells, as far as its size goes."""
    path = tmp_path / "grid.nc"
    write_dataset(xr.Dataset({"cell_level": ("cell", np.zeros(1_000_000, np.int8))}), path)
    return str(path)


@pytest.mark.parametrize("scheme", ["multigrid", "explicit"])
@pytest.mark.parametrize("elastic", [True, False])
def test_mechanics_ask_for_what_their_stage_says_that_it_needs(accept, grid, scheme, elastic):
    """And for what compiling takes; particles count."""
    mine = accept(TINY, **{"solver.scheme": scheme, "grid.particles_per_cell": 8})
    expected = COMPILING + stage_bytes(scheme, 3, 1_000_000, 8_000_000, elastic, follows=True)
    assert mechanics_mb(mine, grid, elastic) == round(expected / 1e6)
    static = accept(TINY, **{"solver.scheme": scheme, "grid.particles_per_cell": 8, "grid.refinement": "static"})
    assert mechanics_mb(static, grid, elastic) < (mechanics_mb(mine, grid, elastic) + 1 if elastic else expected / 1e6)


def test_a_scheme_needs_no_figures_of_its_own():
    """Until it is measured it counts as the largest; those there are have theirs, and can be made."""
    new = stage_bytes("new", 3, 10**6, 10**6)
    assert new == max(stage_bytes(scheme, 3, 10**6, 10**6) for scheme in SCHEMES)
    assert SCHEMES.keys() == BASE_BYTES.keys() == set(get_args(SolverSettings.model_fields["scheme"].annotation))


def test_a_grid_that_is_made_anew_is_looked_at_again(accept, grid):
    """Half as many cells, half as much beyond what any stage takes."""
    mine = accept(TINY)
    before = reading_mb(mine, grid, "events", [grid])
    write_dataset(xr.Dataset({"cell_level": ("cell", np.zeros(500_000, np.int8))}), grid)
    least = reading_mb(mine, __file__, "events", [])  # no grid at all: none of its cells count
    assert reading_mb(mine, grid, "events", [grid]) - least == pytest.approx((before - least) / 2, abs=1)


def test_without_a_grid_snakemake_is_told_of_an_input_that_is_missing(accept, tmp_path):
    """It then asks again when the job is ready."""
    with pytest.raises(FileNotFoundError) as missing:
        reading_mb(accept(TINY), str(tmp_path / "grid.nc"), "vtk", ["steps/2019-08.nc"])
    assert missing.value.filename == "steps/2019-08.nc"


STEPS = ("steps/history.nc", "steps/2019-08.nc")


def asked(text: str) -> dict[str, set[str]]:
    """What each rule asks for, from a dry run that shows its jobs."""
    found, rule = {}, ""
    for line in text.splitlines():
        rule = line.split()[1].rstrip(":") if re.match(r"(local)?rule ", line) else rule
        if amount := re.search(r"resources:.*mem_mb=([^,]+)", line):
            found.setdefault(rule, set()).add(amount[1])
    return found


def test_rules_know_it_once_the_grid_stands(undisturbed, tiny_file, tmp_path, accept):
    """Before that it is to be determined, in a plan as in a run."""
    status, text = snakemake(tiny_file, tmp_path / "new", "--dry-run", "--quiet", "host")
    assert status == 0, text
    later = {rule for rule, amounts in asked(text).items() if amounts == {"<TBD>"}}
    assert later == {"elastic", "step", "events", "catalogue", "openings", "report"}
    status, text = snakemake(tiny_file, undisturbed[0], "--dry-run", "--quiet", "host", "--forceall")
    assert status == 0, text
    grid = str(undisturbed[0] / "results/tiny/grid.nc")
    assert asked(text)["elastic"] == {str(mechanics_mb(accept(TINY), grid, elastic=True))}
    states = [str(undisturbed[0] / "results/tiny" / name) for name in ("elastic.nc", *STEPS)]
    asked_for = {str(mechanics_mb(accept(TINY), state, elastic=False)) for state in states[:-1]}
    assert asked(text)["step"] == asked_for  # that of the step before, whose cells it starts from
    assert asked(text)["events"] == {str(reading_mb(accept(TINY), grid, "events", [grid, *states[1:]], at_once=4))}


def test_a_job_that_is_started_again_asks_for_more(undisturbed, tiny_file):
    """In proportion to its number of starts, if it is one that a cluster runs."""
    once, twice = (
        asked(snakemake(tiny_file, undisturbed[0], "-n", "-q", "host", "-F", "--attempt", number, "all", "scene")[1])
        for number in ("1", "2")
    )
    constant = {rule for rule in once if once[rule] == twice[rule]} - {"all"}
    assert constant == {"record", "report_page"}
    for rule in once.keys() - constant - {"all"}:
        assert twice[rule] == {str(2 * int(amount)) for amount in once[rule]}
