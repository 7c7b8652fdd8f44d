"""Baselines beside the model, on request: `snakemake baselines`."""

from workflow.baseline_plans import BaselinePlan
from workflow.result_files import BASELINES

BASELINE_PLAN = BaselinePlan(MINE, MINE_FILE)
BASELINE_RESULTS = f"results/{MINE.name}/{BASELINES}"


rule flaws:
    """Catalogues of seeded flaws that slip in the elastic stress of each step."""
    input:
        states=lambda wildcards: BASELINE_PLAN.states(),
        record=FILES.own("record.nc"),
        comparison=FILES.own("comparison.nc"),
    output:
        catalog=f"{BASELINE_RESULTS}/flaws.nc",
        runs=f"{BASELINE_RESULTS}/flaws_runs.nc",
    log:
        f"logs/{MINE.name}/{BASELINES}/flaws.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.baseline_memory,
        runtime=240,
    params:
        code=source_hash("baselines flaws"),
        settings=STAGES.named_slice(
            MINE.name, lambda wildcards: f"{BASELINES}/flaws", lambda wildcards: BASELINE_PLAN.flaws_slice()
        ),
    shell:
        "stage baselines flaws --settings {params.settings:q} --states {input.states} --record {input.record}"
        " --comparison {input.comparison} --output {output.catalog} --runs {output.runs} --log {log}"


rule excess_shear:
    """Catalogues of events where mining raises excess shear stress."""
    input:
        states=lambda wildcards: BASELINE_PLAN.states(),
        record=FILES.own("record.nc"),
        comparison=FILES.own("comparison.nc"),
    output:
        catalog=f"{BASELINE_RESULTS}/excess_shear.nc",
        runs=f"{BASELINE_RESULTS}/excess_shear_runs.nc",
    log:
        f"logs/{MINE.name}/{BASELINES}/excess_shear.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.baseline_memory,
        runtime=60,
    params:
        code=source_hash("baselines excess_shear"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: f"{BASELINES}/excess_shear",
            lambda wildcards: BASELINE_PLAN.excess_shear_slice(),
        ),
    shell:
        "stage baselines excess_shear --settings {params.settings:q} --states {input.states} --record {input.record}"
        " --comparison {input.comparison} --output {output.catalog} --runs {output.runs} --log {log}"


if MINE.settings.baselines.since is not None:

    rule earlier_record:
        """The record from an earlier date on, for maps and rates of earlier months."""
        input:
            FILES.record_data(),
        output:
            f"{BASELINE_RESULTS}/record.nc",
        log:
            f"logs/{MINE.name}/{BASELINES}/record.log",
        conda:
            "../envs/environment.yaml"
        threads: 1
        resources:
            mem_mb=2000,
            runtime=30,
        params:
            code=source_hash("catalogs record"),
            settings=STAGES.named_slice(
                MINE.name,
                lambda wildcards: f"{BASELINES}/record",
                lambda wildcards: BASELINE_PLAN.earlier_record_slice(),
            ),
        shell:
            "stage catalogs record --settings {params.settings:q} --output {output} --log {log}"


rule baselines:
    """The pipeline's own model and both baselines beside the record: a page, and a table of scores."""
    input:
        flaws=f"{BASELINE_RESULTS}/flaws_runs.nc",
        excess_shear=f"{BASELINE_RESULTS}/excess_shear_runs.nc",
        grid=FILES.own("grid.nc"),
        catalog=FILES.own("catalog.nc"),
        record=FILES.own("record.nc"),
        earlier=BASELINE_PLAN.earlier_record(),
        comparison=FILES.own("comparison.nc"),
        members=BASELINE_PLAN.member_events(),
    output:
        page=f"{BASELINE_RESULTS}/report.html",
        table=f"{BASELINE_RESULTS}/scores.csv",
        months=f"{BASELINE_RESULTS}/months.csv",
        rates=f"{BASELINE_RESULTS}/rates.csv",
    log:
        f"logs/{MINE.name}/{BASELINES}/report.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(4000),
        runtime=60,
    params:
        code=source_hash("baselines report"),
        settings=STAGES.named_slice(
            MINE.name, lambda wildcards: f"{BASELINES}/report", lambda wildcards: BASELINE_PLAN.report_slice()
        ),
        members=BASELINE_PLAN.members(),
    shell:
        "stage baselines report --settings {params.settings:q} --flaws {input.flaws} --excess-shear {input.excess_shear}"
        " --grid {input.grid} --catalog {input.catalog} --members {params.members} --record {input.record}"
        " --earlier {input.earlier} --comparison {input.comparison} --output {output.page} --table {output.table}"
        " --months {output.months} --rates {output.rates} --log {log}"
