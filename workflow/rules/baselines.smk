"""Baselines beside the model, on request: `snakemake baselines`."""

from workflow.mine_baselines import MineBaselines

MINE_BASELINES = MineBaselines(MINE, MINE_FILE)
BASELINE_RESULTS, BASELINE_LOGS = f"results/{MINE.name}/{BASELINES}", f"{OWN_LOGS}/{BASELINES}"


rule flaws:
    """Catalogues of seeded flaws that slip in the elastic stress of each step."""
    input:
        **INPUTS.of(
            "flaws",
            settings=lambda wildcards: MINE_BASELINES.flaws_slice(),
            states=lambda wildcards: MINE_BASELINES.states(),
            record=FILES.own("record.nc"),
            comparison=FILES.own("comparison.nc"),
        ),
    output:
        catalog=f"{BASELINE_RESULTS}/flaws.nc",
        runs=f"{BASELINE_RESULTS}/flaws_runs.nc",
    log:
        f"{BASELINE_LOGS}/flaws.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.baseline_memory,
        runtime=240,
    shell:
        RUN


rule excess_shear:
    """Catalogues of events where mining raises excess shear stress."""
    input:
        **INPUTS.of(
            "excess_shear",
            settings=lambda wildcards: MINE_BASELINES.excess_shear_slice(),
            states=lambda wildcards: MINE_BASELINES.states(),
            record=FILES.own("record.nc"),
            comparison=FILES.own("comparison.nc"),
        ),
    output:
        catalog=f"{BASELINE_RESULTS}/excess_shear.nc",
        runs=f"{BASELINE_RESULTS}/excess_shear_runs.nc",
    log:
        f"{BASELINE_LOGS}/excess_shear.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.baseline_memory,
        runtime=60,
    shell:
        RUN


if MINE.settings.baselines.since is not None:

    rule earlier_record:
        """The record from an earlier date on, for maps and rates of earlier months."""
        input:
            **INPUTS.of("earlier_record", settings=lambda wildcards: MINE_BASELINES.earlier_record_slice()),
        output:
            f"{BASELINE_RESULTS}/record.nc",
        log:
            f"{BASELINE_LOGS}/record.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=2000,
            runtime=30,
        shell:
            RUN


rule baselines:
    """The pipeline's own model and both baselines beside the record: a page, its figure, and tables."""
    input:
        **INPUTS.of(
            "baselines",
            settings=lambda wildcards: MINE_BASELINES.report_slice(),
            flaws=f"{BASELINE_RESULTS}/flaws_runs.nc",
            excess_shear=f"{BASELINE_RESULTS}/excess_shear_runs.nc",
            grid=FILES.own("grid.nc"),
            catalog=FILES.own("catalog.nc"),
            record=FILES.own("record.nc"),
            earlier=MINE_BASELINES.earlier_record(),
            comparison=FILES.own("comparison.nc"),
            members=FILES.member_events(),
            states=lambda wildcards: MINE_BASELINES.own_states(),
        ),
    output:
        page=f"{BASELINE_RESULTS}/report.html",
        table=f"{BASELINE_RESULTS}/scores.csv",
        months=f"{BASELINE_RESULTS}/months.csv",
        rates=f"{BASELINE_RESULTS}/rates.csv",
        alerts=f"{BASELINE_RESULTS}/alerts.csv",
        figure=f"{BASELINE_RESULTS}/events.svg",
        alert_figure=f"{BASELINE_RESULTS}/alerts.svg",
        number_figure=f"{BASELINE_RESULTS}/numbers.svg",
        csep=[directory(f"{BASELINE_RESULTS}/csep")] if MINE_BASELINES.has_place else [],
    log:
        f"{BASELINE_LOGS}/report.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(4000),
        runtime=60,
    shell:
        RUN
