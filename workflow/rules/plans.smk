"""Mining plans side by side, on request: `snakemake plans`."""

from workflow.plan_outcomes import PlanOutcomes

OUTCOMES = PlanOutcomes(FILES, MINE_FILE)
PLAN_RESULTS, PLAN_LOGS = f"results/{MINE.name}/{PLANS}", f"{OWN_LOGS}/{PLANS}"


rule plan_outcome:
    """Potency and energy that the runs of a plan release by step, and the chance of events near openings.

    The stage also lays a copy into results/<mine>/forecasts, by date: a forecast cannot be made again.
    """
    input:
        **INPUTS.of(
            "plan_outcome",
            "{plan}",
            settings=lambda wildcards: OUTCOMES.outcome_slice(wildcards.plan),
            grid=lambda wildcards: OUTCOMES.grid(wildcards.plan),
            # for order and provenance: the stage takes the files of each run from its settings, `runs`
            results=lambda wildcards: OUTCOMES.results(wildcards.plan),
            record=FILES.if_recorded("record.nc"),
            comparison=FILES.if_recorded("comparison.nc"),
        ),
    output:
        f"{PLAN_RESULTS}/{{plan}}/outcome.nc",
    log:
        f"{PLAN_LOGS}/{{plan}}/outcome.log",
    wildcard_constraints:
        plan=MINING_PLANS.pattern,
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(2000),
        runtime=60,
    shell:
        RUN


rule plan_openings:
    """Depth of failure, closure and failed rock at the openings of a plan, in each of its runs."""
    input:
        **INPUTS.of(
            "plan_openings",
            "{plan}",
            settings=lambda wildcards: OUTCOMES.openings_slice(wildcards.plan),
            grid=lambda wildcards: OUTCOMES.grid(wildcards.plan),
            # for order and provenance: the stage takes the files of each run from its settings, `runs`
            results=lambda wildcards: OUTCOMES.opening_results(wildcards.plan),
            record=FILES.if_recorded("record.nc"),
        ),
    output:
        f"{PLAN_RESULTS}/{{plan}}/openings.nc",
        f"{PLAN_RESULTS}/{{plan}}/openings.csv",
        f"{PLAN_RESULTS}/{{plan}}/opening_runs.nc",
    log:
        f"{PLAN_LOGS}/{{plan}}/openings.log",
    wildcard_constraints:
        plan=MINING_PLANS.pattern,
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.reading_memory("openings"),
        runtime=60,
    shell:
        RUN


if FILES.has_shaking:

    rule plan_shaking:
        """Peak ground velocity at the openings of a plan, and the demand on support."""
        input:
            **INPUTS.of(
                "plan_shaking",
                "{plan}",
                settings=lambda wildcards: OUTCOMES.shaking_slice(wildcards.plan),
                grid=lambda wildcards: OUTCOMES.grid(wildcards.plan),
                outcome=f"{PLAN_RESULTS}/{{plan}}/outcome.nc",
                failed_rock=lambda wildcards: OUTCOMES.failed_rock(wildcards.plan),
                comparison=FILES.if_recorded("comparison.nc"),
            ),
        output:
            f"{PLAN_RESULTS}/{{plan}}/shaking.nc",
            f"{PLAN_RESULTS}/{{plan}}/shaking.csv",
        log:
            f"{PLAN_LOGS}/{{plan}}/shaking.log",
        wildcard_constraints:
            plan=MINING_PLANS.pattern,
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=by_attempt(2000),
            runtime=60,
        shell:
            RUN


if FILES.has_loading:

    rule plan_loading:
        """Energy that mining by a plan releases, plastic work, loading stiffness and excess shear stress."""
        input:
            **INPUTS.of(
                "plan_loading",
                "{plan}",
                settings=lambda wildcards: OUTCOMES.loading_slice(wildcards.plan),
                grid=lambda wildcards: OUTCOMES.grid(wildcards.plan),
                elastic=lambda wildcards: OUTCOMES.elastic(wildcards.plan),
                steps=lambda wildcards: OUTCOMES.states(wildcards.plan),
            ),
        output:
            table=f"{PLAN_RESULTS}/{{plan}}/loading.csv",
            dataset=f"{PLAN_RESULTS}/{{plan}}/loading.nc",
        log:
            f"{PLAN_LOGS}/{{plan}}/loading.log",
        wildcard_constraints:
            plan=MINING_PLANS.pattern,
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=RESOURCES.reading_memory("loading"),
            runtime=60,
        shell:
            RUN


rule plans:
    """All plans side by side: a page, its figures, and a table."""
    input:
        **INPUTS.of(
            "plans",
            settings=lambda wildcards: OUTCOMES.report_slice(),
            outcomes=lambda wildcards: OUTCOMES.outcomes(),
            shaking=lambda wildcards: OUTCOMES.shaking(),
            loading=lambda wildcards: OUTCOMES.loading(),
            openings=lambda wildcards: OUTCOMES.openings(),
            grid=FILES.own("grid.nc"),
        ),
    output:
        page=f"{PLAN_RESULTS}/report.html",
        table=f"{PLAN_RESULTS}/plans.csv",
        figures=[f"{PLAN_RESULTS}/{name}.svg" for name in ("map", "course")],
    log:
        f"{PLAN_LOGS}/report.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(4000),
        runtime=60,
    shell:
        RUN
