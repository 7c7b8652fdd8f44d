"""Settings are declared once: what is made from the models is up to date, and true."""

import ast
import copy
import re

import jsonschema
import pytest
import yaml
from tiny_mines import FLAT, ROOT, STILL, TINY, merged

from catalogs.records.elk_creek_reader import OrientationSettings
from common.errors import InputError
from mpm_core.settings import SolverSettings
from verification.studies import merge
from workflow.configuration import normalise_yaml_values
from workflow.generate import TASKS, generated, schema, sections_of
from workflow.mine_settings import MineSettings

PACKAGES = ("mpm_core", "seismic", "catalogs", "common", "workflow", "verification")
MAY_IMPORT = {
    "common": {"common"},
    "mpm_core": {"mpm_core", "common"},
    "seismic": {"seismic", "common"},
    "catalogs": {"catalogs", "common"},
}
TINIES = {"tiny": TINY, "flat": FLAT, "still": STILL}
GENERATED = generated()
SCHEMA = jsonschema.Draft202012Validator(schema())


@pytest.mark.parametrize("path", GENERATED, ids=lambda path: path.name)
def test_generated_files_are_up_to_date(path):
    """After a change of a model: python -m workflow.generate."""
    assert path.read_text(encoding="utf-8") == GENERATED[path], "stale: run python -m workflow.generate"


def test_the_table_of_keys_has_every_section_once_by_task():
    keys = [key for keys, _ in TASKS.values() for key in keys]
    sections = {name for name, field in MineSettings.model_fields.items() if sections_of(field.annotation)}
    assert sorted(keys) == sorted(sections | {"shape or file"})


def examples() -> dict[str, str]:
    """Parts of mine files that the documentation shows, by page and place. Studies show parts of theirs."""
    pages = [page for page in sorted((ROOT / "docs").rglob("*.md")) if page.parent.name != "studies"]
    pages.append(ROOT / "config/README.md")
    block = re.compile(r"^```yaml\n(.*?)^```", re.DOTALL | re.MULTILINE)
    found = {page.name: block.findall(page.read_text(encoding="utf-8")) for page in pages}
    return {f"{name}-{place}": text for name, texts in found.items() for place, text in enumerate(texts)}


EXAMPLES = examples()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_of_the_documentation_are_valid(name):
    example = yaml.safe_load(EXAMPLES[name])
    base = {key: value for key, value in TINY.items() if key != "steps" or "schedule" not in example}
    MineSettings.read(base | example | {"materials": TINY["materials"] | example.get("materials", {})})


def scenes() -> dict[str, dict]:
    """Every configuration of ours, as its writer wrote it, by name."""
    found = {path.name: yaml.safe_load(path.read_text()) for path in sorted((ROOT / "config/mines").glob("*.yaml"))}
    for path in sorted((ROOT / "config/verification").glob("*.yaml")):
        study = yaml.safe_load(path.read_text())
        base = found[study["scene_from"].rsplit("/")[-1]] if "scene_from" in study else {}
        for name, changes in (study.get("variants") or {}).items():
            scene = merge(merge(base, study.get("scene") or {}), changes or {})
            found[f"{path.stem}-{name}"] = scene | {"name": f"{path.stem}-{name}"}
    return found | TINIES


SCENES = scenes()


def refuses(config: dict) -> tuple[bool, bool]:
    """Whether the models and the JSON schema made from them refuse a configuration."""
    config = normalise_yaml_values(config, {})
    by_schema = not SCHEMA.is_valid(config)
    try:
        MineSettings.read(config)
    except InputError:
        return True, by_schema
    return False, by_schema


@pytest.mark.parametrize("name", SCENES)
def test_models_and_schema_take_our_own_scenes(name):
    """Mines, variants of studies, and what tests start from."""
    scene = SCENES[name]
    assert refuses(merged(scene)) == (False, False)
    assert refuses(scene) == (False, False)  # models have the defaults themselves


BEYOND = [
    ("seismic.closeness", 1),
    ("grid.levels", 13),
    ("grid.levels", 1.5),
    ("grid.particles_per_cell", 3),
    ("plane", "yz"),
    ("solver.damping", 1.0),
    ("domain.upper", ["1 m"]),
    ("domain.boundary", {"x": "loose"}),
    ("domain.boundary", {"w": "fixed"}),
    ("excavations", {}),
    ("excavations", [{"step": "history"}]),
    ("materials.host.poisson_ratio", 0.5),
    ("materials.host.cohesion", None),
    ("materials.host.tension_cutoff", "some"),
    ("record.columns.time", ["a", "b", "c", "d"]),
    ("record.conversions", {"ML": {"slope": 1}}),
    ("comparison.resamplings", 98),
    ("colour", "red"),
]


@pytest.mark.parametrize(("key", "value"), BEYOND, ids=[f"{key}={value}" for key, value in BEYOND])
def test_the_schema_refuses_what_the_models_refuse(key, value):
    """Types, bounds, choices, missing and unknown keys; editors that read the schema tell them as we do."""
    config = copy.deepcopy(TINY)
    *sections, last = key.split(".")
    part = config
    for section in sections:
        part = part.setdefault(section, {})
    part[last] = value
    assert refuses(config) == (True, True)


@pytest.mark.parametrize(
    ("section", "old", "new"),
    [
        (SolverSettings, "increment_error", "max_overshoot"),
        (OrientationSettings, "location_error", "max_location_error"),
    ],
)
def test_a_renamed_key_is_refused_in_one_line_that_names_the_new_one(section, old, new):
    """And the new key is not said to be missing."""
    with pytest.raises(InputError) as refused:
        section.read({old: 1}, "section")
    assert list(refused.value.lines) == [f"section.{old}: is called {new} now; rename it"]


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_packages_import_neither_each_other_nor_the_workflow(package):
    """What they share is in pipeline; workflow composes them."""
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            foreign = {name.split(".")[0] for name in names} & set(PACKAGES) - MAY_IMPORT[package]
            assert not foreign, f"{path}: imports {foreign}"
