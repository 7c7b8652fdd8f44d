"""Settings of the scene up to a step, from those up to the step before and from what the step changes.

A step's own settings (workflow/mine.py, Mine.step_slice) hold its changes alone. What came before is an attribute of
the state that the step starts from, so that the settings of all steps together grow with what they change.
"""

import json
from collections.abc import Mapping

from common.datasets import SCENE
from common.errors import InputError

GROWING = ("materials", "excavations", "loads", "strains", "steps")  # Keys that steps add to.


def scene_attribute(settings: dict) -> dict[str, str]:
    """Attribute of a state that holds what steps have changed up to it (JSON), from the settings of its scene."""
    return {SCENE: json.dumps({key: settings[key] for key in GROWING if key in settings})}


def read_scene_attribute(attributes: Mapping) -> dict:
    """What steps have changed up to a state, from its attributes. Raises InputError for an older state."""
    if SCENE not in attributes:
        raise InputError("the state of the step before was made by an earlier version; run the pipeline from the grid")
    return json.loads(attributes[SCENE])


def settings_up_to(before: dict, step: dict) -> dict:
    """Settings that mpm_core.scene.scene.parse_scene reads, up to a step.

    before: those of the elastic history or up to the step before, of which keys in GROWING are read; step: those of the
    step. Neither is changed. Raises InputError if the step does not follow these.
    """
    if "step" not in step:
        raise InputError("not the settings of stage step; jobs stand in results/<mine>/jobs")
    number, name = step["step"]["number"], step["step"]["name"]
    if len(before["steps"]) != max(number, 1):
        raise InputError(
            f"steps.{name}: does not follow the state of the step before, which has {len(before['steps'])} steps, not "
            f"{max(number, 1)}; run the pipeline from the elastic state"
        )
    excavations = list(before["excavations"])
    for change in step["excavations"]:
        old = excavations[change["number"]]
        new = old | {key: value for key, value in change.items() if key != "number"}
        if "pressure" in change:
            new["pressure"] = [*old.get("pressure", ()), *change["pressure"]]
        excavations[change["number"]] = new
    strains = [*before.get("strains", ()), *step["strains"]]
    return {
        **{key: value for key, value in step.items() if key not in ("step", *GROWING)},
        "materials": dict(sorted((before["materials"] | step["materials"]).items())),
        "excavations": excavations,
        "loads": [*before["loads"], *step["loads"]],
        **({"strains": strains} if strains else {}),
        "steps": [*before["steps"][:number], {"name": name}],
    }
