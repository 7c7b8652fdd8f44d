"""A calibration on known truth: the mine's trials are calibrated to records whose true values are known."""

from verification.calibration_truth.settings import case_slice, records, truths

TRUTH = "results/calibration_truth"


rule truth_record:
    """The catalogue of a record with known values, on the cells of the trials."""
    input:
        grid=ancient(FILES.own("grid.nc")),
        solids=MINE.solids(),
    output:
        f"{TRUTH}/records/{{record}}.nc",
    log:
        "logs/calibration_truth/records/{record}.log",
    wildcard_constraints:
        record="|".join(records()),
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.trial_memory,
        runtime=24 * 60,
    params:
        code=source_hash("calibration trial"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: f"calibration/truth_{wildcards.record}",
            lambda wildcards: case_slice(TRIALS, wildcards.record),
        ),
    shell:
        "NUMBA_NUM_THREADS={threads} stage calibration trial --settings {params.settings:q} --output {output} --log {log}"


rule truth_case:
    """Claims of calibrations by some of the terms."""
    input:
        trials=lambda wildcards: TRIALS.all_trial_files(checkpoints),
        finer=lambda wildcards: TRIALS.finer_files(),
        record=FILES.own("record.nc"),
        records=[f"{TRUTH}/records/{record}.nc" for record in records()],
    output:
        f"{TRUTH}/cases/{{case}}.json",
    log:
        "logs/calibration_truth/cases/{case}.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("verification case", "verification.calibration_truth.study"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: "calibration/truth",
            lambda wildcards: TRIALS.fit_slice() | truths(TRIALS),
        ),
    shell:
        "stage verification case calibration_truth {wildcards.case} --input settings {params.settings:q}"
        " --input trials {input.trials} --input finer {input.finer} --input record {input.record}"
        " --input records {input.records} --output {output} --log {log}"
