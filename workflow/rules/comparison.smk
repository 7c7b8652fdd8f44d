"""Comparisons of the run's own mine, and its report."""

if FILES.compared:

    rule comparison:
        """Modelled beside recorded events, beside other runs of the model, and beside the run on larger cells."""
        input:
            **INPUTS.of(
                "comparison",
                catalog=FILES.own("catalog.nc"),
                record=FILES.if_recorded("record.nc"),
                grid=FILES.own("grid.nc"),
                steps=FILES.own_states(MINE.dated_steps),
                members=FILES.member_events(),
                member_states=FILES.member_states(),
                coarse=FILES.own(f"{COARSE}/catalog.nc") if FILES.has_coarse else [],
            ),
        output:
            FILES.compared,
        log:
            f"{OWN_LOGS}/comparison.log",
        priority: 1  # the longest of what the report waits for
        localrule: True
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=by_attempt(4000),
            runtime=60,
        shell:
            RUN


if FILES.has_shaking:

    rule shaking:
        """Peak ground velocity at openings from the events of all runs, and the demand on support."""
        input:
            **INPUTS.of(
                "shaking",
                grid=FILES.own("grid.nc"),
                catalog=FILES.own("catalog.nc"),
                members=FILES.member_events(),
                comparison=FILES.if_recorded("comparison.nc"),
                failed_rock=FILES.failed_rock_for_shaking(),
            ),
        output:
            FILES.own("shaking.nc"),
            FILES.own("shaking.csv"),
        log:
            f"{OWN_LOGS}/shaking.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=by_attempt(2000),
            runtime=60,
        shell:
            RUN


rule report:
    """The page that a geotechnical engineer reads top to bottom, and its figures."""
    input:
        **INPUTS.of(
            "report",
            grid=FILES.own("grid.nc"),
            elastic=FILES.own("elastic.nc"),
            steps=FILES.own_states(MINE.mined_steps),
            events=FILES.own("events") if MINE.mined_steps else [],
            catalog=FILES.own("catalog.nc") if FILES.has_catalog else [],
            event_rules=FILES.own("event_rules.nc") if FILES.has_catalog else [],
            source_parameters=FILES.own("source_parameters.nc") if FILES.has_catalog else [],
            record=FILES.if_recorded("record.nc"),
            openings=FILES.own("openings.nc") if MINE.mined_steps else [],
            observations=FILES.own("observations.nc") if FILES.has_observations else [],
            loading=FILES.own("loading.nc") if FILES.has_loading else [],
            scans=FILES.own("scans.nc") if FILES.has_scans else [],
            shaking=FILES.own("shaking.nc") if FILES.has_shaking else [],
            **FILES.comparisons(),
        ),
    output:
        page=FILES.own(".report.html"),
        figures=directory(FILES.own("figures")),
    log:
        f"{OWN_LOGS}/report.log",
    conda:
        ENVIRONMENT
    threads: 4  # More would wait for the longest section.
    resources:
        mem_mb=RESOURCES.reading_memory("report"),
        runtime=60,
    shell:
        RUN


rule report_page:
    """The report in its place: a link, which needs no room on a full disk.

    Snakemake removes what a job makes before it starts. So the earlier report stays until the next one is whole.
    """
    input:
        FILES.own(".report.html"),
    output:
        report(
            FILES.own("report.html"), caption="../report/report.rst", category=MINE.name, labels={"result": "report"}
        ),
    log:
        f"{OWN_LOGS}/report_page.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=100,
        runtime=5,
    shell:
        "ln -f {input:q} {output:q} 2> {log:q} || cp {input:q} {output:q} 2> {log:q}"
