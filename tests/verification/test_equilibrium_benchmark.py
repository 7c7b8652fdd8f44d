"""The equilibrium benchmark: its mesh, its limits, its table and page on made-up times, and one small case."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from common.stage import PARENT
from verification.benchmarks import ours
from verification.benchmarks.measuring import DONE, FAILED, NOT_RUN, STOPPED, Unavailable, foreseen, peer_python, watch
from verification.benchmarks.peers.stope import Block, sizes
from verification.benchmarks.settings import FILE, PEERS, Case, Code, parse, read_settings
from verification.benchmarks.study import STUDY, make_table
from verification.studies import FOLDER, default_settings
from verification.targets import Cases, Studies

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = read_settings()


@pytest.fixture(scope="module")
def block() -> Block:
    return Block(SETTINGS.numbers(Case("coulomb", "ogs", 2), threads=1))


def test_mesh_has_the_cells_and_unknowns_that_the_table_counts(block):
    """Counted by formula for our schemes, which need no such mesh; nodes inside the stope belong to no cell."""
    assert sizes(block.case) == {"cells": len(block.cells), "unknowns": 3 * (len(block.nodes) - len(block.outer))}
    assert np.array_equal(np.unique(block.hexahedra), np.arange(len(block.nodes)))


def test_hexahedra_are_cubes_in_vtk_order(block):
    """From corner 0 to corners 1, 3, 4 go the edges along x, y, z; corner 6 is opposite."""
    corner = block.position[block.hexahedra]
    for other, direction in ((1, (1, 0, 0)), (3, (0, 1, 0)), (4, (0, 0, 1)), (6, (1, 1, 1))):
        assert np.allclose(corner[:, other] - corner[:, 0], block.case["cell"] * np.array(direction))


def test_support_of_the_walls_is_the_stress_on_their_areas(block):
    """Opposite walls balance, and each bears stress times area: 10 x 30 x 10 m in 25, 40 and 28 MPa."""
    force = block.support()
    assert np.allclose(force.sum(axis=0), 0.0, atol=1.0)
    areas = np.array([300.0, 100.0, 300.0])
    assert np.allclose(np.abs(force).sum(axis=0), 2.0 * areas * [25e6, 40e6, 28e6])
    lower_wall = block.nodes[:, 0] == block.lower[0]
    assert force[lower_wall, 0].sum() == pytest.approx(-25e6 * areas[0])  # the stope's rock pressed it back, along -x


@given(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01))
def test_closure_of_a_homogeneous_strain_is_strain_times_width(strain, shift):
    """The side walls are 10 m apart; what moves the block as a whole, and motion along the walls, closes nothing."""
    mesh = Block(SETTINGS.numbers(Case("elastic", "ogs", 2), threads=1))
    moved = np.stack([strain * mesh.position[:, 0] + shift, mesh.position[:, 2], mesh.position[:, 0]], axis=1)
    assert mesh.closure(moved) == pytest.approx(-10.0 * strain, abs=1e-12)


def test_closure_weights_each_node_of_a_wall_by_its_area(block):
    """1 mm at the lower wall's corner, which stands for a quarter of a 5 m cell's face of the wall's 10 x 30 m."""
    moved = np.zeros((len(block.nodes), 3))
    moved[(block.nodes == block.lower).all(axis=1), 0] = 1e-3
    assert block.closure(moved) == pytest.approx(1e-3 * 0.25 * 25.0 / 300.0)


def test_rock_flows_in_the_coulomb_problem():
    """Else it would be the elastic one again: walls close by a tenth more at least (4,644 cells)."""
    elastic, coulomb = (
        ours.run(SETTINGS.mine(Case(problem, "multigrid", 3)))[0]["closure"] for problem in ("elastic", "coulomb")
    )
    assert elastic > 4e-3
    assert coulomb > 1.1 * elastic


def test_cells_that_follow_the_rock_fail_the_same_rock():
    """Fewer cells than the regular grid's 11,200, the same failed volume, and walls that close as much."""
    regular, adaptive = (ours.run(SETTINGS.mine(Case("brittle", code, 4)))[0] for code in ("multigrid", "adaptive"))
    assert regular["cells_at_end"] == 20 * 28 * 20
    assert adaptive["cells_at_end"] < 0.8 * regular["cells_at_end"]
    assert regular["failed_volume"] > 500.0
    assert adaptive["failed_volume"] == pytest.approx(regular["failed_volume"], rel=0.02)
    assert adaptive["closure"] == pytest.approx(regular["closure"], rel=SETTINGS.codes["adaptive"].within)


def row(code: str, cells: int, **values) -> dict:
    """A made-up row that ran on a quiet machine."""
    given = {"problem": "elastic", "code": code, "cells": cells, "unknowns": 3 * cells, "across": 1, "outcome": DONE}
    given |= {"cell": 1.0, "cells_at_end": cells, "failed_volume": 0.0}
    given |= {"remark": "", "machine": "a machine", "begun": "2020-01-01 00:00:00", "threads": 2}
    given |= {"others": 0.01, "version": "1", "memory": 1e-6 * cells, "iterations": 7, "repetitions": 1}
    return given | values


def made_up_rows() -> list[dict]:
    """Multigrid at 2 µs per cell, explicit at ten times that until it is not run, and a peer that disagrees."""
    rows = []
    for cells in (1000, 10000, 100000):
        for code, cost, closure in (("multigrid", 2e-6, 5e-3), ("multigrid_8", 4e-6, 4e-3), ("ogs", 2e-4, 5e-3)):
            seconds = cost * cells
            rows.append(row(code, cells, seconds=seconds, cpu_seconds=2 * seconds, closure=closure))
        if cells < 100000:
            rows.append(row("explicit", cells, seconds=2e-5 * cells, cpu_seconds=2e-5 * cells, closure=5.001e-3))
    kept = ("problem", "code", "cells", "unknowns", "across", "cell", "machine", "begun", "threads")
    unsolved = {key: value for key, value in row("explicit", 100000).items() if key in kept}
    return [*rows, unsolved | {"outcome": NOT_RUN, "remark": "about 900 s foreseen"}]


def test_table_takes_ratios_on_the_same_mesh():
    """Wall and processor ratios to multigrid, nothing where a code did not run; closures beside their partner's."""
    table = make_table(SETTINGS, made_up_rows()).set_index(["code", "cells"])
    assert table.loc[("ogs", 10000), "ratio"] == pytest.approx(100.0)
    assert table.loc[("explicit", 10000), "cpu_ratio"] == pytest.approx(5.0)
    assert table.loc["multigrid", "us_per_cell"].to_numpy() == pytest.approx(2.0)
    assert np.isnan(table.loc[("explicit", 100000), "ratio"])
    assert table.loc[("explicit", 1000), "agrees"] == "yes"
    assert table.loc[("ogs", 1000), "difference"] == pytest.approx(0.25)
    assert table.loc[("ogs", 1000), "agrees"] == "no"


def test_tables_of_the_page_say_who_disagrees_what_was_not_run_and_whether_the_machine_was_busy():
    results = {str(number): row for number, row in enumerate(made_up_rows())}
    table = STUDY.tables(results)["table"]
    assert len(table) == 12
    lines = [line for shown in STUDY.shown for line in shown.lines(table)]
    assert "| elastic | ogs | multigrid_8 | 1000 | 0.25 |" in lines
    assert "| elastic | explicit | 100,000 | not run | about 900 s foreseen |" in lines
    assert "| a machine | 2 |" in lines
    assert not table.busy.any()
    busy = STUDY.tables({name: row | {"others": 1.0} for name, row in results.items()})["table"]
    assert busy.busy.eq("yes").sum() == len(busy)
    assert len(STUDY.figures(results)["figure"].axes) == 2 * len(SETTINGS.problems)


def earlier(*measured: tuple[int, float, float]) -> list[dict]:
    return [row("ogs", cells, seconds=seconds, memory=memory) for cells, seconds, memory in measured]


def test_a_case_is_left_out_when_the_smaller_ones_show_that_it_would_exceed_a_limit():
    """Time grows by the power seen between the last two sizes, between 1 and 2; memory by what each cell added."""
    limit, most = 100.0, 20.0
    assert foreseen(1000, [], limit, most) == ""
    assert foreseen(2000, earlier((1000, 0.49 * limit, 0.1)), limit, most) == ""
    assert "s foreseen" in foreseen(2000, earlier((1000, 0.51 * limit, 0.1)), limit, most)
    assert "s foreseen" in foreseen(2000, earlier((500, 0.1 * limit, 0.1), (1000, 0.4 * limit, 0.1)), limit, most)
    assert "GB foreseen" in foreseen(2000, earlier((1000, 1.0, 0.51 * most)), limit, most)
    assert "GB foreseen" in foreseen(3000, earlier((1000, 1.0, 0.3 * most), (2000, 2.0, 0.7 * most)), limit, most)
    assert foreseen(3000, earlier((1000, 1.0, 0.5 * most), (2000, 2.0, 0.7 * most)), limit, most) == ""
    stopped = [{"cells": 1000, "outcome": STOPPED, "remark": "took more than 9 s"}]
    assert foreseen(2000, stopped, limit, most) == "1,000 cells: took more than 9 s"


def test_a_code_may_have_a_time_limit_of_its_own():
    text = yaml.safe_load(FILE.read_text()) | {"time_limit": "70 s"}
    text["codes"]["explicit"]["time_limit"] = "5 min"
    settings = parse(text)
    assert [settings.time_limit_of(code) for code in ("explicit", "ogs")] == [300.0, 70.0]
    text["codes"]["explicit"]["time_limit"] = "5 GB"
    with pytest.raises(InputError, match=r"codes\.explicit\.time_limit: .*GB"):
        parse(text)


BEGINS = 'print(json.dumps({"begins": True}), flush=True)'


def python(code: str) -> list[str]:
    return [sys.executable, "-c", f"import json, subprocess, sys, time; {code}"]


def test_what_a_rule_tells_its_stage_is_not_told_to_codes(monkeypatch):
    """A stage ends with the parent that the rule names, and imports nothing from the folder of a script."""
    monkeypatch.setenv(PARENT, "1")
    monkeypatch.setenv("PYTHONSAFEPATH", "1")
    answer = {"seconds": 1.0, "converged": True, "reason": ""}
    code = f"import os; assert not {{'{PARENT}', 'PYTHONSAFEPATH'}} & set(os.environ)"
    found = watch(python(f"{code}; {BEGINS}; print({json.dumps(json.dumps(answer))})"), 1, 60.0, 10.0)
    assert found == (DONE, [answer])


def test_a_process_is_heard_to_its_end():
    """What it announced, or the last line of what it complained of."""
    answer = {"seconds": 1.0, "converged": True, "reason": ""}
    assert watch(python(f"{BEGINS}; print('noise'); print({json.dumps(json.dumps(answer))})"), 1, 60.0, 10.0) == (
        DONE,
        [answer],
    )
    outcome, answers = watch(python("sys.exit('no such mesh')"), 1, 60.0, 10.0)
    assert outcome == FAILED
    assert "no such mesh" in answers[-1]["reason"]


def is_alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_a_process_is_ended_at_its_limits_with_all_that_it_started(tmp_path):
    """Time counts from the line that says that the solution begins."""
    number_of_child = tmp_path / "child"
    child = f"child = subprocess.Popen(['sleep', '600']); open({str(number_of_child)!r}, 'w').write(str(child.pid)); "
    slow = watch(python(f"{child}{BEGINS}; time.sleep(600)"), 1, 0.3, 10.0)
    assert slow == (STOPPED, [{"reason": "took more than 0.3 s"}])
    start, pid = time.perf_counter(), int(number_of_child.read_text())
    while is_alive(pid):
        assert time.perf_counter() - start < 60.0  # a killed process takes a moment to go
        time.sleep(0.05)
    assert watch(python(f"{BEGINS}; time.sleep(600)"), 1, 60.0, 1e-6)[0] == STOPPED


def test_cases_wait_for_each_other_and_for_the_smaller_ones():
    """One row of all cases, so that none runs beside another; nothing waits for itself."""
    cases = Cases(Studies(FOLDER, default_settings()))
    case = Case("coulomb", "ogs", SETTINGS.problems["coulomb"].cells_across[2])

    class Wildcards:
        target, case = "benchmarks", f"coulomb-ogs-{SETTINGS.problems['coulomb'].cells_across[2]}"

    runs = cases.files("benchmarks")
    before = cases.inputs(Wildcards)
    place = runs.index(f"results/benchmarks/cases/{case.name}.json")
    assert before[-1] == runs[place - 1]
    smaller = cases.smaller(case.name)
    assert [Path(file).stem for file in smaller] == [
        f"coulomb-ogs-{across}" for across in SETTINGS.problems["coulomb"].cells_across[:2]
    ]
    assert set(smaller) < set(before)
    assert all(runs.index(file) < place for file in before)
    assert cases.options(Wildcards) == f"--input earlier {' '.join(smaller)}"
    assert SETTINGS.case(case.name) == case
    with pytest.raises(InputError, match=r"benchmarks\.yaml: asks for no case coulomb-fenicsx-4"):
        SETTINGS.case("coulomb-fenicsx-4")


def test_settings_name_what_is_wrong():
    """A mistake is one line that names file and key."""
    with pytest.raises(InputError, match=r"benchmarks\.yaml: .*: missing"):
        parse({"threads": 2})


def test_problems_name_codes_that_there_are():
    text = yaml.safe_load(FILE.read_text())
    text["problems"]["brittle"]["codes"] = ["multigrid", "moose"]
    with pytest.raises(InputError, match=r"problems\.brittle\.codes: no 'moose'; there are multigrid, "):
        parse(text)
    del text["problems"]["brittle"]["codes"]
    with pytest.raises(InputError, match=r"problems\.brittle\.codes: missing"):
        parse(text)


def test_cases_of_a_problem_are_its_codes_at_its_sizes():
    """FEniCSx has no Coulomb rock, and a step in brittle rock has sizes of its own."""
    cases = SETTINGS.cases()
    assert {case.problem for case in cases if case.code == "fenicsx"} == {"elastic"}
    assert {case.across for case in cases if case.problem == "brittle"} == {4, 8, 16, 32}
    assert len(set(cases)) == len(cases)
    assert [case.across for case in cases] == sorted(case.across for case in cases)


def test_a_peer_of_the_system_is_left_out_where_its_module_is_missing(tmp_path):
    with pytest.raises(Unavailable, match=r"not installed: the system's Python has no module no_such_module"):
        peer_python(Code("a peer", script="ogs_stope.py", module="no_such_module"), tmp_path)


def test_packages_of_the_peers_are_pinned():
    """Else a run today would not be the run of tomorrow. Packages of the system are named in the table's versions."""
    for code in SETTINGS.codes.values():
        if code.script:
            assert (PEERS / code.script).exists()
        if code.requirements:
            assert all("==" in line for line in (PEERS / code.requirements).read_text().split())


def test_the_first_case_is_made_by_its_rule(tmp_path):
    """The rule's environment once reached the codes, which ended at once: no case of the page could be made."""
    target = f"results/benchmarks/cases/{SETTINGS.cases()[0].name}.json"
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--directory", str(tmp_path)]
    done = subprocess.run([*command, "--cores", str(SETTINGS.threads), target], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / target).read_text())["result"]
    assert found["outcome"] == DONE
    assert 4e-3 < found["closure"] < 6e-3
