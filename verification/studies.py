"""A study is one file of config/verification: a base scene, named variants of it, and bounds on their results.

The base scene stands in the study, or it is that of a mine's file (scene_from) with the changes of the study's scene.
"""

import copy
import functools
import os
import re
from dataclasses import dataclass
from pathlib import Path

import yaml
from snakemake.utils import update_config

from common.errors import InputError, InputErrors
from mpm_core.constitutive.laws import ELASTIC_MODEL
from verification.rows import KnownMiss, parse_known_misses
from workflow import BASE
from workflow.checks import PLANNED
from workflow.configuration import load
from workflow.mine import Mine
from workflow.strict_yaml import read_yaml

FOLDER = BASE / "config" / "verification"
KEYS = (
    "answer",
    "title",
    "about",
    "on_request",
    "threads",
    "events",
    "allowed",
    "settings",
    "known_misses",
    "scene_from",
    "scene",
    "variants",
)
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*\Z")


@dataclass(frozen=True)
class Study:
    """Content of a study file; `mines` holds the checked configuration of every variant, by its name.

    threads: threads of each stage; 64 takes all there are, and with 1 small scenes run side by side. events: whether
    the events of its steps are extracted. known_misses: rows that are known to miss their bound, by quantity.
    """

    name: str
    answer: str
    title: str
    threads: int
    events: bool
    allowed: dict[str, float]
    settings: dict
    known_misses: dict[str, KnownMiss]
    mines: dict[str, Mine]


def merge(base: dict, changes: dict) -> dict:
    """A copy of `base` with `changes`. Mappings merge; everything else, lists included, is replaced."""
    result = copy.deepcopy(base)
    update_config(result, copy.deepcopy(changes))
    return result


@functools.cache
def default_settings() -> dict:
    """The content of config/default.yaml, which no one may change."""
    return yaml.safe_load((BASE / "config" / "default.yaml").read_text(encoding="utf-8"))


def for_verification(scene: dict) -> dict:
    """A copy of a scene whose rock is uniform, as that of closed forms, and that ends where it has no equilibrium,
    unless it says otherwise."""
    values = copy.deepcopy(scene)
    values.setdefault("solver", {}).setdefault("collapse", "error")
    for rock in values.get("materials", {}).values():
        if rock.get("model") != ELASTIC_MODEL:
            rock.setdefault("variability", {"share": 0})
    return values


def load_study(path: str | os.PathLike, default: dict | None = None) -> Study:
    """Read and check a study file. Raises InputError, one line, naming file, variant and key.

    default: what scenes leave out, by default the content of config/default.yaml.
    """
    path, default = Path(path), default or default_settings()
    text = read_yaml(path)
    if not {"answer", "title"} <= set(text):
        raise InputError(f"{path}: a study needs the keys answer and title")
    unknown = sorted(set(text) - set(KEYS))
    if unknown:
        raise InputError(f"{path}: {unknown[0]}: unknown key; a study has {', '.join(KEYS)}")
    variants = text.get("variants") or {}
    if bool(variants) != ("scene" in text or "scene_from" in text):
        raise InputError(f"{path}: a scene needs variants (at least one, which may change nothing), and they a scene")
    try:
        known_misses = parse_known_misses(text.get("known_misses"))
    except InputError as error:
        raise InputError(f"{path}: known_misses: {error}") from error
    source, mine = path, {}
    if "scene_from" in text:  # Its paths resolve from its own folder, and its mistakes are reported under its own name.
        source = Path(os.path.normpath(path.parent / text["scene_from"]))
        mine = read_yaml(source)
        mine.pop("record", None)  # No study compares a record.
    base = merge(mine, text.get("scene") or {})
    mines = {}
    for name, changes in variants.items():
        if not NAME.match(str(name)):
            raise InputError(f"{path}: variants.{name}: use letters, digits, - or _")
        scene = merge(base, changes or {}) | {"name": f"{path.stem}-{name}"}
        _leave_planned(scene, mine)
        try:
            # a mine's rock varies as it does in the mine
            mines[name] = load(merge(default, scene if mine else for_verification(scene)), source, default)
        except InputError as error:
            lines = (f"{path}: variants.{name}: {line.removeprefix(f'{path}: ')}" for line in error.lines)
            raise InputErrors(lines) from error
    return Study(
        name=path.stem,
        answer=text["answer"],
        title=text["title"],
        threads=int(text.get("threads", 64)),
        events=bool(text.get("events", False)),
        allowed=text.get("allowed", {}),
        settings=text.get("settings", {}),
        known_misses=known_misses,
        mines=mines,
    )


def _leave_planned(scene: dict, mine: dict) -> None:
    """Mark excavations as planned, in place, whose step a variant leaves out: such steps are not run."""
    if not mine:
        return
    listed = {step.get("name") for step in scene.get("steps", [])} | {"history"}  # It need not be listed.
    left_out = {step.get("name") for step in mine.get("steps", [])} - listed
    for entry in scene.get("excavations", []):
        entry |= {key: PLANNED for key in ("step", "filled") if entry.get(key) in left_out}
