"""What each stage of the run took, from its log.

The template is "resources.html.j2".
"""

import re
from dataclasses import asdict
from pathlib import Path

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from common.costs import cost_of
from common.result_folders import BASELINES, CALIBRATION, COARSE, DRAWN_ROCK, ELASTIC_ROCK, ENSEMBLE, PLANS

# Folders of the runs whose stages are jobs of their own: in elastic rock, members of an ensemble.
RUNS_IN_ONE_ROW = re.compile(rf"({ELASTIC_ROCK}|{ENSEMBLE}/(\d+))/")
MADE_BY = {  # stage, named as its log is, and the dataset without which it belongs to an earlier plan
    "catalogue": "catalog",
    "record": "record",
    COARSE: "grid_convergence",
}
OTHER_PAGES = (BASELINES, CALIBRATION, DRAWN_ROCK, PLANS)  # folders of what has a page of its own


def section(evidence: Evidence, _: Gallery) -> list[dict]:
    """What the template shows."""
    absent = {stage for stage, name in MADE_BY.items() if getattr(evidence, name) is None}
    members = 0 if evidence.spread is None else int(evidence.spread.attrs["members"])
    return read_resources(evidence.logs, {str(step["step"]) for step in evidence.steps}, absent, members)


def read_resources(logs, steps: set[str], absent: set[str], members: int) -> list[dict]:
    """What each stage cost, from the logs of stages below a folder: columns as in `common.costs`.

    Logs of earlier plans are left out: of other steps than these, of `absent` stages, of members beyond so many. Each
    member of an ensemble is one row: the sum of its times, the largest of its peaks.
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
        if {stage, *folders} & absent or ("steps" in folders and last not in steps):
            continue
        part = RUNS_IN_ONE_ROW.match(stage)
        if part and int(part[2] or 0) > members:
            continue
        if part:
            parts.setdefault((int(part[2] or 0), part[1]), []).append(asdict(cost))
        else:
            name = "coarse, all stages" if stage == COARSE else stage
            rows.append({"stage": name, **asdict(cost)})
    for (_, folder), stages in sorted(parts.items()):
        total = {name: sum(stage[name] for stage in stages) for name in stages[0]}
        rows.append({"stage": f"{folder}, all stages", **total, "memory": max(stage["memory"] for stage in stages)})
    return rows
