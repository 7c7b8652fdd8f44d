"""From a mine's solids and mining plan to a synthetic seismic catalogue beside the recorded one.

snakemake --cores all                                              the demo mine
snakemake --cores all --configfile config/mines/elk_creek.yaml     another mine (a target stands before --configfile)
snakemake --cores all calibrate                                    the demo's rock, calibrated to its record
snakemake --cores all baselines                                    events from elastic stress alone, beside its record
snakemake --cores all plans                                        its mining plans side by side
snakemake --cores all verification                                 every scene that has a known answer
snakemake --cores all benchmarks                                   speed, beside other codes
snakemake --cores all extremes                                     random scenes at the extremes
snakemake --cores all tradeoff                                     speed against accuracy: what each knob buys
snakemake --cores all stability                                    the numerics driven until they break
snakemake --cores all catalog_spread                               what a catalogue's spread consists of
snakemake --cores all calibration_truth                            the demo's calibration on known truth
"""

from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"
include: "workflow/rules/grid.smk"
include: "workflow/rules/equilibrium.smk"
include: "workflow/rules/events.smk"
include: "workflow/rules/comparison.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/baselines.smk"
include: "workflow/rules/plans.smk"


onstart:
    note_owner(MINE.name, MINE_FILE, "name" in OVERRIDES)
    try:
        STAGES.slices.begin()
    except InputError as error:
        sys.exit(str(error))
    folder = Path(FILES.own(""))
    if left := leftovers(folder, FILES.planned()):
        print(leftovers_line(folder, left), file=sys.stderr)
    if FILES.has_catalog and not FILES.has_quakeml:
        print(
            f"{MINE.name}: frame has no place on Earth: no catalog.xml, catalog.csv in mine coordinates",
            file=sys.stderr,
        )
    if OPTIONS.runs_here and ADDRESS not in os.environ:
        os.environ[ADDRESS] = start_server()


onsuccess:
    cancel_timers()


onerror:
    cancel_timers()


rule all:
    input:
        FILES.all(),


# The verification measures the program, not the user's mine: its rules are read only if a target asks for more than the
# rules above make, so that the run of a mine imports nothing of it, and `snakemake verification` needs no other words.
# Snakemake itself looks at its targets after this file, so they are taken from the command line, as in profiles/default.
if asks_for_more(COMMAND_LINE, workflow.is_rule, MINE.name):

    include: "verification/Snakefile"


# Here, where it is known which mines there are. Snakemake takes this into all rules so far, but keeps what it has taken.
wildcard_constraints:
    mine=FOLDERS.pattern,
    step=NAME,


gc.enable()  # which rules/common.smk has disabled
gc.freeze()
