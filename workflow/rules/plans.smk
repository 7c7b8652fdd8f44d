"""Mining plans side by side, on request: `snakemake plans`."""

from workflow.plan_outcomes import PlanOutcomes

OUTCOMES = PlanOutcomes(FILES, MINE_FILE)


rule plan_outcome:
    """What the runs of a plan release by step and opening, and the chance of events near openings."""
    input:
        STAGES.named_inputs(
            "plans outcome",
            f"results/{MINE.name}/plans/{{plan}}/outcome.nc",
            lambda wildcards: OUTCOMES.outcome_slice(wildcards.plan),
            grid=lambda wildcards: OUTCOMES.grid(wildcards.plan),
            results=lambda wildcards: OUTCOMES.results(wildcards.plan),
            matched=[FILES.own("record.nc"), FILES.own("comparison.nc")] if FILES.has_record else [],
        ),
    output:
        f"results/{MINE.name}/plans/{{plan}}/outcome.nc",
    log:
        f"logs/{MINE.name}/plans/{{plan}}/outcome.log",
    wildcard_constraints:
        plan=PLANS.pattern,
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(2000),
        runtime=60,
    params:
        code=source_hash("plans outcome"),
        settings=STAGES.named_slice(
            MINE.name,
            lambda wildcards: f"plans/{wildcards.plan}/outcome",
            lambda wildcards: OUTCOMES.outcome_slice(wildcards.plan),
        ),
        record=OPTIONS.if_made("record", "record.nc", FILES.has_record),
        comparison=OPTIONS.if_made("comparison", "comparison.nc", FILES.has_record),
    shell:
        "stage plans outcome --settings {params.settings:q} --grid {input.grid} {params.record} {params.comparison}"
        " --output {output} --log {log}"


rule plans:
    """All plans side by side: a page, and a table."""
    input:
        STAGES.named_inputs(
            "plans report",
            f"results/{MINE.name}/plans/report.html",
            lambda wildcards: OUTCOMES.report_slice(),
            outcomes=lambda wildcards: OUTCOMES.outcomes(),
            grid=FILES.own("grid.nc"),
        ),
    output:
        page=f"results/{MINE.name}/plans/report.html",
        table=f"results/{MINE.name}/plans/plans.csv",
    log:
        f"logs/{MINE.name}/plans/report.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(4000),
        runtime=60,
    params:
        code=source_hash("plans report"),
        settings=STAGES.named_slice(
            MINE.name, lambda wildcards: "plans/report", lambda wildcards: OUTCOMES.report_slice()
        ),
    shell:
        "stage plans report --settings {params.settings:q} --outcomes {input.outcomes} --grid {input.grid}"
        " --output {output.page} --table {output.table} --log {log}"
