"""The studies of openings of any shape and of walls that lie anywhere, from numbers that are made up."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr
import yaml
from running import DEFAULT, STUDIES

from catalogs.compare.cell_error import error_at
from verification.answers import openings, walls
from verification.results import Results
from verification.studies import load_study

CELL = {"draft": 2.0, "three": 4.0 / 3.0, "standard": 1.0, "fine": 0.5, "finest": 0.25}
ENERGY = {"two": 0.9, "one": 0.5, "finest": 1.0}


def test_errors_bounds_and_extrapolations_are_those_of_the_numbers(monkeypatch):
    """Potency 1 - h / 10 (first order), volume of the pillar off by a fifth with standard, energy exact."""
    study = load_study(Path(STUDIES / "openings.yaml"), DEFAULT)

    def measure(name):
        scene, _, size = name.rpartition("_")
        volume = 0.8 if (scene, size) == ("pillar", "standard") else 1.0
        return openings.Found(1.0, 1.0 - CELL[size] / 10.0, volume, 1.0 / CELL[size], 0.5, size == "draft", 1.0)

    def variant(name):
        grid = xr.Dataset(attrs={"excavation_whole_share": "[0.4]" if name.endswith("two") else "[0.0]"})
        elastic = xr.Dataset(attrs={"energy_motion": ENERGY.get(name.rpartition("_")[2], 1.0)})
        return SimpleNamespace(grid=grid, elastic=elastic) if name.startswith("slot") else name

    monkeypatch.setattr(openings, "measure", measure)
    monkeypatch.setattr(openings, "energy_of_sphere", lambda name: 1.0)
    rows, figure = openings.answer(Results(study, {name: variant(name) for name in study.mines}))
    found = {row.quantity: row for row in rows}
    assert len(found) == len(rows) == 9 * 3 * 3 + 3 * 3 + 4 + 9 * 3 * 3 + 5 * 4 * 3 + 3 + 2 * 2 * 3 + 6
    assert found["sphere, standard: potency, m3"].error == pytest.approx(1 - 0.9 / 0.975)
    assert found["sphere, standard: potency, m3"].passed is False
    assert found["sphere, standard: volume, m3"].passed
    assert found["sphere, draft: potency, m3"].passed is None
    assert found["pillar, standard: volume, m3"].passed is False
    assert found["sphere, moved: draft, half, m3"].error == pytest.approx(1 - 0.8 / 0.975)
    assert found["standard beside draft: volume, share of runs within the stated uncertainty"].obtained == 35 / 36
    assert found["fine beside standard: potency extrapolated, r.m.s. error over the scenes"].obtained == pytest.approx(
        1.0 / 0.975 - 1
    )
    assert found["stope, half, three cells across: potency, m3"].error == pytest.approx(1 - (1 - 2 / 15) / 0.975)
    over_places = "three cells across, all places: {}, r.m.s. error over the scenes"
    assert found[over_places.format("energy")].passed
    assert found[over_places.format("potency")].passed is False
    assert found["slot, dip 45, two cells across: energy, J"].passed is False
    assert found["slot, dip 45, one cell across: energy, J"].passed is None
    assert len(figure.axes) == 3


def test_uncertainties_that_miss_the_finest_run_or_are_too_wide_are_counted():
    """Of three runs with failed rock one cell thick the errors are four thirds, two thirds and a third of the law's."""

    def run(potency: float, thickness: float = 1.0) -> openings.Found:
        return openings.Found(1.0, potency, 1.0, thickness, 0.5, False, 1.0)

    stated = error_at(1.0)
    runs = [[run(1.0, 0.1), run(1.0), run(math.exp(share * stated))] for share in (4 / 3, -2 / 3, 1 / 3)]
    rows = openings.coverage("x", "potency", runs, 0.9)
    assert [row.obtained for row in rows] == pytest.approx([2 / 3, 1 / 3])
    assert rows[0].passed is False


def test_energy_of_the_sphere_is_that_of_lame_in_even_stress():
    """p^2 V 3 / (8 G) for a cavity in all-round stress p (u = p a / 4 G)."""
    study = load_study(Path(STUDIES / "openings.yaml"), DEFAULT)
    values = study.mines["sphere_finest"].settings.given()
    p, radius = 20e6, 5.0
    insitu = SimpleNamespace(at=lambda elevation: openings.np.array([[-p, -p, -p, 0.0, 0.0, 0.0]]))
    variant = SimpleNamespace(values=values, scene=lambda: SimpleNamespace(insitu=insitu))
    modulus = 57e9 / 2.5
    assert openings.energy_of_sphere(variant) == pytest.approx(
        p**2 * 3 / (8 * modulus) * 4 / 3 * openings.np.pi * radius**3
    )


def test_limit_spread_and_extrapolation_are_those_of_the_potencies(monkeypatch):
    """Potency 2 (1 + h / 10 m) on faces, h the cell: the limit is 2. Moved by a half: a tenth less."""
    study = load_study(Path(STUDIES / "walls.yaml"), DEFAULT)
    size = {"4": 2.5, "8": 1.25, "16": 0.625}

    def potency(name):
        part = next(part for part in name.split("_") if part in size)
        return 2.0 * (1.0 + size[part] / 10.0) * (0.9 if "half" in name else 1.0)

    monkeypatch.setattr(walls, "released", potency)
    names = yaml.safe_load((STUDIES / "walls.yaml").read_text())["variants"]
    rows, figure = walls.answer(Results(study, {name: name for name in names}))
    found = {row.quantity: row for row in rows}
    assert len(found) == len(rows) == 2 + 3 + 6 * 7 + 3 + 2  # the last: runs with other fill
    assert found["filled: limit of the potency of ever smaller cells, m3"].obtained == pytest.approx(2.0)
    assert found["filled, 8 cells across, mean, half: potency, m3"].error == pytest.approx(0.0125)
    assert found["filled, 8 cells across, mean, quarter: potency, m3"].passed is False
    assert found["filled, 8 cells across, whole, half: potency, m3"].passed is None
    assert found["filled, 4 cells across, mean, unturned: spread of potency over placements"].error == pytest.approx(
        0.1 / 0.975
    )
    assert found["filled, 4 cells across, mean, turned: spread of potency over placements"].error == 0.0
    assert found["filled, half, mean: potency extrapolated, m3"].obtained == pytest.approx(1.8)
    assert len(figure.axes) == 3
