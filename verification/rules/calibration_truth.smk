"""A calibration on known truth: its trials are calibrated to records whose true values are known."""

from verification.calibration_truth.settings import case_slice, cases, truths

TRUTH = "results/calibration_truth"


rule truth_record:
    """The catalogue of a record with known values, on the cells of the trials."""
    input:
        grid=ancient(FILES.own("grid.nc")),
        solids=MINE.solids(),
    output:
        f"{TRUTH}/{{case}}.nc",
    log:
        "logs/calibration_truth/{case}.log",
    wildcard_constraints:
        case="|".join(cases()),
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
            lambda wildcards: f"calibration/truth_{wildcards.case}",
            lambda wildcards: case_slice(TRIALS, wildcards.case),
        ),
    shell:
        "NUMBA_NUM_THREADS={threads} stage calibration trial --settings {params.settings:q} --output {output} --log {log}"


rule calibration_truth:
    """Coverage and widths of intervals, twins that come back, records that are flagged, another sampler."""
    input:
        trials=lambda wildcards: TRIALS.all_trial_files(checkpoints),
        finer=lambda wildcards: TRIALS.finer_files(),
        record=FILES.own("record.nc"),
        records=[f"{TRUTH}/{case}.nc" for case in cases()],
    output:
        table=f"{TRUTH}/table.csv",
        page=f"{TRUTH}/report.html",
    log:
        "logs/calibration_truth/report.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("verification.calibration_truth report"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: "calibration/truth",
            lambda wildcards: TRIALS.fit_slice() | truths(TRIALS),
        ),
    shell:
        "stage verification.calibration_truth report --settings {params.settings:q} --trials {input.trials}"
        " --finer {input.finer} --record {input.record} --records {input.records}"
        " --table {output.table} --page {output.page} --log {log}"
