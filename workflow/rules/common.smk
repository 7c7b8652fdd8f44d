"""What the rules share: names, sources, slices of the configuration. Nothing is run here."""

import json
import shlex

RESULTS = "results/{mine}"
# exec: a stage is a child of this process, not of a shell between them, and so ends with it (pipeline.stage)
os.environ["PIPELINE_PROCESS"] = str(os.getpid())
PYTHON = f"exec {shlex.quote(sys.executable)} -m"
shell.prefix(f"set -euo pipefail; export PYTHONPATH={shlex.quote(str(BASE))}; ")


wildcard_constraints:
    mine=re.escape(MINE.name),
    step="|".join(map(re.escape, MINE.mined_steps)) or "none",


def sources(package):
    """Source files of a package and of the base that all stages share: an edit re-runs what it may change."""
    kinds = ("*.py", "*.j2")
    return sorted(path for part in (package, "pipeline") for kind in kinds for path in BASE.glob(f"{part}/**/{kind}"))


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
