"""`report.html`: one page, complete in itself, that a mine's geotechnical engineer reads from top to bottom."""

import json
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import jinja2
import numpy as np

from catalogs.compare.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR
from catalogs.figures.record_figure import EVENTS_PER_WINDOW
from catalogs.figures.views import MIN_EXCAVATED_SHARE_DRAWN
from catalogs.report import first_page, sections, text
from catalogs.report.banners import banners
from catalogs.report.gallery import draw_sections
from catalogs.report.grid_convergence_text import MAX_ERROR_SHARE, discretisation
from catalogs.report.inputs import Evidence, read_evidence
from catalogs.report.record_text import sentences
from catalogs.report.section_numbers import TOPICS, section_number
from catalogs.report.step_lines import caption, step_lines
from catalogs.report.text import fixed, number, percent, whole
from catalogs.report.view_section import content_security_policy
from catalogs.settings import InsituStress, Scheduled
from catalogs.sources.mechanisms import MAX_CONE
from common.datasets import atomic_path
from common.pages import page_templates
from common.provenance import comment

TEMPLATES = Path(__file__).parent / "templates"
LIMITS = {  # of the code, that the page's own sentences name
    "least_error": MIN_ERROR_SHARE,
    "safety": SAFETY_FACTOR,
    "too_coarse": MAX_ERROR_SHARE,
    "shown_excavated": MIN_EXCAVATED_SHARE_DRAWN,
    "window": EVENTS_PER_WINDOW,
    "widest_cone": MAX_CONE,
}


def write_report(
    *,
    config: dict,
    grid: str | os.PathLike,
    output: str | os.PathLike,
    figures: str | os.PathLike,
    elastic: str | os.PathLike | None = None,
    steps: Sequence = (),
    events: Sequence = (),
    catalog: str | os.PathLike | None = None,
    record: str | os.PathLike | None = None,
    comparison: str | os.PathLike | None = None,
    spread: str | os.PathLike | None = None,
    closeness: str | os.PathLike | None = None,
    grid_convergence: str | os.PathLike | None = None,
    forecast_scores: str | os.PathLike | None = None,
    logs: str | os.PathLike | None = None,
    default: dict | None = None,
    excavations: Sequence[Scheduled] | None = None,
    insitu: InsituStress | None = None,
    made_from: str = "",
    processes: int = 1,
) -> None:
    """Write the page to `output` (atomically) and each of its figures as SVG into the folder `figures`.

    config: the resolved configuration as the user wrote it (units as text), default: config/default.yaml, for the marks
    of what differs; grid, elastic, steps, events, catalog, record, comparison, spread, closeness, grid_convergence,
    forecast_scores:
    datasets, absent stages None or empty; logs: folder of the logs of this mine's stages; excavations: when each is
    mined, if not as `config` says; insitu: the stress before mining; made_from: see common.provenance; processes: how
    many draw sections at the same time.
    Same inputs, same bytes, whatever `processes` is. Raises InputError where a dataset is unreadable or no catalogue.
    """
    evidence = read_evidence(
        config, default, grid, elastic, list(steps), list(events), catalog, record, comparison, spread, closeness,
        grid_convergence, logs, excavations, insitu, forecast_scores,
    )  # fmt: skip
    lines, warnings = step_lines(evidence), banners(evidence)
    first = partial(first_page.section, evidence, warnings, lines)
    shown = draw_sections(sections.sections_of(evidence) | {"first": first}, Path(figures), processes)
    page = _environment().get_template("report.html.j2").render(
        evidence=evidence,
        mine=evidence.grid.attrs["mine"],
        banners=warnings,
        headline=text.headline(evidence),
        step_lines=lines,
        step_caption=caption(evidence) if lines else "",
        discretisation=discretisation(evidence),
        beside=sentences(evidence),
        many=sections.MAX_ROWS_UNFOLDED,
        limits=LIMITS,
        topics=TOPICS,
        section_number=section_number,
        policy=content_security_policy(shown["view"]["scripts"] if shown["view"] else []),
        config_lines=text.config_lines(config, default),
        versions=_versions(evidence),
        files=[(_short(path, output), attributes) for path, attributes in evidence.files.items()],
        **shown,
    )  # fmt: skip
    with atomic_path(output) as temporary:
        temporary.write_text(page.rstrip() + "\n" + comment(made_from), encoding="utf-8")


def _environment() -> jinja2.Environment:
    environment = page_templates(TEMPLATES)
    filters: dict[str, Callable] = {
        "number": number,
        "percent": percent,
        "whole": whole,
        "fixed": fixed,
        "typeset": text.typeset,
    }
    filters["logarithm"] = lambda value: fixed(np.log10(value) if value > 0 else np.nan, 2)
    environment.filters.update(filters)
    return environment


def _versions(evidence: Evidence) -> dict[str, str]:
    """Package versions named by the datasets; where files differ, each version."""
    found: dict[str, set[str]] = {}
    for attributes in evidence.files.values():
        for name, version in json.loads(attributes.get("versions", "{}")).items():
            found.setdefault(name, set()).add(version)
    return {name: ", ".join(sorted(versions)) for name, versions in sorted(found.items())}


def _short(path: str, output) -> str:
    """A dataset's path below the report's own folder where it lies there, else its name."""
    full, folder = Path(path).resolve(), Path(output).resolve().parent
    return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else full.name
