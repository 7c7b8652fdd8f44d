"""From a mine's solids and mining plan to a synthetic seismic catalogue beside the recorded one.

snakemake --cores all                                              the demo mine
snakemake --cores all --configfile config/mines/elk_creek.yaml     another mine (a target stands before --configfile)
snakemake --cores all quote                                        what it takes, and how wrong its cells leave it
snakemake --cores all calibrate                                    the demo's rock, calibrated to its record
snakemake --cores all baselines                                    events from elastic stress alone, beside its record
snakemake --cores all plans                                        its mining plans side by side
snakemake --cores all export                                       its results for other programs
snakemake --cores all verification                                 every scene that has a known answer
snakemake --cores all benchmarks                                   speed, beside other codes
snakemake --cores all extremes                                     random scenes at the extremes
snakemake --cores all tradeoff                                     speed against accuracy: what each knob buys
snakemake --cores all stability                                    the numerics driven until they break
snakemake --cores all mine_times                                   what a mine costs, by cells and steps
snakemake --cores all scale                                        how time and memory grow with a mine
snakemake --cores all foreseen                                     what quotes foresee beside what runs take
snakemake --cores 1 economies                                      what each economy saves, off against on
snakemake --cores all catalog_spread                               what a catalogue's spread consists of
snakemake --cores all calibration_truth                            the demo's calibration on known truth
"""


include: "workflow/pipeline.smk"


rule all:
    """Everything that the mine's file asks for, up to the report."""
    input:
        FILES.all(),
