"""The calibration of a mine to its record and its instruments, on request: `snakemake calibrate`."""

from workflow.calibration_trials import CalibrationTrials

TRIALS = CalibrationTrials(MINE, MINE_FILE)
TRIAL_RESULTS = f"results/{MINE.name}/{CALIBRATION}"


rule calibration_record:
    """Refuses a record that cannot be calibrated to, before any trial."""
    input:
        **INPUTS.of(
            "calibration_record",
            settings=lambda wildcards: TRIALS.record_slice(),
            record=FILES.own("record.nc"),
        ),
    output:
        f"{TRIAL_RESULTS}/record.json",
    log:
        f"{OWN_LOGS}/{CALIBRATION}/record.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    shell:
        RUN


rule calibration_readings:
    """Readings of the instruments, by step."""
    input:
        **INPUTS.of("calibration_readings", settings=lambda wildcards: TRIALS.readings_slice()),
    output:
        f"{TRIAL_RESULTS}/readings.nc",
    log:
        f"{OWN_LOGS}/{CALIBRATION}/readings.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    shell:
        RUN


rule trial:
    """One trial: a run of the mine with other values of the calibrated quantities, as one job."""
    input:
        **INPUTS.of(
            "trial", "{cells}/{trial}", settings=lambda wildcards: TRIALS.slice_of(wildcards.trial, wildcards.cells)
        ),
        cells=FILES.own("grid.nc"),  # for the job's memory; not ancient, see the rule companion
        record=ancient(TRIALS.record_check),  # no trial runs for a record that is refused
    output:
        f"{TRIAL_RESULTS}/{{cells}}/{{trial}}.nc",
    log:
        f"{OWN_LOGS}/{CALIBRATION}/{{cells}}/{{trial}}.log",
    wildcard_constraints:
        cells="doubled|own",
        trial=TRIALS.pattern,
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.trial_memory,
        runtime=24 * 60,
    shell:
        RUN


checkpoint further:
    """Points of a further batch, at which trials teach most, given all trials before."""
    input:
        **INPUTS.of(
            "further",
            "{batch}",
            settings=lambda wildcards: TRIALS.fit_slice(int(wildcards.batch)),
            trials=lambda wildcards: TRIALS.trial_files(int(wildcards.batch), checkpoints),
            finer=lambda wildcards: TRIALS.finer_files(),
            record=TRIALS.record,
            readings=TRIALS.readings,
        ),
    output:
        TRIALS.batch_file("{batch}"),
    log:
        f"{OWN_LOGS}/{CALIBRATION}/batch_{{batch}}.log",
    wildcard_constraints:
        batch="[1-9][0-9]*",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    shell:
        RUN


rule calibrate:
    """The posterior of the calibrated quantities, its page, and mine files."""
    input:
        **INPUTS.of(
            "calibrate",
            settings=lambda wildcards: TRIALS.fit_slice(),
            trials=lambda wildcards: TRIALS.all_trial_files(checkpoints),
            finer=lambda wildcards: TRIALS.finer_files(),
            record=TRIALS.record,
            readings=TRIALS.readings,
        ),
    output:
        page=f"{TRIAL_RESULTS}/report.html",
        table=f"{TRIAL_RESULTS}/trials.csv",
        mines=[f"{TRIAL_RESULTS}/{name}.yaml" for name in TRIALS.mine_files],
        figures=TRIALS.figures,
    log:
        f"{OWN_LOGS}/{CALIBRATION}/fit.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    shell:
        RUN
