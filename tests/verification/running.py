"""Reduced studies run in this process by the ordinary stage functions, without Snakemake."""

import functools
import re
from collections.abc import Callable
from pathlib import Path

import yaml

from common.costs import Costs
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from seismic.events import extract_events
from verification.extremes.tiny_mine import changed
from verification.results import Results, Variant
from verification.studies import load_study, merge

ROOT = Path(__file__).parents[2]
STUDIES = ROOT / "config" / "verification"
DEFAULT = yaml.safe_load((ROOT / "config" / "default.yaml").read_text())


def same_costs(costs: Costs, members: Costs | None = None) -> Callable[[str], Costs]:
    """Costs of the stages that have a log by the rules, in place of measured ones; another name is an error.

    members: of the stages of an ensemble's members, where they differ.
    """
    rules = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    logs = {re.sub("{{[a-z]+}}", "[^/]+", name) for name in re.findall(r'f"{LOGS}/(.+)[.]log"', rules)}

    def of(stage: str) -> Costs:
        member = re.match("ensemble/[0-9]+/", stage)
        known = stage.removeprefix(member[0]) if member else stage
        assert any(re.fullmatch(log, known) for log in logs), f"{stage}: no rule has this log"
        return members if members and member else costs

    return of


def run_study(name: str, folder: Path, variants: dict[str, dict] | list[str] | None = None, **changes) -> Results:
    """Results of a study, reduced: only these variants (a list of its own ones, or a dict of new ones).

    changes: dotted key to value, over the base scene and over every variant. `folder`: where the reduced study file
    and states of failed stages may lie. Stages run when an answer first asks for their dataset.
    """
    text = yaml.safe_load((STUDIES / f"{name}.yaml").read_text())
    if isinstance(variants, dict):
        text["variants"] = variants
    elif variants is not None:
        text["variants"] = {variant: text["variants"][variant] for variant in variants}
    if "scene" in text:
        scene = text.pop("scene")
        text["variants"] = {
            variant: changed(merge(scene, over or {}), **changes) for variant, over in text["variants"].items()
        }
        text["scene"] = {}
    path = Path(folder) / f"{name}.yaml"
    path.write_text(yaml.safe_dump(text, sort_keys=False))
    study = load_study(path, DEFAULT)
    return Results(study, {variant: _variant(mine, Path(folder)) for variant, mine in study.mines.items()})


def _variant(mine, folder: Path) -> Variant:
    @functools.cache  # as the files of a study are made once, whoever reads them
    def read(path: str):
        if path.startswith("ensemble/"):
            _, number, path = path.split("/", 2)
            return _variant(mine.member(int(number)), folder).read(path)
        stage, _, name = path.removesuffix(".nc").rpartition("/")
        failed = folder / f"{mine.name}.npz"
        if name == "grid":
            return make_grid(mine.grid_slice(), {})
        if name == "elastic":
            return elastic_stage(parse_scene(mine.mechanics_slice(0)), variant.grid, failed)[0]
        if stage == "events":
            return extract_events(variant.step(name), mine.catalogue_slice())[0]
        before = mine.previous(name)
        state = variant.step(before) if before else variant.elastic
        return mining_step(parse_scene(mine.mechanics_slice(mine.step_index(name))), variant.grid, state, failed)[0]

    variant = Variant(mine, read)
    return variant
