"""Derived domains: the study on larger cells, and that it would see a boundary that is too near."""

import pytest
from running import run_study

from verification.answers.far_field import Rock, answer, largest_difference

FLAT = ["hole_uniaxial", "hole_uniaxial_wide", "hole", "hole_wide", "hole_rings"]
ROUND = ["sphere_uniaxial", "sphere_uniaxial_wide"]


def cells(variants: list[str], size: str, folder):
    """Variants of the study in larger cells; the domains stay."""
    return run_study("far_field", folder, variants, **{"grid.finest_cell": size})


@pytest.mark.parametrize(("variants", "size"), [(FLAT, "1 m"), (ROUND, "2 m")])
def test_no_wall_stress_moves_by_half_a_per_cent(tmp_path, variants, size):
    """Nor by more than the rule expects; the figure is drawn."""
    rows, figure = answer(cells(variants, size, tmp_path))
    moved = [row for row in rows if "boundary moves" in row.quantity or "the rule expects" in row.quantity]
    assert len(moved) == 2 * sum(f"{name}_wide" in variants for name in variants)
    assert all(row.passed and row.error > 0.0 for row in moved)
    assert all(row.passed for row in rows if "beside that of infinite rock" not in row.quantity)
    assert len(figure.axes) == 2


def test_a_boundary_at_three_radii_would_be_seen(tmp_path):
    """A fixed box of 64 m around a hole of 20 m moves its wall stress by far more."""
    near = {
        name: {
            "plane": "xy",
            "domain": {"lower": [f"-{half} m"] * 2, "upper": [f"{half} m"] * 2},
            "grid": {"particles_per_cell": 4},
            "excavations": [{"name": "hole", "step": "history", "shape": "circle", "center": ["0 m", "0 m"],
                             "radius": "10 m", "fill": "none"}],
        }
        for name, half in (("near", 32), ("near_wide", 64))
    }  # fmt: skip
    results = run_study("far_field", tmp_path, near)
    assert largest_difference(Rock(results["near"]), Rock(results["near_wide"]), 2.0)[0] > 0.05
    shifted = {"domain.lower": ["-31.5 m"] * 2, "domain.upper": ["32.5 m"] * 2}
    other = Rock(run_study("far_field", tmp_path, near, **shifted)["near"])
    with pytest.raises(ValueError, match="must be aligned"):
        largest_difference(Rock(results["near"]), other, 2.0)
