"""Time and memory that each stage of the run took, from its log.

The template is "resources.html.j2".
"""

import re
from dataclasses import asdict
from pathlib import Path

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery
from common.costs import cost_of
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


def section(evidence: Evidence, _: Gallery) -> list[dict]:
    """Rows of the section on resources, one for each stage of the run: its name and the columns of `common.costs`."""
    absent = {stage for stage, names in MADE_BY.items() if all(getattr(evidence, name) is None for name in names)}
    absent |= set() if evidence.steps else {"events"}
    members = 0 if evidence.spread is None else int(evidence.spread.attrs["members"])
    return read_resources(evidence.logs, {str(step["step"]) for step in evidence.steps}, absent, members)


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
