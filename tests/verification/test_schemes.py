"""The two schemes beside each other, and moving beside resting particles: reduced scenes, and statistics of runs."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from hypothesis import given
from hypothesis import strategies as st
from running import DEFAULT, STUDIES, run_study
from scipy.stats import ttest_ind, ttest_rel

from common.errors import InputError
from seismic.events import extract_events
from verification.answers import moving, schemes
from verification.answers.schemes import LABELS, Pairs, Run, draw
from verification.results import Variant
from verification.rows import Row
from verification.studies import load_study

COARSER = {"tunnel": 4, "sphere": 3, "mine": 2}  # levels of the grid; the study has one more


@pytest.mark.parametrize("scene", COARSER)
def test_elastic_stress_of_a_coarser_scene_is_the_same_by_all_ways(scene, tmp_path):
    """Cells of twice the size: to ten times the tolerance (measured 1e-8); a thousandth too little motion is 1e-5."""
    names = [f"{scene}_{way}" for way in ("scaled", "true", "multigrid")]
    rows, _ = schemes.answer(run_study("schemes", tmp_path, names, **{"grid.levels": COARSER[scene]}))
    assert len(rows) == 3
    assert all(row.passed and 0.0 < row.error < 1e-6 for row in rows), rows


def test_brittle_tunnel_fails_alike_on_average(tmp_path):
    """Three paths for each scheme, within the study's bounds; the paths matter, so this is not one run six times."""
    results = run_study("schemes", tmp_path, ["brittle_tunnel_explicit", "brittle_tunnel_multigrid"])
    pairs = schemes.read_pairs(tuple(results.variants.values()), [2, 5, 6])
    rows = schemes.brittle_rows("tunnel", pairs, results.allowed)
    assert [row.passed for row in rows] == [True] * 5 + [None] * 2, rows  # there are too few events for b
    assert rows[0].expected > 0.0
    for runs in pairs.runs.values():
        failed = [run.failed.sum() for run in runs]
        assert max(failed) > 1.2 * min(failed)
    axes = draw({}, {"tunnel": pairs}).get_axes()
    assert [panel.get_ylabel() for panel in axes] == list(LABELS.values())


@pytest.mark.parametrize("levels", [4, 5])
def test_in_a_mirror_the_very_same_rock_fails(tmp_path, levels):
    """The tunnel's middle lies on a corner of four cells, or (4 levels) in the middle of one. Potency to the tolerance
    of equilibrium, which is reached by other sums."""
    names = ["brittle_tunnel_multigrid", "mirrored_tunnel"]
    results = run_study("schemes", tmp_path, names, **{"grid.levels": levels})
    here, mirrored = (results.variants[name].step("mining") for name in names)

    def by_place(state, position):
        order = np.lexsort(position.T)
        return position[order], state.failed.values[order], state.volume.values[order]

    place = by_place(here, here.position.values)
    turned = by_place(mirrored, np.array([192.0, 0.0, 0.0]) + mirrored.position.values * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(turned[0], place[0], atol=1e-9)
    np.testing.assert_array_equal(turned[1], place[1])
    np.testing.assert_array_equal(turned[2], place[2])
    assert (place[1] >= 0).sum() > 10
    potency = [np.abs(state.seismic_strain.values * state.volume.values[:, None]).sum() for state in (here, mirrored)]
    assert potency[1] == pytest.approx(potency[0], rel=1e-3)


def made_up(potency: float, sizes=(), failed=(True, False)) -> Run:
    return Run(potency, 2.0 * potency, np.array(failed), np.array(sizes, float), 1e-3, 7, 0)


@given(st.lists(st.tuples(st.floats(1.0, 9.0), st.floats(1.0, 9.0)), min_size=3, max_size=9))
def test_means_are_apart_by_what_students_tests_say(pairs):
    """Welch's statistic for independent runs, that of paired differences for their standard error."""
    first, other = np.array(pairs).T + np.arange(len(pairs)) ** 2 * [[1.0], [1.1]]
    means = schemes.Means(first, other)
    np.testing.assert_allclose(means.apart, abs(ttest_ind(other, first, equal_var=False).statistic), rtol=1e-7)
    paired = ttest_rel(other, first).statistic
    if np.isfinite(paired) and abs(paired) < 1e6:
        np.testing.assert_allclose(means.difference, paired * means.pair_error, rtol=1e-6, atol=1e-12)


def test_equal_runs_are_not_apart_and_one_shifted_scheme_is():
    """No spread and no difference is agreement, no spread and a difference is none."""
    same = np.full(8, 3.0)
    assert schemes.Means(same, same).apart == 0.0
    assert not Row("", 3.0, 3.1, schemes.Means(same, same + 0.1).apart, 2.0).passed


def test_a_systematic_difference_smaller_than_the_spread_fails_by_pairs():
    """Runs from 1 to 8, one scheme always 3 % above: within two standard errors, but not within the bound of pairs."""
    runs = {
        "explicit": [made_up(potency, np.arange(11)) for potency in range(1, 9)],
        "multigrid": [made_up(1.03 * potency, np.arange(11), (True, True)) for potency in range(1, 9)],
    }
    allowed = {"standard_errors": 2.0, "pairs": 0.02}
    rows = schemes.brittle_rows("made up", Pairs(runs), allowed)
    verdicts = {row.quantity.split(": ")[1]: row.passed for row in rows}
    means, pairs = [value for name, value in verdicts.items() if name.startswith("seismic potency")]
    assert (means, pairs) == (True, False)
    assert rows[-1].obtained == 0  # other rock failed in every pair


def test_b_is_compared_from_one_cut_and_only_with_enough_events_in_every_run():
    """Ten from the largest floor on: here 1e-3 m3, so sizes of less do not count."""
    sizes = np.linspace(-2.9, 0.0, 10)
    enough = Pairs({"explicit": [made_up(1.0, sizes)], "multigrid": [made_up(1.0, [*sizes, -3.5])]})
    assert enough.has_b
    np.testing.assert_array_equal(*enough.values("b"))
    assert enough.values("events")[1] == 11
    few = Pairs({"explicit": [made_up(1.0, sizes)], "multigrid": [made_up(1.0, [*sizes[1:], -3.5])]})
    assert not few.has_b
    assert "9 to 10" in few.why_no_b


def test_members_of_an_ensemble_are_read_not_computed(tmp_path, monkeypatch):
    """With `ensemble` in the scene its members' steps are those of the results' folder."""
    variant = run_study("schemes", tmp_path, ["brittle_tunnel_multigrid"])["brittle_tunnel_multigrid"]
    states = schemes.compute(schemes.with_increments(variant.mine, 2), variant)
    asked = []

    def read(path: str):
        asked.append(path)
        return states[path.endswith("mining.nc")]

    monkeypatch.setattr(schemes, "compute", None)
    variant.mine.settings = variant.mine.settings.model_copy(update={"ensemble": 2})
    runs = list(schemes.read_runs(Variant(variant.mine, read), []))
    assert asked == [f"ensemble/{number}/steps/{step}.nc" for number in (1, 2) for step in ("history", "mining")]
    assert runs[0].failed_volume == states[-1].attrs["failed_volume"]
    budget = json.loads(extract_events(states[-1], variant.mine.catalogue_slice())[0].attrs["budget"])
    assert runs[0].potency == pytest.approx(budget["particle_scalars"])  # as `seismic` sums them


def from_demo(folder, **changes):
    mine = STUDIES.parent / "mines" / "demo.yaml"
    text = {"answer": "schemes", "title": "A mine", "scene_from": str(mine), "variants": {"all": None}} | changes
    path = folder / "borrowed.yaml"
    path.write_text(yaml.safe_dump(text))
    return load_study(path, DEFAULT)


def test_a_scene_may_be_that_of_a_mine(tmp_path):
    """The mine's file with what study and variant change; steps that a variant leaves out mine nothing."""
    first = [{"name": "history"}, {"name": "2019-08", "start": "2019-08-01", "end": "2019-09-01"}]
    study = from_demo(
        tmp_path,
        scene={"solver": {"tolerance": 1e-7}},
        variants={"all": None, "first": {"steps": first}, "elastic": {"steps": []}},
    )
    whole, first, elastic = (study.mines[name] for name in ("all", "first", "elastic"))
    assert whole.mined_steps == ["history", "2019-08", "2019-09", "2019-10"]
    assert whole.settings.solver.tolerance == 1e-7
    assert whole.settings.grid.buffer_cells == 1
    assert whole.settings.record is None
    assert (first.mined_steps, elastic.mined_steps) == (["history", "2019-08"], [])
    planned = {entry.name for entry in first.excavations if entry.step == "planned"}
    assert planned == {"stope_2", "stope_3", "stope_4"}
    assert {entry.name for entry in elastic.excavations if entry.step == "planned"} == planned | {"stope_1"}
    assert whole.grid_slice()["excavations"] == first.grid_slice()["excavations"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene_from": "nowhere.yaml"}, "nowhere.yaml: not readable"),
        ({"scene_from": "borrowed.yaml", "variants": {}}, "a scene needs variants"),
        ({"scene": {"grid": {"level": 2}}}, "variants.all: .*demo.yaml: grid.level: unknown key"),
    ],
)
def test_a_mistake_in_a_borrowed_scene_is_one_line(tmp_path, changes, message):
    with pytest.raises(InputError, match=message) as error:
        from_demo(tmp_path, **changes)
    assert "\n" not in str(error.value)


ELASTIC = ["resting_stiff", "moving_stiff", "resting_medium", "moving_medium", "resting_soft", "moving_soft"]


def test_difference_vanishes_with_the_displacement(tmp_path):
    """The elastic rows of the study, at its own size and bounds."""
    rows, closures = moving.elastic_rows(run_study("moving", tmp_path, ELASTIC))
    assert len(rows) == 4
    assert all(row.passed is not False for row in rows), rows
    closure, difference = np.array(closures).T
    np.testing.assert_allclose(closure / closure[0], [1.0, 10.0, 100.0], rtol=1e-6)
    assert (difference > 0.0).all(), "moving particles must change something"


def test_brittle_runs_that_differ_in_the_mean_are_told_apart():
    """Runs whose mean is one standard deviation apart are within two standard errors of four runs, five are not."""

    def run(potency):
        return Run(potency, 1.0, np.zeros(1, bool), np.zeros(0), 1.0, 1, 0)

    values = np.array([9.0, 11.0, 9.0, 11.0])
    for shift, passed in ((1.0, True), (5.0, False)):
        pairs = Pairs({"resting": [run(v) for v in values], "moving": [run(v + shift) for v in values]})
        potency = moving.brittle_rows("made up", pairs, 2.0)[0]
        assert potency.passed is passed
    brittle = SimpleNamespace(grid=xr.Dataset(attrs={"fine_cell": 1.0}))
    figure = moving.draw(brittle, [(1e-4, 1e-5), (1e-3, 1e-4), (1e-2, 1e-3)], pairs, [1, 2, 3, 4])
    assert [axes.get_title() for axes in figure.axes] == ["elastic", "brittle"]
