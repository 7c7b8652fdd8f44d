"""Time and memory that each stage of the run took, from its log.

The template is "resources.html.j2".
"""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from catalogs.report.text import percent, whole
from common.costs import cost_of, duration_text
from common.result_folders import COARSE, ELASTIC_ROCK, ENSEMBLE

# Logs of the stages of a run, without ending. Stages of a run in elastic rock and of members of an ensemble are jobs of
# their own. Other logs are of what has a page of its own, or of an earlier version.
STAGE = re.compile(
    rf"(?:(?P<run>{ELASTIC_ROCK}|{ENSEMBLE}/(?P<member>\d+))/)?"
    rf"(?:grid|elastic|(?:vtk/)?steps/(?P<step>[^/]+)|record|twin|events|catalogue|comparison|scene|vtk/[^/]+|{COARSE})"
)
MADE_BY = {  # stage, and the datasets without all of which its log is of an earlier configuration
    "catalogue": ("catalog",),
    "record": ("record",),
    "comparison": ("comparison", "spread", "grid_convergence", "forecast_scores"),
    COARSE: ("grid_convergence",),
}
NOT_FORESEEN = re.compile(rf"{ELASTIC_ROCK}\b|scene|twin|vtk/")  # stages that nobody asked a quote for
LIKE, OWN = ("steps", "members", "companion"), ("cell", "end", "processor", "memory", "error")  # fields of a quote
QUOTE = "quote.json"  # in the folder of logs: what `snakemake quote` foresaw


def section(evidence: Evidence, _: Gallery) -> dict:
    """Rows of the section on resources, one for each stage of the run: its name and the columns of `common.costs`; and
    what was foreseen, as text."""
    absent = {stage for stage, names in MADE_BY.items() if all(getattr(evidence, name) is None for name in names)}
    absent |= set() if evidence.steps else {"events"}
    spread = evidence.spread
    members = 0 if spread is None else int(spread.attrs["members"] + spread.attrs["collapsed_members"])
    rows = read_resources(evidence.logs, {str(step["step"]) for step in evidence.steps}, absent, members)
    cells = int(evidence.steps[-1]["cells"]) if evidence.steps else int(evidence.grid.sizes["cell"])
    run = {
        "cell": float(evidence.grid.attrs["fine_cell"]),
        "steps": len(evidence.steps),
        "members": members,
        "companion": evidence.grid_convergence is not None,
        "made_of": [one.attrs.get("config_hash") for one in (evidence.grid, *evidence.stages[:1])],
    }
    return {"rows": rows, "foreseen": foreseen(evidence.logs, rows, run, cells, evidence.foreseen)}


def foreseen(logs, rows: list[dict], run: Mapping, cells: int, asked: Mapping | None = None) -> str:
    """What was foreseen for the run, what it took, and what half of the error would cost; empty where nothing was
    foreseen for such a run: its finest cells, m, its steps, members and companion, and hashes `made_of` of its grid's
    and its rock's settings. rows: see read_resources; cells: at the end; asked: what a request was told, if there is no
    quote."""
    quote = _quote_of(logs, run) or asked
    rows = [row for row in rows if not NOT_FORESEEN.match(row["stage"])]
    if not quote or not rows or any(quote[key] != run[key] for key in LIKE):
        return ""
    own, half = quote["own"], quote["half"]
    if not math.isclose(own["cell"], run["cell"]):
        return ""
    took = sum(row["processor"] - row["compiling"] for row in rows)
    text = (
        f"Before the run, {duration_text(own['processor'])} of processor time, {own['memory'] / 1e9:.1f} GB at a "
        f"time and {whole(own['end'])} cells were foreseen. It took {duration_text(took)} without compiling, "
        f"{max(row['memory'] for row in rows) * 2**20 / 1e9:.1f} GB in its largest stage, and {whole(cells)} cells."
    )
    if math.isfinite(own["error"]):
        text += f" The foreseen error of potency and of failed volume was {percent(own['error'])}."
        text += (
            f" Half of it needs cells of {half['cell']:.3g} m and about {duration_text(half['processor'])} of processor"
            " time."
            if half
            else " No cells are known to halve it."
        )
    return text


def _quote_of(logs, run: Mapping) -> dict | None:
    """What `snakemake quote` foresaw for this grid and this rock; None where nobody asked."""
    try:
        quote = json.loads((Path(logs or ".") / QUOTE).read_text(encoding="utf-8"))
        whole_one = quote.keys() >= {*LIKE, "own", "half"} and quote["own"].keys() >= set(OWN)
        same = whole_one and quote["made_of"] == run["made_of"]
    except (OSError, ValueError, KeyError, TypeError):  # none was asked for, or it is no longer whole
        return None
    return quote if same else None


def read_resources(logs, steps: set[str], absent: set[str], members: int) -> list[dict]:
    """Rows of what each stage cost, from the logs below a folder: its name and the columns of `common.costs`. Empty
    without the folder.

    Logs of earlier configurations are left out: of other steps than these, of `absent` stages, of members beyond so
    many. So are logs of an earlier version. Each member of an ensemble is one row: the sum of its times, the largest of
    its peaks.
    """
    if logs is None or not Path(logs).is_dir():
        return []
    rows: list[dict] = []
    parts: dict[tuple[int, str], list[dict]] = {}
    for path in sorted(Path(logs).rglob("*.log")):
        if (cost := cost_of(path)) is None:  # of a stage that is under way: this one
            continue
        stage = path.relative_to(logs).with_suffix("").as_posix()
        found = STAGE.fullmatch(stage)
        if found is None or stage in absent or (found["step"] and found["step"] not in steps):
            continue
        member = int(found["member"] or 0)
        if member > members:
            continue
        if found["run"]:
            parts.setdefault((member, found["run"]), []).append(asdict(cost))
        else:
            name = "coarse, all stages" if stage == COARSE else stage
            rows.append({"stage": name, **asdict(cost)})
    for (_, folder), stages in sorted(parts.items()):
        total = {name: sum(stage[name] for stage in stages) for name in stages[0]}
        rows.append({"stage": f"{folder}, all stages", **total, "memory": max(stage["memory"] for stage in stages)})
    return rows
