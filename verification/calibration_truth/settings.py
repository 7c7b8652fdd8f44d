"""The file config/calibration_truth.yaml, and the runs that it adds to the trials of a calibration."""

import copy
import functools
import sys

from calibration.mine_files import given_share
from common.errors import InputError, InputErrors
from workflow import BASE
from workflow.calibration_trials import DOUBLED, CalibrationTrials
from workflow.configuration import load
from workflow.strict_yaml import read_yaml

FILE = BASE / "config" / "calibration_truth.yaml"
TERMS = {  # What counts in the calibrations of a case, by the name of the case.
    "potency_and_number": ("potency", "number"),
    "all_terms": ("potency", "number", "places", "sizes"),
}
SAME_LAW = "same_law"  # Case of a record that the mine file's own values make.
MEMBER = 10_001  # Realization of strength of every such record: no replicate has it.


def other_hosts() -> dict[str, dict]:
    """Host of each record that no values within the ranges give, by name."""
    return _read()["other_hosts"]


def _read() -> dict:
    return read_yaml(FILE)


def records() -> list[str]:
    """Names of all records that are made."""
    return [SAME_LAW, *other_hosts()]


def case_slice(trials: CalibrationTrials, case: str) -> dict:
    """What the run of a record depends on, for workflow.run_mine.run_stages: the cells of trials, another chance."""
    text = {key: value for key, value in trials.mine.text.items() if key != "calibration"}
    if case != SAME_LAW:
        text = {**text, "materials": {**text["materials"], "host": other_hosts()[case]}}
    try:
        mine = load(text | {"ensemble": 0}, trials.mine_file, trials.mine.default)
    except (InputErrors, InputError) as error:
        sys.exit(f"{FILE.relative_to(BASE)}: {case}: {error}")
    mine = mine.coarser() if trials.settings.cells == DOUBLED else mine
    return mine.member(MEMBER).run_slices()


def truths(trials: CalibrationTrials) -> dict[str, list[float]]:
    """The true value of each quantity, as a share of its range (0 to 1): `truth`, the mine file's own, and
    `record_truth`, that which made the mine's record.

    Ends the run in one line where a value lies outside of its range, as it could not be found again, and where trials
    have the mine's own cells, so that there is no correction to test.
    """
    if trials.settings.cells != DOUBLED:
        sys.exit(f"{trials.mine_file}: calibration.cells: this study needs trials on doubled cells")
    own = trials.mine.text
    made = copy.deepcopy(own)
    for key, value in _read()["made_the_record"].items():
        *sections, last = key.split(".")
        functools.reduce(lambda section, part: section[part], sections, made)[last] = value
    return {"truth": _shares(trials, own), "record_truth": _shares(trials, made)}


def _shares(trials: CalibrationTrials, text: dict) -> list[float]:
    found = []
    for number, quantity in enumerate(trials.settings.quantities):
        try:
            share = given_share(text, quantity, f"calibration.quantities[{number}]")
        except InputError as error:
            sys.exit(f"{trials.mine_file}: {error}")
        if not 0.0 <= share <= 1.0:
            sys.exit(f"{trials.mine_file}: calibration.quantities[{number}].range: does not hold the true value")
        found.append(share)
    return found
