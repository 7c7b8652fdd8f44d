"""The disc between platens on coarse cells: geometry and force by hand, and the crack that splits it."""

import numpy as np
import pytest
from running import run_study

from common.part_centers import part_centers
from verification.answers.brazilian_disc.crack import read_crack
from verification.answers.brazilian_platens import PlatenDisc, answer, stages_of, through_moment


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """Steel platens, cells of 4 mm: the results."""
    return run_study("brazilian_platens", tmp_path_factory.mktemp("platens"), ["steel"], **{"grid.coarse_cell": "4 mm"})


def test_the_disc_is_read_from_the_outline_and_the_force_balances(coarse):
    """Radius 40 mm, arcs of 20 degrees; the force through the mid-plane is that through the platens, to a per cent."""
    disc = PlatenDisc("steel", coarse["steel"])
    assert disc.disc.radius == pytest.approx(0.04, rel=1e-4)
    assert np.degrees(disc.disc.half_arc) == pytest.approx(10.0, abs=0.01)
    assert disc.closing("failure", 0.5) == pytest.approx(5.2e-4 * 0.088)
    state = coarse["steel"].elastic
    top = part_centers(state)[:, 1] > 0.040
    through_platen = -np.sum(state.stress.values[top, 1] * state.volume.values[top]) / disc.cell_size
    assert disc.force(state) == pytest.approx(through_platen, rel=0.01)
    assert disc.force(state) > 4e3


def test_a_crack_runs_through_every_layer_along_the_loaded_diameter(coarse):
    """It opens across the load, and hardly any rock beside the diameter fails before it has run through.

    That is within three quarters of the radius: beyond, cells of 4 mm fail under the platens' edges, too. 5 mm are one
    cell on either side here; the study's 2 mm are held to 0.98 of all potency and 3 degrees.
    """
    crack = read_crack(PlatenDisc("steel", coarse["steel"]))
    moment = through_moment(crack, 0.85)
    assert moment is not None
    spans = crack.layer_spans(moment.generation)
    assert len(spans) == 10
    assert spans.min() >= 0.85
    inner = (crack.rank <= moment.generation) & (np.abs(crack.place[:, 1]) < 0.03)
    close = np.abs(crack.place[:, 0]) <= 5e-3
    assert crack.potency[inner & close].sum() > 0.9 * crack.potency[inner].sum()
    assert crack.opening_axis_angle(moment) < 10.0
    stages = stages_of(crack, 0.85)
    assert len(stages) == 6
    assert [stage.generation for stage in stages] == sorted(stage.generation for stage in stages)


def test_rows_and_figure(coarse):
    rows, figure = answer(coarse)
    bounded = [row for row in rows if row.passed is not None]
    assert [round(row.expected) for row in bounded] == [1, 0]
    assert all("run through" in row.quantity or "until then" in row.quantity for row in bounded)
    assert sum("events" in row.quantity for row in rows) >= 4
    assert len(figure.axes) == 9
