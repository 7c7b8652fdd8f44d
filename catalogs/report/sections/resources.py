"""What each stage of the run took, from its log.

The template is "resources.html.j2".
"""

import re
from dataclasses import asdict
from pathlib import Path

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from common.costs import cost_of

# Folders of the runs besides the mine's own: on cells of twice the size, in elastic rock, members of an ensemble.
RUNS_IN_ONE_ROW = re.compile(r"(coarse|elastic_rock|ensemble/(\d+))/")
MADE_BY = {  # stage, named as its log is, and the dataset without which it belongs to an earlier plan
    "catalog": "catalog",
    "quakeml": "catalog",
    "closeness": "closeness",
    "record": "record",
    "compare": "comparison",
    "spread": "spread",
    "forecast_scores": "forecast_scores",
    "grid_convergence": "grid_convergence",
    "coarse": "grid_convergence",
}
OTHER_PAGES = ("baselines", "calibration", "drawn_rock", "plans")  # folders of what has a page of its own


def section(evidence: Evidence, _: Gallery) -> list[dict]:
    """What the template shows."""
    absent = {stage for stage, name in MADE_BY.items() if getattr(evidence, name) is None}
    members = 0 if evidence.spread is None else int(evidence.spread.attrs["members"])
    return read_resources(evidence.logs, {str(step["step"]) for step in evidence.steps}, absent, members)


def read_resources(logs, steps: set[str], absent: set[str], members: int) -> list[dict]:
    """What each stage cost, from the logs of stages below a folder: columns as in `common.costs`.

    Logs of earlier plans are left out: of other steps than these, of `absent` stages, of members beyond so many. The
    companion on larger cells is one row, and so is each member of an ensemble: the sum of its times, the largest of
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
        *folders, last = stage.split("/")
        if folders and folders[0] in OTHER_PAGES:
            continue
        if {stage, *folders} & absent or ({"steps", "events"} & {*folders} and last not in steps):
            continue
        part = RUNS_IN_ONE_ROW.match(stage)
        if part and int(part[2] or 0) > members:
            continue
        if part:
            parts.setdefault((int(part[2] or 0), part[1]), []).append(asdict(cost))
        else:
            rows.append({"stage": stage, **asdict(cost)})
    for (_, folder), stages in sorted(parts.items()):
        total = {name: sum(stage[name] for stage in stages) for name in stages[0]}
        rows.append({"stage": f"{folder}, all stages", **total, "memory": max(stage["memory"] for stage in stages)})
    return rows
