"""`report.html`: one page, complete in itself, that a mine's geotechnical engineer reads from top to bottom."""

import base64
import hashlib
import importlib
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from catalogs.report import first_page, sections
from catalogs.report.evidence import read_evidence
from catalogs.report.gallery import draw_sections
from catalogs.report.text import between, fixed, hundredths, number, percent, typeset, whole
from catalogs.settings import ReportSlice
from common.datasets import atomic_path
from common.pages import page_templates

FOLDER = Path(__file__).parent  # "templates" and, beside each section's module, its own
SCRIPTS = [FOLDER / "browser" / name for name in ("three.min.js", "view_names.js", "view.js")]  # in order
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
MODULES = {"first": first_page} | {
    name: importlib.import_module(f"{sections.__name__}.{name}") for name in sections.SECTIONS
}
SLOWEST_FIRST = (
    "parameters",
    "axes",
    "events",
    "rock",
    "convergence",
    "scene",
    "balls",
    "view",
    "sizes",
    "spread",
    "first",
)


def write_report(
    paths: Mapping[str, Any],
    settings: ReportSlice,
    output: str | os.PathLike,
    figures: str | os.PathLike,
    logs: str | os.PathLike | None = None,
    processes: int = 1,
) -> None:
    """Write the page to `output` (atomically) and each of its figures as SVG into the folder `figures`.

    paths: the mine's datasets, as `read_evidence` takes them; settings: configuration and defaults as the user wrote
    them, with units as text; logs: folder of the logs of this mine's stages; processes: how many draw sections at the
    same time.
    Same inputs, same bytes, whatever `processes` is. Raises InputError where a dataset is unreadable or no catalogue.
    """
    evidence = read_evidence(paths, settings, logs)
    parts = {name: partial(MODULES[name].section, evidence) for name in (*SLOWEST_FIRST, *MODULES)}
    shown = draw_sections(parts, Path(figures), processes)
    scripts = [path.read_text(encoding="utf-8") for path in SCRIPTS] if shown["view"] else []
    page = _environment(output).get_template("templates/report.html.j2").render(
        evidence=evidence,
        mine=evidence.grid.attrs["mine"],
        many=sections.MAX_ROWS_UNFOLDED,
        topics=sections.TOPICS,
        names=list(sections.SECTIONS),
        section_number=sections.section_number,
        policy=content_security_policy(scripts),
        scripts=scripts,
        **shown,
    )  # fmt: skip
    with atomic_path(output) as temporary:
        temporary.write_text(page.rstrip() + "\n", encoding="utf-8")


def content_security_policy(scripts: list[str]) -> str:
    """Content security policy of the page: it may run these scripts and show its own images, and asks no address."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    return f"{POLICY}; script-src " + (" ".join(f"'sha256-{digest}'" for digest in digests) or "'none'")


def _environment(output) -> jinja2.Environment:
    """The templates and their filters; output: the page, to which paths of files are written relative."""
    environment = page_templates(FOLDER)
    filters: dict[str, Callable] = {
        "number": number,
        "percent": percent,
        "whole": whole,
        "fixed": fixed,
        "between_hundredths": partial(between, form=hundredths),
        "typeset": typeset,
        "short": partial(_short, Path(output).resolve().parent),
    }
    filters["logarithm"] = lambda value: fixed(np.log10(value) if value > 0 else np.nan, 2)
    environment.filters.update(filters)
    return environment


def _short(folder: Path, path: str) -> str:
    """A dataset's path below the report's own folder where it lies there, else its name."""
    full = Path(path).resolve()
    return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else full.name
