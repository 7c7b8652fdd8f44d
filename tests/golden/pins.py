"""What a golden file pins of a mine's results: variables of datasets, texts of tables, lines of pages.

A variable is pinned as a list: type and dimensions in words; a hash of its type, dimensions and values; the number of
finite values; their least, largest, and the sum of their absolute values. Attributes are left out: they say what a
result was made from. A table or a QuakeML file is pinned as the number of its lines and a hash of them, without
comments. Of a page, the lines that hold numbers are pinned, below their headings.
"""

import hashlib
import json
import os
import re
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding
import numpy as np
import xarray as xr
from lxml import html

Pin = list[str | int | float]
"""One variable or one text."""
Pins = dict[str, dict]
"""By the path of a file below the results' folder: pins of its variables by name, or its lines by heading."""

PINNED = (
    *("grid.nc", "elastic.nc", "steps/*.nc", "events/*.nc", "catalog.nc", "catalog.csv", "catalog.xml"),
    *(
        "record.nc",
        "event_rules.nc",
        "source_parameters.nc",
        "openings.nc",
        "openings.csv",
        "opening_runs.nc",
        "comparison.nc",
        "spread.nc",
        "grid_convergence.nc",
        "forecast_scores.nc",
    ),
    *("report.html", "baselines/*.nc", "baselines/*.csv", "plans/*/outcome.nc", "plans/plans.csv"),
    *("calibration/trials.csv", "calibration/middle.yaml", "calibration/draw_*.yaml", "calibration/*/*.nc"),
)
"""Ends of the paths of files that are pinned. Other data files are listed as not pinned."""
DATA = {".nc", ".csv", ".xml", ".html", ".yaml"}
NOT_RESULTS = {"jobs", "forecasts", "figures", "vtk"}

DIGESTS = {"made_by"}  # Variables that say what a result was made from, as attributes do.
HASH_DIGITS = 16
SUMMARY_DIGITS = 9
PROVENANCE = re.compile(r"<!--[^>]*-->|<mine:attributes>.*</mine:attributes>|^#[^\n]*\n?", re.MULTILINE)
"""What texts say of how they were made: comments, and in QuakeML the attributes of the catalogue's dataset."""

RUN_DEPENDENT_SECTIONS = ("Resources", "Configuration and provenance")
"""Sections of the report that state times, memory, hashes and versions."""
BREAK, CELL = "\u2029", " | "
BLOCKS = {
    "address",
    "div",
    "dd",
    "dt",
    "figcaption",
    "figure",
    "h1",
    "h2",
    "h3",
    "header",
    "li",
    "nav",
    "ol",
    "p",
    "pre",
}
BLOCKS |= {"section", "summary", "table", "tr", "ul", "details"}


def processor() -> dict[str, str]:
    """The processor that numba compiles for, and versions of the packages that choose instructions by it."""
    name = os.environ.get("NUMBA_CPU_NAME") or llvmlite.binding.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES") or llvmlite.binding.get_host_cpu_features().flatten()
    packages = {package: version(package) for package in ("numpy", "numba", "llvmlite", "scipy")}
    return {"name": name, "features": _digest(features.encode())} | packages


def pins_of(results: Path) -> tuple[Pins, list[str]]:
    """Pins of all files below a folder of results, and the paths of data files that are not pinned."""
    pins: Pins = {}
    others = []
    for file in sorted(results.rglob("*")):
        path = file.relative_to(results)
        is_hidden = file.name.startswith(".")
        if is_hidden or file.suffix not in DATA or NOT_RESULTS & set(path.parts) or not file.is_file():
            continue
        if any(path.match(end) for end in PINNED):
            pins[path.as_posix()] = pins_of_file(file)
        else:
            others.append(path.as_posix())
    return pins, others


def pins_of_file(file: Path) -> dict:
    """Pins of one file's variables, lines or text."""
    if file.suffix == ".nc":
        with xr.open_dataset(file, decode_timedelta=False) as dataset:
            names = sorted(set(map(str, dataset.variables)) - DIGESTS)
            return {name: pin_of(dataset[name]) for name in names}
    if file.suffix == ".html":
        return lines_of_page(file.read_text(encoding="utf-8"))
    text = PROVENANCE.sub("", file.read_text(encoding="utf-8")).strip()
    return {"text": [f"{len(text.splitlines())} lines", _digest(text.encode())]}


def pin_of(variable: xr.DataArray) -> Pin:
    """Pin of a variable, whose values are read here."""
    values = variable.values
    is_text = values.dtype.kind in "OUST"
    sizes = ", ".join(f"{name} {size}" for name, size in variable.sizes.items())
    form = f"{'text' if is_text else values.dtype} ({sizes})"
    if is_text:
        return [form, _digest(form.encode(), json.dumps([str(value) for value in values.ravel()]).encode())]
    content = _digest(form.encode(), np.ascontiguousarray(values).tobytes())
    return [form, content, *_summary(values)]


def _summary(values: np.ndarray) -> Pin:
    """Number of finite values; least, largest and sum of absolute values of these, 0 if there are none."""
    if values.dtype.kind in "mM":
        numbers = values[~np.isnat(values)].astype(np.int64).astype(float)
    else:
        numbers = values[np.isfinite(values)].astype(float)
    if not numbers.size:
        return [0, 0, 0, 0]
    return [numbers.size, *map(_rounded, (numbers.min(), numbers.max(), np.abs(numbers).sum()))]


def _rounded(number: float) -> int | float:
    """A number of SUMMARY_DIGITS digits, as an integer if it is one."""
    rounded = float(f"{number:.{SUMMARY_DIGITS}g}")
    return int(rounded) if rounded.is_integer() else rounded


def lines_of_page(page: str) -> dict[str, list[str]]:
    """Lines with a number of a page, each a paragraph or a row of a table, by the heading above them."""
    body = html.fromstring(page).find("body")
    for element in list(body.iter("script", "style", "svg", "img")):
        element.drop_tree()
    for element in body.iter(*BLOCKS):
        element.text = BREAK + ("# " if element.tag in ("h1", "h2") else "") + (element.text or "")
        element.tail = BREAK + (element.tail or "")
    for element in body.iter("td", "th"):
        element.tail = CELL + (element.tail or "")
    for element in body.iter("br"):
        element.tail = " " + (element.tail or "")
    sections: dict[str, list[str]] = {}
    lines = sections.setdefault("", [])
    for raw in body.text_content().split(BREAK):
        line = " ".join(raw.split()).removesuffix(CELL.rstrip())
        if line.startswith("# "):
            lines = sections.setdefault(re.sub(r"^[\d.]+ ", "", line.removeprefix("# ")), [])
        elif re.search(r"\d", line):
            lines.append(line)
    return {title: lines for title, lines in sections.items() if lines and title not in RUN_DEPENDENT_SECTIONS}


def _digest(*parts: bytes) -> str:
    """First digits of the sha256 of bytes."""
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:HASH_DIGITS]
