"""`report.html` of the verification: for each study its rows, the costs of its variants, and a figure."""

import base64
import csv
import re
from dataclasses import dataclass
from pathlib import Path

from common.datasets import atomic_path
from common.errors import InputError
from verification.html_page import write_page
from verification.known_misses import KNOWN_MISS, PASSES_NOW, judge
from verification.results import Variant, read_results
from verification.rows import COLUMNS, VERDICTS, read_rows
from verification.studies import Study

POINTS_TO_PIXELS = 96 / 72
MARKS = {
    VERDICTS[True]: "passed",
    PASSES_NOW: "passed",
    VERDICTS[False]: "failed",
    KNOWN_MISS: "known miss",
    VERDICTS[None]: "reported",
}
STYLES = {
    "passed": "passed",
    "failed": "failed",
    "known miss": "known",
    "reported": "reported",
}  # Style classes of the page.


@dataclass(frozen=True)
class Section:
    """One study on the page. rows: its table with known misses marked. costs: one entry for each variant."""

    study: Study
    rows: list[dict[str, str]]
    costs: list[dict]
    figure: str
    width: int

    def count(self, verdict: str) -> int:
        """Number of rows that passed, failed, are a known miss or are reported only."""
        return sum(MARKS[row["passed"]] == verdict for row in self.rows)

    @property
    def causes(self) -> dict[str, list[dict[str, str]]]:
        """Rows that are a known miss, by their cause."""
        found: dict[str, list[dict[str, str]]] = {}
        for row in self.rows:
            if row["passed"] == KNOWN_MISS:
                found.setdefault(self.study.known_misses[row["quantity"]].cause, []).append(row)
        return found


def write_report(studies: list[Study], results: Path, logs: Path, page: Path, summary: Path) -> None:
    """Write the page and the table of all rows, atomically. Raises InputError where rows or a figure are missing."""
    sections = [_section(study, results / study.name, logs / study.name) for study in studies]
    with atomic_path(summary) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(row for section in sections for row in section.rows)
    write_page(
        page, "report", sections=sections, marks=MARKS, styles=STYLES, known_miss=KNOWN_MISS, passes_now=PASSES_NOW
    )


def _section(study: Study, folder: Path, logs: Path) -> Section:
    try:
        figure = (folder / "figure.svg").read_bytes()
        rows = read_rows(folder / "rows.csv")
        rows = judge(rows, study.known_misses)
    except OSError as error:
        raise InputError(f"{error.filename}: {error.strerror}; run the study again") from error
    except InputError as error:
        raise InputError(f"config/verification/{study.name}.yaml: {error}") from error
    width = re.search(rb'<svg[^>]* width="([0-9.]+)pt"', figure)
    return Section(
        study=study,
        rows=rows,
        costs=[
            {"variant": name, **_cost(variant)} for name, variant in read_results(study, folder, logs).variants.items()
        ],
        figure="data:image/svg+xml;base64," + base64.b64encode(figure).decode(),
        width=round(float(width.group(1)) * POINTS_TO_PIXELS) if width else 1000,
    )


def _cost(variant: Variant) -> dict:
    stages = ["grid", "elastic", *[f"steps/{name}" for name in variant.step_names]]
    seconds = [variant.seconds(stage) or 0.0 for stage in stages]
    return {
        "cells": variant.grid.sizes["cell"],
        "levels": variant.grid.attrs["levels"],
        "finest": variant.grid.attrs["fine_cell"],
        "steps": len(variant.step_names),
        "seconds": sum(seconds),
        "memory": max(variant.peak_memory(stage) or 0.0 for stage in stages),
    }
