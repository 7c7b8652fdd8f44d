"""What all laws of failure have in common, and two of them as one."""

import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mechanics import von_mises
from mechanics.scenes import COULOMB, FILL
from numba import njit
from pydantic import TypeAdapter, ValidationError

from common.setting_types import SI, mistake_lines
from mpm_core.constitutive import laws
from mpm_core.constitutive.general import lane_by_lane
from mpm_core.constitutive.laws import LAWS, any_material, can_fail, coulomb, law_of_all, rows_of_all
from mpm_core.constitutive.mixture import mix
from mpm_core.settings import ElasticMaterial, lame_parameters
from mpm_core.simd.lanes import LANES, load, load_row, store

from .law_twins import matrix

ROCK = lame_parameters(57e9, 0.25)
VON_MISES = {key: FILL[key] for key in ("youngs_modulus", "poisson_ratio", "density")} | {
    "model": "von_mises",
    "yield_stress": {"intact": 8e6, "residual": 3e6},
}
MIXTURE = mix(coulomb, von_mises)
OFFERED = ("NAME", "Material", "ROW_LENGTH", "strength_rows", "overstress_of_tensor", "surely_admissible",
           "overstress", "return_to_surface", "return_lanes", "stiffness_reduction", "strength_factor",
           "excess_shear_stress", "strength_size", "gains_energy")  # fmt: skip


def materials():
    """Host Coulomb, elastic fill, a body of von Mises."""
    adapter = TypeAdapter(any_material((coulomb, von_mises)))
    return [adapter.validate_python(values, context=SI) for values in (COULOMB, FILL, VON_MISES)]


def stresses(count, seed=3):
    """Tensors (Pa) that the laws here return, or do not, about evenly."""
    random = np.random.default_rng(seed)
    return random.normal(size=(count, 6)) * 10 ** random.uniform(5, 7, (count, 1)) - np.array([8e6, 8e6, 8e6, 0, 0, 0])


@pytest.mark.parametrize("law", [*LAWS, von_mises], ids=lambda law: law.NAME)
def test_a_law_offers_what_is_asked_of_it(law):
    assert [name for name in OFFERED if not hasattr(law, name)] == []
    assert all(f"| {name}" in laws.__doc__ for name in OFFERED)


def test_a_material_is_that_of_its_law():
    rock, fill, other = materials()
    assert isinstance(rock, coulomb.Material)
    assert isinstance(fill, ElasticMaterial)
    assert isinstance(other, von_mises.Material)
    assert [can_fail(material) for material in (rock, fill, other)] == [True, False, True]
    assert other.shear_modulus == fill.shear_modulus


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"model": "clay"}, "model: 'clay' is not one of elastic, coulomb, von_mises"),
        ({"model": "colomb"}, "model: 'colomb' is not one of elastic, coulomb, von_mises; did you mean coulomb?"),
        (
            {"cohesion": {"intact": 1.0, "residual": 1.0}},
            "cohesion: not used by model von_mises, by coulomb only; leave it out",
        ),
        ({"yield_stress": {"intact": 1.0, "residual": 2.0}}, "yield_stress: residual is above intact"),
        ({"colour": 1}, "colour: unknown key"),
    ],
)
def test_what_a_law_refuses_names_the_key(changes, line):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(any_material((coulomb, von_mises))).validate_python(VON_MISES | changes, context=SI)
    (found,) = mistake_lines(caught.value)
    assert found.startswith(line)


def test_rows_of_a_scene_have_those_of_each_law(monkeypatch):
    """A mixture's row says of which law it is; where there is one law, rows are its own; none for elastic rock."""
    monkeypatch.setattr(laws, "LAWS", (coulomb, von_mises))
    rock, fill, other = materials()
    assert law_of_all([rock, fill]) is coulomb
    assert law_of_all([fill]) is coulomb
    assert law_of_all([other]) is von_mises
    assert law_of_all([other, fill, rock]) is MIXTURE
    intact, residual = rows_of_all(MIXTURE, [rock, fill, other], (0, 1, 2))
    np.testing.assert_array_equal(intact[0], [0.0, *coulomb.strength_rows(rock, (0, 1, 2))[0]])
    assert np.isnan(intact[1]).all()
    np.testing.assert_array_equal(residual[2], [1.0, 3e6, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(
        rows_of_all(coulomb, [rock], (0, 1, 2))[1][0], coulomb.strength_rows(rock, (0, 1, 2))[1]
    )


@pytest.mark.parametrize("law", [coulomb, von_mises], ids=lambda law: law.NAME)
def test_a_mixture_does_what_its_law_does(law):
    """Every function, to the bit, at the mixture's row of this law."""
    material = materials()[0 if law is coulomb else 2]
    row = law.strength_rows(material, (0, 1, 2))[1]
    own, mixed = tuple(row), tuple(MIXTURE.row_of(law, row))
    one, other = np.zeros((6, 6)), np.zeros((6, 6))
    yielding = 0
    for stress in stresses(100):
        for name in ("surely_admissible", "overstress", "strength_factor", "excess_shear_stress"):
            assert getattr(MIXTURE, name)(*stress, mixed) == getattr(law, name)(*stress, own)
        returned = law.return_to_surface(*stress, *ROCK, own)
        assert MIXTURE.return_to_surface(*stress, *ROCK, mixed) == returned
        yielding += law.stiffness_reduction(*stress, *ROCK, own, one)
        MIXTURE.stiffness_reduction(*stress, *ROCK, mixed, other)
        np.testing.assert_array_equal(one, other)
        assert law.overstress(*stress, own) == pytest.approx(law.overstress_of_tensor(matrix(stress), row), abs=1e-5)
    assert 20 < yielding < 100
    assert MIXTURE.strength_size(mixed) == law.strength_size(own)
    assert MIXTURE.gains_energy(mixed) == law.gains_energy(own)


def test_a_mixture_of_a_mixture_keeps_rows_apart():
    """Three laws, of which the third is Coulomb again: its rows go to it."""
    three = mix(MIXTURE, coulomb)
    assert three is mix(MIXTURE, coulomb)
    row = von_mises.strength_rows(materials()[2], (0, 1, 2))[0]
    assert three.row_of(von_mises, row).tolist() == [0.0, 1.0, 8e6, 0.0, 0.0, 0.0, 0.0]
    assert three.overstress(0.0, 0.0, 0.0, 0.0, 0.0, 8e6, tuple(three.row_of(von_mises, row))) > 5e6


LENGTH = MIXTURE.ROW_LENGTH
coulomb_one_by_one = lane_by_lane(coulomb.return_to_surface)


@njit
def return_eight(numbers, returned):
    """numbers (6 stress, 2 moduli, row; lane) and returned (6, lane), flat."""
    row = load_row(numbers, 8 * LANES, LENGTH)
    stress = load_row(numbers, 0, 6)
    result = MIXTURE.return_lanes(*stress, load(numbers, 6 * LANES), load(numbers, 7 * LANES), row)
    for k in range(6):
        store(returned, k * LANES, result[k])


@pytest.mark.parametrize("which", ["first", "second", "both"])
def test_eight_returns_of_a_mixture_are_those_of_each_law(which):
    """Eight of one law together, or some of each; to round-off of the stress."""
    rows = [MIXTURE.row_of(law, law.strength_rows(material, (0, 1, 2))[1])
            for law, material in zip((coulomb, von_mises), materials()[::2], strict=True)]  # fmt: skip
    of_lane = {"first": [0] * LANES, "second": [1] * LANES, "both": [0, 1] * (LANES // 2)}[which]
    for batch in stresses(50 * LANES).reshape(-1, LANES, 6):
        chosen = np.array([rows[k] for k in of_lane])
        numbers = np.concatenate([batch, np.tile(ROCK, (LANES, 1)), chosen], axis=1)
        returned = np.empty((6, LANES))
        return_eight(numbers.T.ravel(), returned.ravel())
        for lane in range(LANES):
            expected = MIXTURE.return_to_surface(*batch[lane], *ROCK, tuple(chosen[lane]))[:6]
            np.testing.assert_allclose(returned[:, lane], expected, rtol=0, atol=1e-13 * np.abs(batch[lane]).max())


ASK = """
import numpy as np
from mechanics import von_mises
from mpm_core.constitutive.laws import coulomb
from mpm_core.constitutive.mixture import mix
from mpm_core.kernels.failure import make_overstress_of
for law in (coulomb, mix(coulomb, von_mises)):
    kernel = make_overstress_of(law)
    excess = np.empty(1)
    one, rows = np.zeros(1, np.int64), np.full((1, law.ROW_LENGTH), 2.0)
    kernel(one, np.zeros((1, 6)), np.ones((1, 6)), np.empty((0, 6)), np.zeros(1, np.int16), rows, np.empty(0), excess)
    print(excess[0], sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))
"""


def test_another_process_finds_what_was_compiled_for_each_law(tmp_path):
    """A kernel keeps which law it is for by the module's name, not by a number that differs in each process."""
    tests = Path(inspect.getfile(von_mises)).parent.parent
    mistake_lines = []
    for seed in ("1", "2"):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONHASHSEED": seed, "NUMBA_NUM_THREADS": "1"}
        environment["PYTHONPATH"] = os.pathsep.join([str(tests), str(tests.parent)])
        run = subprocess.run(
            [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True, timeout=300
        )
        mistake_lines.append([line.split() for line in run.stdout.splitlines()])
    first, second = mistake_lines
    assert [line[1:] for line in first] == [["0", "1"], ["0", "1"]]
    assert [line[1:] for line in second] == [["1", "0"], ["1", "0"]]
    assert [line[0] for line in first] == [line[0] for line in second]
    assert first[0][0] != first[1][0]
