"""The settings, those that differ from the defaults marked; the files read, and the versions that made them.

The template is "config.html.j2".
"""

import json

import yaml

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery

DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # faster where PyYAML was built with libyaml


def section(evidence: Evidence, _: Gallery) -> dict:
    """Content of the section on settings: lines of the resolved configuration, each with whether it differs from the
    default, and versions of packages."""
    return {"lines": config_lines(evidence.config, evidence.default), "versions": _versions(evidence)}


def config_lines(config: dict, default: dict | None, indent: int = 0) -> list[tuple[str, bool]]:
    """YAML of the resolved config, line by line, each with whether its value differs from the default's."""
    lines = []
    for name, value in config.items():
        known = isinstance(default, dict) and name in default
        other = default[name] if known else None
        if isinstance(value, dict) and value:
            lines.append((" " * indent + f"{name}:", False))
            lines += config_lines(value, other if isinstance(other, dict) else {}, indent + 2)
            continue
        text = yaml.dump(
            {name: value}, Dumper=DUMPER, sort_keys=False, allow_unicode=True, width=110,
            default_flow_style=None if isinstance(value, list) else False,
        )  # fmt: skip
        changed = default is not None and not (known and other == value)
        lines += [(" " * indent + line, changed) for line in text.splitlines()]
    return lines


def _versions(evidence: Evidence) -> dict[str, str]:
    """Package versions named by the datasets; where files differ, each version."""
    found: dict[str, set[str]] = {}
    for attributes in evidence.files.values():
        for name, version in json.loads(attributes.get("versions", "{}")).items():
            found.setdefault(name, set()).add(version)
    return {name: ", ".join(sorted(versions)) for name, versions in sorted(found.items())}
