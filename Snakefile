"""From a mine's solids and mining plan to a synthetic seismic catalogue beside the recorded one.

snakemake --cores all                                              the demo mine
snakemake --cores all --configfile config/mines/elk_creek.yaml     another mine (a target stands before --configfile)
snakemake --cores all verification                                 every scene that has a known answer
snakemake --cores all benchmarks                                   speed, beside other codes
snakemake --cores all extremes                                     random scenes at the extremes
snakemake --cores all tradeoff                                     speed against accuracy: what each knob buys
snakemake --cores all stability                                    the numerics driven until they break
snakemake --cores all catalog_spread                               what a catalogue's spread consists of
"""

import sys

import yaml
from snakemake.utils import min_version, update_config

min_version("9.0")
BASE = Path(workflow.basedir)
sys.path.insert(0, str(BASE))

from pipeline.errors import InputError
from workflow.command_line import read_overrides
from workflow.configuration import load
from workflow.leftovers import leftovers, message
from workflow.owners import check_owner, note_owner
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


include: "workflow/rules/common.smk"
include: "workflow/rules/grid.smk"
include: "workflow/rules/equilibrium.smk"
include: "workflow/rules/events.smk"
include: "workflow/rules/comparison.smk"
include: "workflow/rules/verification.smk"
include: "workflow/rules/benchmarks.smk"
include: "workflow/rules/extremes.smk"
include: "workflow/rules/tradeoff.smk"
include: "workflow/rules/stability.smk"
include: "workflow/rules/spread.smk"


onstart:
    note_owner(MINE.name, MINE_FILE, "name" in OVERRIDES)
    try:
        SLICES.begin()
    except InputError as error:
        sys.exit(str(error))
    folder = Path("results", MINE.name)
    if left := leftovers(folder, planned_results()):
        print(message(folder, left), file=sys.stderr)
    if HAS_CATALOG and not HAS_QUAKEML:
        print(f"{MINE.name}: frame has no place on Earth: no catalog.xml, catalog.csv in mine coordinates", file=sys.stderr)


rule all:
    input:
        all_results(),
