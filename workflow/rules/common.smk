"""What the rules share: names, sources, slices of the configuration. Nothing is run here."""

import json
import shlex

from pipeline.stage import name_parent_of_stages

RESULTS = "results/{mine}"
HAS_CATALOG = bool(MINE.dated_steps)
HAS_RECORD = HAS_CATALOG and "record" in MINE.values
# `stage` in the rules below. exec: a stage is a child of this process, not of a shell between them, and ends with it
# (pipeline.stage).
name_parent_of_stages()
shell.prefix(
    f"set -euo pipefail; export PYTHONPATH={shlex.quote(str(BASE))}; "
    f'stage() {{{{ exec {shlex.quote(sys.executable)} -m "$@"; }}}}; '
)


wildcard_constraints:
    mine=re.escape(MINE.name),
    step="|".join(map(re.escape, MINE.mined_steps)) or "none",


def sources(package):
    """Source files of a package and of the base that all stages share: an edit re-runs what it may change."""
    kinds = ("*.py", "*.j2")
    return sorted(path for part in (package, "pipeline") for kind in kinds for path in BASE.glob(f"{part}/**/{kind}"))


def kept(path):
    """A result whose earlier version outlives a stage that fails: stages write whole files or none."""
    return update(path)


def slice_of(values):
    """A slice of the configuration as text: what a rule's result depends on."""
    return json.dumps(values, sort_keys=True)


def result(path):
    """A result of this mine."""
    return f"results/{MINE.name}/{path}"


def step_results(folder):
    """One file per listed step, in order."""
    return [result(f"{folder}/{step}.nc") for step in MINE.mined_steps]


def all_results():
    """Every stage's file: a missing intermediate is made again, not overlooked behind a standing report."""
    files = ["grid.nc", "elastic.nc", "report.html"]
    if MINE.dated_steps:
        files += ["catalog.nc", "catalog.csv", "catalog.xml"]
        if "record" in MINE.values:
            files += ["record.nc", "comparison.nc"]
    return [result(file) for file in files] + step_results("steps") + step_results("events")


def previous_state(wildcards):
    """The state that a step starts from: the step before, or the elastic history."""
    before = MINE.previous(wildcards.step)
    return result(f"steps/{before}.nc" if before else "elastic.nc")


def step_slice(wildcards):
    """The configuration up to this step."""
    return slice_of(MINE.step_slice(wildcards.step))


def record_files():
    """Recorded data that the record is read from; a folder's reader looks after its own files."""
    if not HAS_RECORD or MINE.values["record"]["reader"] == "elk_creek":
        return []
    return MINE.record_slice()["file"]


def if_made(option, path, made):
    """A command line option for a result that this scene may not have."""
    return f"--{option} {result(path)}" if made else ""
