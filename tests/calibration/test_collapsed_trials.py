"""Trials in which rock finds no equilibrium: what the fit leaves out, and what it refuses."""

from types import SimpleNamespace

import numpy as np
import pytest

from calibration.page import Trials, warnings
from calibration.stages import TrialCatalogues
from common.errors import InputError
from common.event_table import new_catalog, write_events
from seismic.catalog import join_extractions

REPLICATES = 2


def write_trial(path, sizes, collapsed=""):
    """A file of a trial with one catalogue for each list of potencies (m3)."""
    sets = [
        new_catalog(len(some), {"mine": "m", "kind": "synthetic", "potency_floor": 0.01}, potency=np.array(some, float))
        for some in sizes
    ]
    write_events(join_extractions(sets).assign_attrs(collapsed=collapsed, potency_before_record=1.0), path)
    return path


def read(folder, lost=(), lost_finer=(), trials=6, sets=2):
    """Two replicates and four designed trials, three of which are run on finer cells; points are their numbers."""
    reason = "step one: caving"
    files = [
        write_trial(folder / f"{n}.nc", [[float(n + 1)]] * sets, reason if n in lost else "") for n in range(trials)
    ]
    finer = [
        write_trial(folder / f"finer_{n}.nc", [[10.0 * (n + 1)]] * sets, reason if n in lost_finer else "")
        for n in range(REPLICATES, REPLICATES + 3)
    ]
    points = np.repeat(np.arange(float(trials)), sets)[:, None]
    return TrialCatalogues.read(points, files, finer, REPLICATES)


def sizes(catalogues):
    return [one["potency"].values.tolist() for one in catalogues]


def test_all_trials_that_stand_are_read(tmp_path):
    found = read(tmp_path)
    assert found.trials.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert (found.paired, found.collapsed) == ([2, 3, 4], {})
    assert sizes(found.finer) == [[30.0]] * 2 + [[40.0]] * 2 + [[50.0]] * 2


@pytest.mark.parametrize(("lost", "lost_finer"), [((2,), ()), ((), (2,)), ((2,), (2,))])
def test_a_trial_that_collapses_on_any_of_its_cells_leaves_with_its_pair(lost, lost_finer, tmp_path):
    """Numbers of the others stay; a pair has both of its runs or none."""
    found = read(tmp_path, lost, lost_finer)
    assert found.trials.tolist() == [0, 0, 1, 1, 3, 3, 4, 4, 5, 5]
    assert found.points[:, 0].tolist() == found.trials.tolist()
    assert sizes(found.rows) == [[float(n + 1)] for n in found.trials]
    assert found.paired == [3, 4]
    assert sizes(found.finer) == [[40.0]] * 2 + [[50.0]] * 2
    assert found.collapsed == {2: "step one: caving"}


def test_a_replicate_that_collapses_leaves_all_pairs(tmp_path):
    found = read(tmp_path, lost=(0,))
    assert found.paired == [2, 3, 4]
    assert sorted(set(found.trials)) == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(("lost", "lost_finer"), [((2, 4, 5), ()), ((2,), (3,))])
def test_a_calibration_with_too_few_trials_that_stand_is_refused(lost, lost_finer, tmp_path):
    """More than half of those that are no replicates, or all pairs but one."""
    with pytest.raises(
        InputError, match=r"calibration.quantities: rock found no equilibrium in \d of 6 trials.*narrow"
    ):
        read(tmp_path, lost, lost_finer)


def test_the_page_names_the_trials_that_are_left_out():
    fit = SimpleNamespace(fits=True, posterior=SimpleNamespace(implausibility=1.0))
    not_told = SimpleNamespace(is_told=False)
    tests = SimpleNamespace(beyond=not_told, law=not_told, instruments=None)
    names = ["1", "2", "3", "4"]
    listed = Trials(names, ["replicate", "design", "collapsed", "collapsed"], 0, {2: "step one: caving", 3: "-"}, False)
    said = warnings(fit, [], tests, listed)
    assert len(said) == 1
    assert said[0].startswith("Rock found no equilibrium in 2 of 4 trials (3, 4; 3 in step one: caving).")
    assert warnings(fit, [], tests, Trials(names, ["design"] * 4, 0, {}, False)) == []
