"""Loads and checks the configuration, and makes what the rules ask (workflow/result_files.py and its neighbours).

Rules depend on the sources that their stage runs (common.sources) by hash, a parameter. As input files they would be
looked at, all of them, for every waiting job, every second: a third of a core for some 300 jobs.
"""

import gc
import shlex
import sys
import threading

gc.disable()  # until all rules are read: it would search all that they import, again and again

from snakemake.cli import get_argument_parser

BASE = Path(workflow.basedir)
sys.path.insert(0, str(BASE))

from workflow.stage_client import ADDRESS
from workflow.stage_server import start_server

COMMAND_LINE = get_argument_parser().parse_args()
HAS_IDLE_CORE = workflow.is_main_process and (workflow.resource_settings.cores or 0) > 1  # None on a cluster
if HAS_IDLE_CORE and not COMMAND_LINE.dryrun and ADDRESS not in os.environ:
    start_server()  # It imports on a core that is idle while the rules are read. A call that runs no stage ends it.

import yaml
from snakemake.utils import update_config

from common.errors import InputError
from common.sources import source_hash
from common.stage import tell_stages
from workflow.snakemake_command_line import asks_for_more, read_overrides
from workflow.configuration import load
from workflow.folders import COARSE, NAME, Folders
from workflow.mining_plans import MiningPlans
from workflow.mine_folder import check_owner, leftovers, leftovers_line, note_owner
from workflow.result_files import ResultFiles
from workflow.rule_options import RuleOptions, each_time, kept
from workflow.stage_inputs import StageInputs
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
    MINE = load(config, os.path.relpath(MINE_FILE), DEFAULT, OVERRIDES)
    check_owner(MINE.name, MINE_FILE)
except InputError as error:
    sys.exit(str(error))

RESULTS = "results/{mine}"
PLANS = MiningPlans(MINE, MINE_FILE, OVERRIDES)
FOLDERS = Folders(MINE, PLANS)
FILES = ResultFiles(FOLDERS)
STAGES = StageInputs(FILES, workflow)
OPTIONS = RuleOptions(FILES, workflow)
OPTIONS.limit_jobs()
CLIENT = shlex.quote(str(BASE / "workflow/stage_client.py"))

# `stage` in the rules: by the process that has imported what stages need (workflow/stage_server.py), if there is one.
# exec: a stage without it is a child of this process, not of a shell between them, and ends with it (common.stage).
tell_stages(workflow.resource_settings.cores or 1)  # None on a cluster
shell.prefix(
    f"set -euo pipefail; export PYTHONPATH={shlex.quote(str(BASE))}; "
    f'stage() {{{{ exec {shlex.quote(sys.executable)} ${{{{{ADDRESS}:+-IS {CLIENT}}}}} -m "$@"; }}}}; '
)


def cancel_timers() -> None:
    """Let Snakemake end at once: it looks for jobs again a second after each start, and would wait for its last look."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.cancel()


# On a cluster (profiles/slurm) these are run where Snakemake runs. Those that read events alone take seconds, less than a
# wait in the queue. The fits of a calibration have no other record of their settings than Snakemake's, which a job that
# ends while Snakemake is not running leaves out. Jobs are not grouped: all steps of a run would become one job, which
# starts from its beginning after a failure.
localrules:
    calibrate,
    catalog,
    compare,
    further,
    quakeml,
    record,
    twin,
