"""Files that are generated from the models of the settings: default file, JSON schema, table of keys.

python -m workflow.generate     writes config/default.yaml, config/README.md and workflow/schemas/config.schema.yaml
"""

import re
import textwrap
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic.fields import FieldInfo

from common.command_line import CommandLine
from common.setting_types import Settings, Unit
from mpm_core.settings import ShapeSettings
from workflow.mine_settings import MineSettings

BASE = Path(__file__).parent.parent
COMMENT = 30  # column of comments
SHAPE = "shape or file"  # section of the keys that all solids share
SLIP = 1e6  # bounds from here on only catch typing errors, and are not shown
DEFAULT_HEAD = """\
# Every parameter that has a default, generated from the models of the settings: python -m workflow.generate
# A mine file (config/mines/<mine>.yaml) overrides what it needs. Materials, excavations, rock bodies, loads, strains,
# steps and the record stand in mine files alone. All keys: config/README.md; a full example: config/mines/demo.yaml.
# Every physical quantity carries its unit as text.
"""
SCHEMA_HEAD = """\
# One mine's configuration, generated from the models of the settings: python -m workflow.generate
# "unit" is ours: the value is text with a unit of that dimension, converted to it, in which its bounds are, too.
"""
README_HEAD = """\
# Keys of a mine file

Generated from the models of the settings: `python -m workflow.generate`. A full example is
[mines/demo.yaml](mines/demo.yaml); [default.yaml](default.yaml) holds the defaults of the sections that every mine has.
A quantity is text with a unit (`57 GPa`, `1.25 m`, `30 deg`), in any unit of its kind; the table gives the unit that
bounds are in. A key that has no default and is not *needed* may be left out.

The first table has all keys of the file's first level. The parts after it are ordered by task; each begins with
examples.

"""
CHAINAGE = """\
openings: {chainage: 10 m}
"""
LOADING = """\
loading_measures:  # how-to page loading-measures.md
  dynamic_friction: 30 deg
  planes:
    - {name: dyke, point: [130 m, 100 m, 1000 m], strike: 10 deg, dip: 75 deg, radius: 40 m}
    - {name: fault, material: fault}  # the weak planes of a rock body
"""
INSTRUMENTS = """\
observations:
  points:
    - {name: SC1, at: [118 m, 98 m, 995 m], axis: {trend: 90 deg}, file: sc1.csv, units: MPa, error: 0.5 MPa}
  lines:
    - {name: MPBX1, start: [111 m, 98 m, 995 m], end: [131 m, 98 m, 995 m], anchors: [2 m, 5 m, 10 m], since: "2019-08"}
    - {name: hole, start: [120 m, 60 m, 1000 m], end: [120 m, 150 m, 1000 m], measures: stress, every: 2 m}
  closures:
    - {name: C1, start: [85.75 m, 110 m, 1012 m], end: [90.25 m, 110 m, 1012 m]}
"""
SCANS = """\
observations:
  scans:
    - {name: CMS 1, excavations: [stope_1], file: stope_1.dxf, layer: CMS, units: ft, date: "2019-08-28", error: 10 cm}
    - {name: CMS 2, excavations: [stope_2], file: stope_2.stl, step: "2019-09", error: 10 cm,
       stations: [[104 m, 97 m, 1009 m]]}
"""
FROM_FILES = """\
excavations:
  - {name: stope, step: history, file: stopes.dxf, layer: S1, units: ft, scale: 1, offset: [0 m, 0 m, 0 m]}
  - {name: other, step: history, file: model.omf, element: stope_2}         # or a body of a GOCAD, OBJ or text STL file
  - {name: third, step: history, shape: prism, file: outline.dxf, layer: S1, height: 20 m}   # or lower and upper
"""
SPECIMENS = """\
excavations:
  - {name: space, step: history, shape: cylinder, start: [0 m, 0 m, 0 m], end: [0 m, 0 m, 2 m], radius: 1 m,
     outside: true}                                # all of the domain that the cylinder leaves: it is a disc
loads:
  - {name: all_of_it, step: test, force: [0 N, 0 N, -1 kN], shape: box, lower: [0 m, 0 m, 2 m], upper: [1 m, 1 m, 3 m]}
  - {name: to_a_point, step: test, force: 1 kN, toward: [0 m, 0 m, 1 m], shape: sphere, center: [0 m, 0 m, 3 m],
     radius: 1 m}
strains:
  - {name: squeezed, step: test, strain: {zz: -1.0e-4}}
"""
FLAWS = """\
baselines:
  radii: [0.5 m, 20 m]
  friction_angle: 25 deg
  cohesion: 1 MPa
"""
FACE = """\
face:
  positions:                                                     # both ends in plan, or the end of a centre line alone
    - {date: "2019-08-01", panel: north, ends: [[0 m, 0 m], [0 m, 250 m]]}
    - {date: "2019-09-01", panel: north, ends: [[180 m, 0 m], [180 m, 250 m]]}
"""
PRINCIPAL = """\
insitu_stress:
  principal:
    sigma_1: {trend: 30 deg, plunge: 0 deg, gradient: -0.040 MPa/m}
    sigma_2: {trend: 120 deg, plunge: 0 deg, gradient: -0.025 MPa/m}
    sigma_3: {plunge: 90 deg, constant: -0.5 MPa, gradient: -0.027 MPa/m}
"""
FORECASTS = """\
forecasts: [forecasts/2019-11.nc]
"""
TURNED_GRID = """\
frame:  # how-to page mine-grids.md
  crs: EPSG:32735
  surface: 5600 ft
  grid: {units: ft, angle: 32 deg, origin: {grid: [10000 ft, 20000 ft], map: [600000 m, 7100000 m]}}
"""
BLOCKS = """\
block_model:  # how-to page block-models.md
  file: blocks.csv
  classes: {column: ROCK, materials: {ORE: ore, PORPHYRY: stiff}, others: host}
  properties:
    youngs_modulus: {column: E_GPA, unit: GPa, values: [30, 45, 60]}
"""
SHAKING = """\
ground_motion:  # how-to page shaking.md
  relation: {name: mcgarr_1981, scatter: 0.3}
  chances: [0.5, 0.1, 0.02]
  largest: 3 m/s
  displacement: 200 mm
  depth: {roof: 1 m, walls: 0.6 m}
support:
  - {name: mesh and rebar, energy: 5 kJ/m^2, displacement: 50 mm}
  - {name: dynamic bolts, energy: 25 kJ/m^2, displacement: 200 mm}
"""
OWN_RELATION = """\
ground_motion:
  relation: {name: site, size: log_potency, a: 0.9, b: 0.4, c: 1.2, scatter: 0.3,
             saturation: {length: 5 m, exponent: 0.333}, sizes: [-3, 2], distances: [20 m, 800 m]}
"""
FITTED_RELATION = """\
ground_motion:
  relation: {name: fitted, file: velocities.csv, size: mw, velocity_unit: mm/s, nearest: 20 m,
             columns: {event: id, size: mw, velocity: ppv, distance: r}}
"""
SOLVER = "solver: {max_overshoot: 0.1, collapse: error}\n"
DEMO, ELK_CREEK, YEAR = (f"config/mines/{name}.yaml" for name in ("demo", "elk_creek", "stoping_year"))
# heading: keys of the first level and sections that it has; its examples: a text, or a file and a key in it
PLANES = """\
report:
  sections:
    - {name: fault, point: [90 m, 100 m, 1000 m], strike: 35 deg, dip: 60 deg}
    - {name: along_stope, excavation: stope_1, within: 15 m}
"""
TASKS: dict[str, tuple[tuple[str, ...], tuple[str | tuple[str, str], ...]]] = {
    "Place, domain and cells": (
        ("frame", "domain", "grid", "accuracy"),
        ((DEMO, "frame"), TURNED_GRID, (DEMO, "grid"), (ELK_CREEK, "domain")),
    ),
    "Stress and rock": (
        ("insitu_stress", "materials", "rock_bodies", "block_model"),
        (
            (DEMO, "insitu_stress"),
            PRINCIPAL,
            (DEMO, "materials"),
            (ELK_CREEK, "rock_bodies"),
            BLOCKS,
        ),
    ),
    "Solids and mining": (
        ("excavations", SHAPE, "steps", "schedule", "excavations_from"),
        ((DEMO, "excavations"), (DEMO, "steps"), FROM_FILES, (YEAR, "schedule")),
    ),
    "Equilibrium and failure": (("solver",), (SOLVER,)),
    "Mining plans": (("plans", "hazard"), ((DEMO, "plans"), (DEMO, "hazard"), FORECASTS)),
    "Events": (("seismic",), ((ELK_CREEK, "seismic"),)),
    "Shaking and support": (("ground_motion", "support"), (SHAKING, OWN_RELATION, FITTED_RELATION)),
    "The recorded catalogue": (("record", "comparison", "face"), ((DEMO, "record"), FACE)),
    "The report": (("report",), (PLANES,)),
    "Calibration": (("calibration",), ((DEMO, "calibration"),)),
    "Openings and instruments": (
        ("openings", "observations", "loading_measures"),
        (CHAINAGE, INSTRUMENTS, SCANS, LOADING),
    ),
    "Baselines": (("baselines",), (FLAWS,)),
    "Specimens of a laboratory": (("loads", "strains"), (SPECIMENS,)),
}


def generated() -> dict[Path, str]:
    """Text of each generated file by its path."""
    return {
        BASE / "config/default.yaml": default_text(),
        BASE / "config/README.md": readme_text(),
        BASE / "workflow/schemas/config.schema.yaml": SCHEMA_HEAD
        + yaml.safe_dump(schema(), sort_keys=False, width=110, default_flow_style=None),
    }


def sections_of(annotation: Any) -> list[type[Settings]]:
    """The models that a field's type is or holds, as a list, mapping or choice does."""
    if isinstance(annotation, type) and issubclass(annotation, Settings):
        return [annotation]
    return [found for part in get_args(annotation) for found in sections_of(part)]


def section_of(annotation: Any) -> type[Settings] | None:
    """The model that a field's type is or holds; the first of several."""
    return next(iter(sections_of(annotation)), None)


def unit_of(field: FieldInfo) -> Unit | None:
    """The unit that a field itself is in."""
    return next((part for part in field.metadata if isinstance(part, Unit)), None)


def default_of(field: FieldInfo) -> Any:
    """A field's default as a user would write it."""
    unit = unit_of(field)
    return f"{field.default:g} {unit.unit}" if unit and isinstance(field.default, float) else field.default


def as_yaml(value: Any) -> str:
    """A scalar as YAML reads it back: 1.0e-05, since 1e-05 is a text to it."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    return f"{value:.1e}" if isinstance(value, float) and "e" in repr(value) else str(value)


def default_text() -> str:
    """config/default.yaml."""
    return DEFAULT_HEAD + "\n" + "\n".join(_default_lines(MineSettings, 0)).strip() + "\n"


def _default_lines(model: type[Settings], depth: int) -> Iterator[str]:
    for name, field in model.model_fields.items():
        key = f"{'  ' * depth}{name}:"
        section = section_of(field.annotation)
        is_section = section is field.annotation
        if section is not None and is_section:
            if field.default is not None and (lines := list(_default_lines(section, depth + 1))):
                yield from ([key, *lines] if depth else ["", key, *lines])
        elif isinstance(default := default_of(field), str | int | float):
            line = f"{key} {as_yaml(default)}"
            meaning = " ".join(model.meanings().get(name, "").split())
            yield f"{line:<{COMMENT - 1}} # {meaning}" if meaning else line


def schema() -> dict:
    """The JSON schema, with this project's own keyword `unit`."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_tidy(MineSettings.model_json_schema())}


def _tidy(part: Any) -> Any:
    """A part of pydantic's schema without titles and without defaults that another section has.

    oneOf becomes anyOf: a word such as `month` is also a text, as a quantity is.
    """
    if isinstance(part, list):
        return [_tidy(entry) for entry in part]
    if not isinstance(part, dict):
        return part
    kept = {key: value for key, value in part.items() if not (key == "title" and isinstance(value, str))}
    if "oneOf" in kept:
        kept["anyOf"] = kept.pop("oneOf")
    if not isinstance(kept.get("default", ""), str | int | float) or kept.get("default", "") is None:
        kept.pop("default")
    if "unit" in kept and "default" in kept:
        kept["default"] = f"{kept['default']:g} {kept['unit']}"
    return {key: " ".join(value.split()) if key == "description" and isinstance(value, str) else _tidy(value)
            for key, value in kept.items()}  # fmt: skip


def readme_text() -> str:
    """config/README.md."""
    sections = list(_sections())
    parts = [README_HEAD, *(table for path, table in sections if not path)]
    for heading, (keys, examples) in TASKS.items():
        parts += [f"## {heading}\n", *(f"```yaml\n{_example(example)}```\n" for example in examples)]
        parts += [table for key in keys for path, table in sections if path.split(".")[0] == key]
    return re.sub("\n{3,}", "\n\n", "\n".join(parts))


def _example(example: str | tuple[str, str]) -> str:
    """An example's text: it, or the lines of a key in a file, without what is indented with it."""
    if isinstance(example, str):
        return example
    path, key = example
    lines = (BASE / path).read_text(encoding="utf-8").splitlines()
    first = next(number for number, line in enumerate(lines) if line.lstrip().startswith(f"{key}:"))
    indent = len(lines[first]) - len(lines[first].lstrip())
    inner = takewhile(lambda line: line.startswith(" " * (indent + 1)), lines[first + 1 :])
    return textwrap.dedent("\n".join([lines[first], *inner])) + "\n"


def _sections() -> Iterator[tuple[str, str]]:
    """Path and table of each section, those within it after it."""
    described: set[type[Settings]] = set()
    queue: list[tuple[str, str, type[Settings]]] = [("", "", MineSettings)]
    while queue:
        path, choice, model = queue.pop(0)
        rows = []
        shared = ShapeSettings.model_fields if issubclass(model, ShapeSettings) and model is not ShapeSettings else {}
        for name, field in model.model_fields.items():
            if name in shared:
                continue
            sections = sections_of(field.annotation)
            section = sections[0] if sections else None
            where = name if path in ("", SHAPE) else f"{path}.{name}"
            for model_there in sections:
                if model_there not in described:
                    described.add(model_there)
                    queue.append((where, _choice(model_there) if len(sections) > 1 else "", model_there))
            rows.append(
                f"| `{name}` | {_kind(model, name, section)} | {_default(field)} | {_meaning(model, name, section)} |"
            )
        about = " ".join((model.__doc__ or "").split())
        if shared and ShapeSettings not in described:
            described.add(ShapeSettings)
            queue.append((SHAPE, "", ShapeSettings))
        about += f" It also has the keys of a [{SHAPE}](#{SHAPE.replace(' ', '-')})." if shared else ""
        head = f"### {path}{choice}\n\n{about}\n" if path else ""
        yield path, "\n".join([head, "| key | value | default | meaning |", "|---|---|---|---|", *rows, ""])


def _choice(section: type[Settings]) -> str:
    """End of a section's heading, ", key value", that tells which of several models the section is of."""
    single = {name: get_args(field.annotation) for name, field in section.model_fields.items() if field.is_required()}
    key, values = next((name, values) for name, values in single.items() if len(values) == 1)
    return f", {key} {values[0]}"


def _kind(model: type[Settings], name: str, section: type[Settings] | None) -> str:
    """The values that a field accepts, as text."""
    part = schema_of(model)["properties"][name]
    words = _words(part, model)
    return f"{words}" if words else f"{section.__name__ if section else ''}"


def schema_of(model: type[Settings]) -> dict:
    """The schema of one model, its own definitions with it."""
    return _tidy(model.model_json_schema())


def _words(part: dict, model: type[Settings]) -> str:
    if "$ref" in part:
        return "section"
    if "anyOf" in part:
        return " or ".join(dict.fromkeys(_words(choice, model) for choice in part["anyOf"]))
    if "enum" in part:
        return ", ".join(str(value) for value in part["enum"])
    if "const" in part:
        return str(part["const"])
    if part.get("type") == "array":
        least, most = part.get("minItems", 0), part.get("maxItems")
        count = f"{least}" if least == most else f"{least} to {most}" if most else f"{least} or more" if least else ""
        return f"list of {count} ({_words(part.get('items', {}), model)})".replace("of  ", "of ")
    if part.get("type") == "object":
        inner: dict = part.get("additionalProperties") or next(iter(part.get("patternProperties", {}).values()), {})
        return f"by name: {_words(inner, model)}"
    kind = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true or false"}
    words = part["unit"] if "unit" in part else kind.get(part.get("type", ""), "")
    if "unit" in part and part.get("maximum", 0) >= SLIP:
        least = part["minimum"] if "minimum" in part else part["exclusiveMinimum"]
        return f"{words}, above 0" if least >= 0 and part.get("minimum") != 0 else words
    low = f"{part['minimum']:g}" if "minimum" in part else ""
    low = f"above {part['exclusiveMinimum']:g}" if "exclusiveMinimum" in part else low
    high = f"{part['maximum']:g}" if "maximum" in part else ""
    high = f"below {part['exclusiveMaximum']:g}" if "exclusiveMaximum" in part else high
    if low and high:
        return f"{words}, {low} to {high}"
    return f"{words}, {low or high}{'' if 'above' in low else ' or more'}" if low or high else words


def _default(field: FieldInfo) -> str:
    """A field's default, or that there is none and it is needed."""
    if field.is_required():
        return "*needed*"
    default = default_of(field)
    if isinstance(default, tuple):
        inner = [part for kind in get_args(field.annotation) for part in getattr(kind, "__metadata__", ())]
        unit = next((f" {part.unit}" for part in inner if isinstance(part, Unit)), "")
        return ", ".join(f"`{one:g}{unit}`" if unit else f"`{as_yaml(one)}`" for one in default)
    return f"`{as_yaml(default)}`" if isinstance(default, str | int | float) else ""


def _meaning(model: type[Settings], name: str, section: type[Settings] | None) -> str:
    """Meaning of a model's field, in one line for a Markdown table: the field's docstring, or its section's."""
    text = model.meanings().get(name) or (section.__doc__ if section else "") or ""
    return " ".join(text.split()).replace("|", "/")


def main() -> None:
    """Write the files that have changed."""
    CommandLine(prog="python -m workflow.generate", description=__doc__).parse_args()
    for path, text in generated().items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"{path.relative_to(BASE)}: written")


if __name__ == "__main__":
    main()
