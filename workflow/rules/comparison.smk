rule scene:
    """A picture of the scene, before anything is solved, on request: cells, solids by step, record.

    Cells are those of the first step; cells that follow the rock are split in the steps.
    """
    input:
        grid=FILES.own("grid.nc"),
        record=FILES.own("record.nc") if FILES.has_record else [],
    output:
        FILES.own("scene.png"),
    log:
        f"logs/{MINE.name}/scene.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(4000),  # of some million cells
        runtime=30,
    params:
        code=source_hash("catalogs scene"),
        settings=STAGES.slice_of("scene"),
        record=OPTIONS.if_made("record", "record.nc", FILES.has_record),
    shell:
        "stage catalogs scene --settings {params.settings:q} --grid {input.grid} {params.record}"
        " --output {output} --log {log}"


rule record:
    """The recorded catalogue, read and filtered.

    Before the grid and what is solved on it: one that cannot be read ends the run at once.
    """
    input:
        STAGES.inputs_of("catalogs record", "record", data=FILES.record_data()),
    output:
        kept(f"{RESULTS}/record.nc"),
    log:
        "logs/{mine}/record.log",
    priority: 2
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.first_threads
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=source_hash("catalogs record"),
        settings=STAGES.slice_of("record"),
    shell:
        "stage catalogs record --settings {params.settings:q} --output {output} --log {log}"


rule quakeml:
    """The resolved events of the synthetic catalogue as QuakeML 1.2."""
    input:
        STAGES.inputs_of("catalogs quakeml", "quakeml", "catalog.xml", catalog=f"{RESULTS}/catalog.nc"),
    output:
        kept(f"{RESULTS}/catalog.xml"),
    log:
        "logs/{mine}/quakeml.log",
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.reading_threads
    resources:
        in_idle_time=OPTIONS.in_idle_time,
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("catalogs quakeml"),
    shell:
        "CORES_OF_STAGE={threads} stage catalogs quakeml --catalog {input.catalog} --output {output} --log {log}"


rule compare:
    """Modelled compared with recorded events: location, size, axes, each with a number and its interval."""
    input:
        STAGES.inputs_of(
            "catalogs compare",
            "comparison",
            catalog=f"{RESULTS}/catalog.nc",
            record=f"{RESULTS}/record.nc",
            members=FILES.member_events,
        ),
    output:
        kept(f"{RESULTS}/comparison.nc"),
    log:
        "logs/{mine}/compare.log",
    priority: 1  # the longest of what the report waits for
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=source_hash("catalogs compare"),
        settings=STAGES.slice_of("comparison"),
        members=OPTIONS.members,
    shell:
        "stage catalogs compare --catalog {input.catalog} --record {input.record} {params.members}"
        " --settings {params.settings:q} --output {output} --log {log}"


rule spread:
    """How far the members of an ensemble are apart, and where the mine's own run lies among them."""
    input:
        STAGES.inputs_of(
            "catalogs spread",
            "spread",
            runs=FILES.dated_results,
            catalog=f"{RESULTS}/catalog.nc",
            comparison=FILES.comparison,
        ),
    output:
        kept(f"{RESULTS}/spread.nc"),
    log:
        "logs/{mine}/spread.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(2000),
        runtime=30,
    params:
        code=source_hash("catalogs spread"),
        settings=STAGES.slice_of("spread"),
        runs=FILES.runs,
        comparison=OPTIONS.comparison,
    shell:
        "stage catalogs spread --catalog {input.catalog} {params.comparison} --runs {params.runs}"
        " --settings {params.settings:q} --output {output} --log {log}"


rule grid_convergence:
    """How far cells decide the numbers: the mine's run compared with that on cells of twice the size."""
    input:
        STAGES.inputs_of(
            "catalogs grid_convergence",
            "grid_convergence",
            steps=FILES.dated_steps,
            coarse_steps=FILES.coarse_dated_steps,
            catalog=f"{RESULTS}/catalog.nc",
            coarse_catalog=f"{RESULTS}/{COARSE}/catalog.nc",
            coarse_grid=f"{RESULTS}/{COARSE}/grid.nc",
        ),
    output:
        kept(f"{RESULTS}/grid_convergence.nc"),
    log:
        "logs/{mine}/grid_convergence.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(1000),
        runtime=10,
    params:
        code=source_hash("catalogs grid_convergence"),
        settings=STAGES.slice_of("grid_convergence"),
    shell:
        "stage catalogs grid_convergence --catalog {input.catalog} --coarse-catalog {input.coarse_catalog}"
        " --coarse-grid {input.coarse_grid}"
        " --steps {input.steps} --coarse-steps {input.coarse_steps}"
        " --settings {params.settings:q} --output {output} --log {log}"


rule forecast_scores:
    """How good kept forecasts were, once their months are recorded."""
    input:
        STAGES.inputs_of(
            "plans score",
            "forecast_scores",
            record=f"{RESULTS}/record.nc",
            grid=f"{RESULTS}/grid.nc",
        ),
        kept=MINE.forecasts(),
    output:
        kept(f"{RESULTS}/forecast_scores.nc"),
    log:
        "logs/{mine}/forecast_scores.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(1000),
        runtime=10,
    params:
        code=source_hash("plans score"),
        settings=STAGES.slice_of("forecast_scores"),
    shell:
        "stage plans score --settings {params.settings:q} --record {input.record} --grid {input.grid}"
        " --output {output} --log {log}"


rule report:
    """The page that a geotechnical engineer reads top to bottom, and its figures."""
    input:
        STAGES.inputs_of(
            "catalogs report",
            "report",
            "report.html",
            grid=f"{RESULTS}/grid.nc",
            elastic=f"{RESULTS}/elastic.nc",
            steps=FILES.own_steps("steps"),
            events=FILES.own_steps("events"),
            catalog=FILES.own("catalog.nc") if FILES.has_catalog else [],
            matched=[FILES.own("record.nc"), FILES.own("comparison.nc")] if FILES.has_record else [],
            spread=FILES.own("spread.nc") if MINE.members else [],
            closeness=FILES.own("closeness.nc") if FILES.has_catalog else [],
            grid_convergence=FILES.own("grid_convergence.nc") if FILES.has_coarse else [],
            forecast_scores=FILES.own("forecast_scores.nc") if FILES.has_forecasts else [],
        ),
    output:
        page=OPTIONS.packed(f"{RESULTS}/report.html", "report"),
        figures=directory(f"{RESULTS}/figures"),
    log:
        "logs/{mine}/report.log",
    conda:
        "../envs/environment.yaml"
    threads: 4  # The longest section takes about a quarter of the time of all.
    resources:
        mem_mb=OPTIONS.reading_memory("report"),
        runtime=60,
    params:
        code=source_hash("catalogs report"),
        settings=STAGES.slice_of("report"),
        catalog=OPTIONS.if_made("catalog", "catalog.nc", FILES.has_catalog),
        record=OPTIONS.if_made("record", "record.nc", FILES.has_record),
        comparison=OPTIONS.if_made("comparison", "comparison.nc", FILES.has_record),
        spread=OPTIONS.if_made("spread", "spread.nc", MINE.members),
        closeness=OPTIONS.if_made("closeness", "closeness.nc", FILES.has_catalog),
        grid_convergence=OPTIONS.if_made("grid-convergence", "grid_convergence.nc", FILES.has_coarse),
        forecast_scores=OPTIONS.if_made("forecast-scores", "forecast_scores.nc", FILES.has_forecasts),
        logs="logs/{mine}",
    shell:
        "stage catalogs report --settings {params.settings:q} --grid {input.grid} --elastic {input.elastic} --steps {input.steps}"
        " --events {input.events} {params.catalog} {params.record} {params.comparison} {params.spread} {params.closeness}"
        " {params.grid_convergence} {params.forecast_scores}"
        " --logs {params.logs} --output {output.page} --figures {output.figures} --log {log}"
        " --threads {threads}"


rule twin:
    """A record for a mine that has none: this mine's catalogue with location noise and a completeness cut, as CSV."""
    input:
        catalog=FILES.own("catalog.nc"),
    output:
        FILES.own("twin.csv"),
    log:
        f"logs/{MINE.name}/twin.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        code=source_hash("catalogs twin"),
        noise=10,  # m, root mean square
        cut=-3.0,  # log10 of potency in m3
    shell:
        "stage catalogs twin --catalog {input.catalog} --noise {params.noise} --cut {params.cut} --output {output} --log {log}"
