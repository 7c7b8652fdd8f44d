"""A calibration on known truth: the mine's trials are calibrated to records whose true values are known."""

from verification.calibration_truth.settings import case_slice, records, truths

TRUTH = "results/calibration_truth"


rule truth_record:
    """The catalogue of a record with known values, on the cells of the trials."""
    input:
        **INPUTS.of("trial", "truth_{record}", settings=lambda wildcards: case_slice(TRIALS, wildcards.record)),
        cells=FILES.own("grid.nc"),  # for the job's memory; not ancient, see the rule companion
    output:
        f"{TRUTH}/records/{{record}}.nc",
    log:
        "logs/calibration_truth/records/{record}.log",
    wildcard_constraints:
        record="|".join(records()),
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.trial_memory,
        runtime=24 * 60,
    shell:
        RUN


rule truth_case:
    """Claims of calibrations by some of the terms."""
    input:
        # a job of the calibration that knows the truth, too
        **INPUTS.of(
            "calibrate",
            "truth",
            settings=lambda wildcards: TRIALS.fit_slice() | truths(TRIALS),
            trials=lambda wildcards: TRIALS.all_trial_files(checkpoints),
            finer=lambda wildcards: TRIALS.finer_files(),
            record=FILES.own("record.nc"),
        ),
        records=[f"{TRUTH}/records/{record}.nc" for record in records()],
    output:
        f"{TRUTH}/cases/{{case}}.json",
    log:
        "logs/calibration_truth/cases/{case}.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=case_sources("calibration_truth"),
    shell:
        "stage verification case calibration_truth {wildcards.case} --input settings {input.job}"
        " --input trials {input.trials} --input finer {input.finer} --input record {input.record}"
        " --input records {input.records} --output {output} --log {log}"
