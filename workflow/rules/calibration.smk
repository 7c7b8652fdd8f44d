"""The calibration of a mine to its record, on request: `snakemake calibrate`."""

from workflow.calibration_trials import CalibrationTrials

TRIALS = CalibrationTrials(MINE, MINE_FILE)
CALIBRATION = f"results/{MINE.name}/calibration"


rule trial:
    """One trial: a run of the mine with other values of the calibrated quantities, as one job.

    The grid of the mine itself is an input for its number of cells only, from which the memory of a trial follows.
    """
    input:
        STAGES.named_inputs(
            "calibration trial",
            f"{CALIBRATION}/{{cells}}/{{trial}}.nc",
            lambda wildcards: TRIALS.slice_of(wildcards.trial, wildcards.cells),
            unread=("grid", "solids"),
            grid=ancient(FILES.own("grid.nc")),
            solids=MINE.solids(),
        ),
    output:
        f"{CALIBRATION}/{{cells}}/{{trial}}.nc",
    log:
        f"logs/{MINE.name}/calibration/{{cells}}/{{trial}}.log",
    wildcard_constraints:
        cells="doubled|own",
        trial=TRIALS.pattern,
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.trial_memory,
        runtime=24 * 60,
    params:
        code=source_hash("calibration trial"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: f"calibration/{wildcards.cells}/{wildcards.trial}",
            lambda wildcards: TRIALS.slice_of(wildcards.trial, wildcards.cells),
        ),
    shell:
        "NUMBA_NUM_THREADS={threads} stage calibration trial --settings {params.settings:q} --output {output} --log {log}"


checkpoint further:
    """Where the trials of a further batch teach most, given all trials before."""
    input:
        trials=lambda wildcards: TRIALS.trial_files(int(wildcards.batch), checkpoints),
        finer=lambda wildcards: TRIALS.finer_files(),
        record=FILES.own("record.nc"),
    output:
        TRIALS.batch_file("{batch}"),
    log:
        f"logs/{MINE.name}/calibration/batch_{{batch}}.log",
    wildcard_constraints:
        batch="[1-9][0-9]*",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("calibration further"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: f"calibration/batch_{wildcards.batch}",
            lambda wildcards: TRIALS.fit_slice(int(wildcards.batch)),
        ),
    shell:
        "stage calibration further --settings {params.settings:q} --trials {input.trials} --finer {input.finer}"
        " --record {input.record} --output {output} --log {log}"


rule calibrate:
    """The posterior of the calibrated quantities, its page, and mine files."""
    input:
        trials=lambda wildcards: TRIALS.all_trial_files(checkpoints),
        finer=lambda wildcards: TRIALS.finer_files(),
        record=FILES.own("record.nc"),
    output:
        page=f"{CALIBRATION}/report.html",
        table=f"{CALIBRATION}/trials.csv",
        mines=[f"{CALIBRATION}/{name}.yaml" for name in TRIALS.mine_files],
    log:
        f"logs/{MINE.name}/calibration/fit.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("calibration fit"),
        settings=STAGES.named_slice(
            MINE.name, lambda wildcards: "calibration/fit", lambda wildcards: TRIALS.fit_slice()
        ),
    shell:
        "stage calibration fit --settings {params.settings:q} --trials {input.trials} --finer {input.finer}"
        " --record {input.record} --output {output.page} --table {output.table} --log {log}"
