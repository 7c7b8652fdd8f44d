"""What economies save: work of made-up states, tiny mines with one economy off, ratios, and the studies' files."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from matplotlib.figure import Figure
from running import DEFAULT, STUDIES
from snakemake.iocontainers import Wildcards

from common.errors import InputError
from mpm_core.equilibrium import subdomain
from mpm_core.equilibrium.cascade import Ramp
from mpm_core.stages import step_subdomain
from verification.economies import runs
from verification.economies.runs import BASE_RUN, EVERY_STAGE, OFF, cell_cycles, rows_of
from verification.economies.study import COLUMNS, ECONOMIES, SAVINGS, STUDY, savings_of
from verification.extremes.tiny_mine import FLAT, changed
from verification.frame import load
from verification.page_tables import Columns
from verification.studies import load_study
from verification.targets import Cases, Studies

NAMES = ("economies_demo", "economies_renison_scale", "economies_tunnel")


def test_work_is_each_iteration_times_the_cells_that_it_relaxed():
    """Five iterations of 100 cells, three of a subdomain of ten, two of the whole mine, which has been split."""
    state = xr.Dataset(
        {
            "convergence_iteration": ("iteration", np.array([0, 2, 5, 8, 10], np.int32)),
            "convergence_cells": ("iteration", np.array([100, 100, 100, 10, 120], np.int32)),
        }
    )
    assert cell_cycles(state) == 5 * 100 + 3 * 10 + 2 * 120


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A section of a few cells with the variants that need no grid of another size."""
    scene = changed(FLAT, **{"grid.levels": 3, "solver.increments": 0, "materials.host.cohesion.intact": "4 MPa"})
    text = {"answer": "economies", "title": "flat", "scene": scene}
    text["variants"] = {name: {} for name in (BASE_RUN, *OFF)} | {"regular": {"grid": {"levels": 1}}}
    folder = tmp_path_factory.mktemp("economies")
    (folder / "economies_flat.yaml").write_text(yaml.safe_dump(text))
    return folder


@pytest.fixture
def flat(study, monkeypatch):
    """The same, where the study looks for files; steps have subdomains in mines of any size."""
    monkeypatch.setattr(runs, "FOLDER", study)
    monkeypatch.setattr(step_subdomain, "MIN_MINE_CELLS", 0)
    monkeypatch.setattr(step_subdomain, "MAX_SUBDOMAIN_SHARE", 1.0)
    monkeypatch.setattr(subdomain, "MAX_SURROUNDINGS_SHARE", 0.9)
    return "economies_flat"


def test_a_run_states_cells_costs_and_answer(flat):
    (row,) = rows_of(flat, BASE_RUN, 1)
    assert (row["mine"], row["economy"], row["state"]) == ("flat", BASE_RUN, "on")
    assert set(row) == set(COLUMNS)
    assert row["cell_cycles"] > row["cells"] > 100
    assert row["processor_s"] > 0.0
    assert row["memory_MiB"] > 50.0
    assert row["potency_m3"] > 0.0
    assert row["failed_volume_m3"] > 0.0


@pytest.mark.parametrize(
    ("variant", "says"),
    [("whole_steps", "the step begins in the subdomain"), ("whole_cascade", "in a subdomain of")],
)
def test_without_its_subdomains_a_run_makes_none(flat, variant, says, caplog):
    caplog.set_level("INFO")
    rows_of(flat, BASE_RUN, 1)
    assert says in caplog.text
    caplog.clear()
    (row,) = rows_of(flat, variant, 1)
    assert row["state"] == "off"
    assert says not in caplog.text


def test_without_its_one_increment_history_has_several(flat, monkeypatch):
    """Elastic state, history and month; what is off is on again after the run."""
    increments = []
    monkeypatch.setattr(runs, "cell_cycles", lambda state: increments.append(state.attrs["increments"]) or 1.0)
    for variant in (BASE_RUN, "every_increment"):
        rows_of(flat, variant, 1)
    (_, on, _, _, off, _) = increments
    assert on == 1
    assert off > 1
    assert isinstance(Ramp.is_constant, property)


def test_a_grid_of_too_many_cells_states_their_number_alone(flat, monkeypatch):
    monkeypatch.setattr(runs, "MAX_CELLS", 63)
    (row,) = rows_of(flat, "regular", 1)
    assert row == {"mine": "flat", "economy": "regular", "state": "not run", "cells": 64}


def state_of(cycles: int, cells: int, step_index: int = 0) -> xr.Dataset:
    """A made-up state: a check after some cycles, and one failed particle of 2 m3 in step 1."""
    strain = np.array([[0.0, 0.0, 0.0, 0.5, 0.0, 0.0]])  # a potency of its volume
    values = {
        "convergence_iteration": ("iteration", np.array([cycles])),
        "convergence_cells": ("iteration", np.array([cells])),
        "node": ("cell", np.zeros(cells)),
        "failed": ("particle", np.array([1])),
        "volume": ("particle", np.array([2.0])),
        "seismic_strain": (("particle", "tensor"), strain),
    }
    return xr.Dataset(values, attrs={"step_index": step_index, "failed_volume": 3.0, "truncated_share": 0.1})


def test_the_companion_works_but_has_no_part_in_the_answer(monkeypatch):
    """Snakemake is made up: it leaves logs of stages, and states by their paths."""
    states = {"elastic": state_of(2, 10), "steps/2019-08": state_of(3, 20, 1), "steps/history": state_of(1, 15)}
    companion = {"coarse/elastic": state_of(1, 5), "coarse/steps/2019-08": state_of(1, 8, 1)}
    log = "x done in 9.00 s ({:.2f} s of processor time, 1.00 s of it compiling), peak memory {:.0f} MiB"

    def made_up(command, **options):
        folder, is_all = Path(command[command.index("--directory") + 1]), "all" in command
        for path in states | (companion if is_all else {}):
            (folder / f"results/demo/{path}.nc").parent.mkdir(parents=True, exist_ok=True)
            (folder / f"results/demo/{path}.nc").touch()
        (folder / "logs/demo").mkdir(parents=True, exist_ok=True)
        name, *costs = ("report", 5.0, 900.0) if is_all else ("elastic", 3.0, 400.0)
        (folder / f"logs/demo/{name}.log").write_text(log.format(*costs))
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(runs.subprocess, "run", made_up)
    monkeypatch.setattr(runs, "read_dataset", lambda path: (states | companion)[str(path).partition("demo/")[2][:-3]])
    on, off = rows_of("economies_demo", EVERY_STAGE, 1)
    assert (on["state"], off["state"]) == ("on", "off")
    assert (on["cell_cycles"], off["cell_cycles"]) == (2 * 10 + 3 * 20 + 15, 2 * 10 + 3 * 20 + 15 + 5 + 8)
    assert (on["processor_s"], off["processor_s"]) == (2.0, 6.0)
    assert (on["memory_MiB"], off["memory_MiB"]) == (400.0, 900.0)
    for row in (on, off):
        assert (row["cells"], row["failed_volume_m3"], row["truncated_share"]) == (20, 3.0, 0.1)
        assert row["potency_m3"] == pytest.approx(2.0)


def test_a_run_of_stages_that_fails_is_named(monkeypatch):
    failed = SimpleNamespace(returncode=1, stderr="first\nthe reason\n")
    monkeypatch.setattr(runs.subprocess, "run", lambda command, **options: failed)
    with pytest.raises(InputError, match=r"economies_demo, every_stage: the reason"):
        rows_of("economies_demo", EVERY_STAGE, 1)


def test_a_mine_that_is_written_elsewhere_still_finds_its_record():
    assert Path(runs.mine_text("economies_demo")["record"]["file"]).is_file()
    assert runs.mine_text("economies_renison_scale")["grid"]["levels"] == 2


def row_of(economy: str, state: str, *, factor: float = 1.0, **values) -> dict:
    numbers = dict.fromkeys(COLUMNS[3:], 10.0 * factor)
    return {"mine": "demo", "economy": economy, "state": state} | numbers | values


def test_savings_are_off_over_on_of_the_same_runs():
    """The run with every stage has a base of its own; what was not run saves nothing that is known."""
    results = {
        "a": [row_of(BASE_RUN, "on")],
        "b": [row_of("rings", "off", factor=3.0, potency_m3=11.0)],
        "c": [{"mine": "demo", "economy": "regular", "state": "not run", "cells": 9}],
        "d": [row_of(EVERY_STAGE, "on", factor=2.0), row_of(EVERY_STAGE, "off", factor=5.0)],
    }
    tables = STUDY.tables(results)
    savings = tables[SAVINGS].set_index("economy")
    assert list(savings.index) == [ECONOMIES["rings"], ECONOMIES[EVERY_STAGE]]
    assert savings["times_the_work"].tolist() == pytest.approx([3.0, 2.5])
    assert savings["times_the_memory"].tolist() == pytest.approx([3.0, 2.5])
    assert savings["potency_change"].tolist() == pytest.approx([0.1, 1.5])
    assert len(tables["table"]) == 5
    for shown in STUDY.shown:
        assert isinstance(shown, Columns)
        assert len(shown.lines(tables[shown.file])) > 4
    assert isinstance(STUDY.figures(results)[SAVINGS], Figure)
    assert savings_of(tables["table"][:1]).empty


@pytest.fixture(scope="module")
def mines():
    """Mines of the studies' variants, by study and variant."""
    return {name: load_study(STUDIES / f"{name}.yaml", DEFAULT).mines for name in NAMES}


def test_a_case_is_made_again_if_its_study_or_its_mine_changes():
    studies = Studies(STUDIES, DEFAULT)
    cases = Cases(studies)
    assert "economies_demo-rings" in cases.names("economies")

    def inputs(case: str) -> list[Path]:
        return [Path(path) for path in cases.inputs(Wildcards(fromdict={"target": "economies", "case": case}))]

    assert inputs("economies_tunnel-rings") == [STUDIES / "economies_tunnel.yaml"]
    assert inputs("economies_demo-rings") == [STUDIES / "economies_demo.yaml", STUDIES.parent / "mines" / "demo.yaml"]


def finest(mine) -> float:
    return mine.settings.grid.coarse_cell / 2 ** (mine.settings.grid.levels - 1)


@pytest.mark.parametrize("name", NAMES)
def test_all_runs_of_a_mine_have_finest_cells_of_one_size(mines, name):
    """And each variant turns off an economy that has a title."""
    assert load("economies") is STUDY
    assert set(mines[name]) <= {BASE_RUN, *ECONOMIES}
    assert {finest(mine) for mine in mines[name].values()} == {finest(mines[name][BASE_RUN])}


@pytest.mark.parametrize("name", ["economies_demo", "economies_tunnel"])
def test_the_wide_domain_is_three_times_the_other_about_the_same_middle(mines, name):
    base, wide = (mines[name][variant].settings.domain for variant in (BASE_RUN, "wide_domain"))
    lower, upper = np.array(base.lower), np.array(base.upper)
    assert np.subtract(wide.upper, wide.lower) == pytest.approx(3.0 * (upper - lower))
    assert np.add(wide.upper, wide.lower) == pytest.approx(lower + upper)


def test_the_section_and_its_twin_in_three_dimensions_have_one_volume(mines):
    section, solid = (mines["economies_tunnel"][variant].settings for variant in (BASE_RUN, "three_dimensions"))
    assert solid.domain.upper[1] - solid.domain.lower[1] == section.thickness
    assert np.delete(solid.domain.lower, 1) == pytest.approx(section.domain.lower)
    for flat_one, solid_one in zip(section.excavations, solid.excavations, strict=True):
        assert np.delete(solid_one.lower, 1) == pytest.approx(flat_one.lower)
        assert np.delete(solid_one.upper, 1) == pytest.approx(flat_one.upper)
