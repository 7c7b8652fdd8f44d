"""The stope on cells that follow the rock: the study on larger cells, and that it would see a grid that does not."""

import yaml
from running import STUDIES, run_study

from common.costs import Costs
from verification.answers.refinement import Run, answer

LARGER = {"grid.coarse_cell": "20 m", "grid.volume_error": 1.0}
# Fine within 15 m of the stope, where all its rock fails: a coarse cell that is too stressed fails a row.
EVERYWHERE = {"grid": {"coarse_cell": "10 m", "levels": 4, "buffer_cells": 6, "refinement": "static"}}


def test_the_study_has_a_row_for_every_relation_and_its_figure(tmp_path):
    """On cells of 1.25 to 10 m; the finest ones, which are compared with each other alone, in one increment."""
    variants = yaml.safe_load((STUDIES / "refinement.yaml").read_text())["variants"] | {"everywhere": EVERYWHERE}
    for name in ("cells_0_6", "moved_0_6"):
        variants[name] |= {"solver": {"increments": 1}}
    results = run_study("refinement", tmp_path, variants, **LARGER)
    for variant in results.variants.values():
        variant.costs = lambda stage: Costs(90.0, 5.0, 1.0, 300.0)
    rows, figure = answer(results)
    assert len(figure.axes) == 4
    quantities = [row.quantity for row in rows]
    assert len(quantities) == len(set(quantities)) == 2 * 7 + 24 + 6 + 7 + 4
    assert all(row.passed for row in rows if "as with rings_1" in row.quantity or "coarse cells" in row.quantity)
    at_once, asked = (next(row for row in rows if row.quantity.startswith(name)
                           and "potency over" in row.quantity) for name in ("parts_1", "error_20"))  # fmt: skip
    assert at_once.error > asked.error
    cut = [row.obtained / row.expected for row in rows if "as with walls between cells" in row.quantity]
    assert len(cut) == 6
    assert max(cut) < 1.05
    (cost,) = (row for row in rows if row.quantity.startswith("rings_1: processor time of the step"))
    assert cost.obtained == 4e3 / Run(results["rings_1"]).particles  # ms, compiling left out


def test_a_static_grid_of_one_ring_would_be_seen(tmp_path):
    static = {"grid": {"coarse_cell": "10 m", "levels": 3, "buffer_cells": 1, "refinement": "static"}}
    follows = {"grid": {"coarse_cell": "10 m", "levels": 3, "buffer_cells": 1}}
    results = run_study("refinement", tmp_path, {"static": static, "follows": follows})
    static, follows = Run(results["static"]), Run(results["follows"])
    assert static.facts["truncated"] == 1
    assert follows.facts["truncated"] == 0
    assert static.potency < 0.9 * follows.potency
