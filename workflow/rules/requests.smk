"""Files made on request: a picture of the scene, and files for ParaView."""

import platform


rule scene:
    """A picture of the scene, before anything is solved, on request: cells, solids by step, record.

    Cells are those of the first step; cells that follow the rock are split in the steps. The stage reads the record
    itself: one that cannot be read is left out of the picture.
    """
    input:
        **INPUTS.of("scene", grid=FILES.own("grid.nc")),
    output:
        FILES.own("scene.png"),
    log:
        f"{OWN_LOGS}/scene.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(4000),  # of some million cells
        runtime=30,
    shell:
        RUN


rule quote_of_mine:
    """What the mine will take on this machine, and how wrong its cells leave it, by its first steps on larger cells."""
    input:
        **INPUTS.of("quote"),
    output:
        text=FILES.own("quote.txt"),
        values=f"{OWN_LOGS}/quote.json",  # beside the logs, from which the report reads what stages took
    log:
        f"{OWN_LOGS}/quote.log",
    conda:
        ENVIRONMENT
    threads: RESOURCES.all_cores
    resources:
        mem_mb=by_attempt(4000),
        runtime=30,
    params:  # of another machine, or with other cores, it is another one
        machine=platform.node(),
        cores=RESOURCES.all_cores,
    shell:
        RUN


rule quote:
    """Print it, on request."""
    input:
        FILES.own("quote.txt"),
    log:
        f"{OWN_LOGS}/quote_printed.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=100,
        runtime=5,
    shell:
        "cat {input:q} 2> {log:q}"


rule vtk:
    """A stage for ParaView, on request: results/<mine>/vtk/elastic.vtu or vtk/steps/<step>.vtu."""
    input:
        **INPUTS.of(
            "vtk",
            "{stage}",
            settings=lambda wildcards: {"state": f"results/{wildcards.mine}/{wildcards.stage}.nc"},
            grid=FILES.grid_of_any,
            made=FILES.made_by("{stage}"),  # for order and provenance: the stage reads `state` of its settings
        ),
    output:
        f"{RESULTS}/vtk/{{stage}}.vtu",
    log:
        f"{LOGS}/vtk/{{stage}}.log",
    wildcard_constraints:
        mine=FOLDERS.pattern_with_coarse,
        stage="elastic|steps/.+",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.reading_memory("vtk"),
        runtime=30,
    shell:
        RUN


rule vtk_events:
    """Events for ParaView, on request: vtk/catalog.vtu, vtk/record.vtu or vtk/events/<step>.vtu."""
    input:
        **INPUTS.of(
            "vtk_events",
            "{catalog}",
            settings=lambda wildcards: {"events": f"results/{wildcards.mine}/{wildcards.catalog}.nc"},
            made=FILES.made_by("{catalog}"),  # for order and provenance: the stage reads `events` of its settings
        ),
    output:
        f"{RESULTS}/vtk/{{catalog}}.vtu",
    log:
        f"{LOGS}/vtk/{{catalog}}.log",
    wildcard_constraints:
        mine=FOLDERS.pattern_with_coarse,
        catalog="catalog|record|events/.+",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(1000),
        runtime=10,
    shell:
        RUN


rule vtk_solids:
    """Excavations and rock bodies for ParaView, on request: vtk/solids.vtm names the files of its folder."""
    input:
        **INPUTS.of("vtk_solids"),
    output:
        names=f"{RESULTS}/vtk/solids.vtm",
        surfaces=directory(f"{RESULTS}/vtk/solids"),
    log:
        f"{LOGS}/vtk/solids.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(2000),
        runtime=30,
    shell:
        RUN
