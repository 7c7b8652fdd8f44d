"""Loads and checks the configuration, and makes what the rules ask."""

import shlex
import shutil
import sys

# The folder of the packages: the checkout, or in an installation the one above the package `workflow`.
PACKAGES = Path(workflow.basedir)
PACKAGES = PACKAGES if (PACKAGES / "mpm_core").is_dir() else PACKAGES.parent
sys.path.insert(0, str(PACKAGES))

import yaml
from snakemake.utils import update_config

from common.errors import InputError
from workflow import BASE
from workflow.command_line import draws_alone, read_overrides
from workflow.configuration import load
from common.stage import PARENT
from common.result_folders import BASELINES, CALIBRATION, COARSE, PLANS
from workflow.folders import NAME, Folders
from workflow.mining_plans import MiningPlans
from workflow.mine_folder import check_owner, note_owner
from workflow.narrow_openings import notes
from workflow.repeated_jobs import RepeatedJob, notice
from workflow.result_files import ResultFiles
from workflow.rule_inputs import RuleInputs
from workflow.rule_resources import RuleResources, by_attempt
from workflow.strict_yaml import check_files


configfile: BASE / "config/default.yaml"


DEFAULT = yaml.safe_load((BASE / "config/default.yaml").read_text())
MINE_FILE = BASE / "config/mines/demo.yaml"
if workflow.overwrite_configfiles:
    MINE_FILE = Path(workflow.overwrite_configfiles[-1])
else:

    configfile: MINE_FILE


try:
    check_files(workflow.overwrite_configfiles or [MINE_FILE])
    OVERRIDES = read_overrides(workflow.config_settings.config_args)
    update_config(config, OVERRIDES)
    MINE = load(config, os.path.relpath(MINE_FILE), DEFAULT, OVERRIDES, may_lack_record=draws_alone())
    check_owner(MINE.name, MINE_FILE)
    if workflow.is_main_process:
        told = [MINE.requested] if MINE.requested else []
        told += MINE.made_schedule.notes if MINE.made_schedule else []
        told += [f"frame.grid: {MINE.grid_text}"] if MINE.grid_text else []
        for note in [*told, *(notes(MINE) if workflow.overwrite_configfiles else [])]:
            print(f"{MINE.name}: {note}", file=sys.stderr)
except InputError as error:
    sys.exit(str(error))

RESULTS, LOGS = "results/{mine}", "logs/{mine}"
OWN_LOGS = f"logs/{MINE.name}"
MINING_PLANS = MiningPlans(MINE, MINE_FILE, OVERRIDES)
FOLDERS = Folders(MINE, MINING_PLANS)
FILES = ResultFiles(FOLDERS)
INPUTS = RuleInputs(FOLDERS)
RESOURCES = RuleResources(FILES, workflow.resource_settings.cores)  # None on a cluster


def literal(text):
    """Text with braces doubled, which Snakemake would take for a name."""
    return text.replace("{", "{{").replace("}", "}}")


ENVIRONMENT = literal(str(PACKAGES / "workflow/envs/environment.yaml"))

# Rules with `localrule` take seconds, less than a wait in a cluster's queue: they run where Snakemake runs.

# `stage` runs a module of ours. It is a child of this process, not of a shell between them, and ends with it
# (common.stage). What is in BEFORE begins its command line.
# Python looks for packages at PYTHONPATH, not in the working directory: there may be another checkout.
shell.prefix(
    f"set -euo pipefail; export {PARENT}=$PPID PYTHONSAFEPATH=1 PYTHONPATH={literal(shlex.quote(str(PACKAGES)))}; "
    f'stage() {{{{ exec ${{{{BEFORE:-}}}} {literal(shlex.quote(sys.executable))} -m "$@"; }}}}; '
)
RUN = "stage workflow {input.job:q} --output {output:q} --log {log:q} --threads"
# Stages that solve equilibrium have numba's threads, others run their kernels on one.
SOLVE, RUN = f"{RUN} {{params.threads}}", f"NUMBA_NUM_THREADS=1 {RUN} {{threads}}"
# A stage beside others gets what these leave of the cores.
IN_IDLE_TIME = "chrt --idle 0" if shutil.which("chrt") else "nice -n 19"
