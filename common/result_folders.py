"""Folders below results/<mine> and logs/<mine> of all that is no result of the mine's own run."""

import re

ENSEMBLE = "ensemble"  # perturbed members, by number
COARSE = "coarse"  # the companion on cells of twice the size
ELASTIC_ROCK = "elastic_rock"  # the mine in rock that does not fail, for its baselines
DRAWN_ROCK = "drawn_rock"  # the mine in rock drawn from the posterior of its calibration, by number
PLANS = "plans"  # the mine's other plans, by name; each has such folders of its own
BASELINES = "baselines"
CALIBRATION = "calibration"
FORECASTS = "forecasts"  # copies of the outcomes of plans, by date; no rule owns them
NUMBER = "[1-9][0-9]*"
SEPARATE_RUNS = f"{ENSEMBLE}/{NUMBER}|{ELASTIC_ROCK}|{DRAWN_ROCK}/{NUMBER}"  # whose stages are jobs of their own
ALL_RUNS = f"{SEPARATE_RUNS}|{COARSE}"
_NOTES = {
    rf"results/[^/]+/({PLANS}/[^/]+/)?{COARSE}/": "the mine on cells of twice the size; "
    "grid_convergence: false leaves it out",
    f"results/[^/]+/{ELASTIC_ROCK}/": "the mine in elastic rock, for its baselines",
    f"results/[^/]+/({PLANS}/[^/]+/)?{DRAWN_ROCK}/[0-9]+/": "rock that the calibration has drawn; "
    "hazard.rock: mine_file leaves it out",
    f"results/[^/]+/{PLANS}/[^/]+/": "another plan of the mine; without it in plans it is left out",
    f"results/[^/]+/({PLANS}/[^/]+/)?{ENSEMBLE}/[0-9]+/": "a perturbed member; ensemble: 0 leaves all of them out, "
    "for plans hazard.runs: 1",
}


def notes_on(path: str) -> list[str]:
    """Notes on the run that a path belongs to: which it is, which key leaves it out; [] for the mine's own run."""
    return [note for folder, note in _NOTES.items() if re.search(folder, path)]
