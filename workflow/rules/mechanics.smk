"""The chain of the mechanics, for the mine itself, its plans and its other runs."""


rule grid:
    """Cells, nodes, hanging-node constraints, and the part of each cell inside each excavation."""
    input:
        **INPUTS.of("grid"),
    output:
        f"{RESULTS}/grid.nc",
    log:
        f"{LOGS}/grid.log",
    conda:
        ENVIRONMENT
    threads: RESOURCES.threads
    resources:
        mem_mb=by_attempt(4000),  # of some million cells; how many there are is known when it is done
        runtime=30,
    params:
        threads=RESOURCES.used_threads,
    shell:
        SOLVE


rule elastic:
    """Elastic equilibrium of everything mined in history."""
    input:
        **INPUTS.of("elastic", grid=FILES.grid),
    output:
        f"{RESULTS}/elastic.nc",
    log:
        f"{LOGS}/elastic.log",
    conda:
        ENVIRONMENT
    threads: RESOURCES.threads
    resources:
        mem_mb=RESOURCES.elastic_memory,
        runtime=240,
    params:
        threads=RESOURCES.used_threads,
    shell:
        SOLVE


rule step:
    """Equilibrium of rock that fails after one mining step, from the state of the step before."""
    input:
        **INPUTS.of("step", "{step}", grid=FILES.grid, state=FILES.previous_state),
    output:
        f"{RESULTS}/steps/{{step}}.nc",
    log:
        f"{LOGS}/steps/{{step}}.log",
    priority: 1  # before the companion
    conda:
        ENVIRONMENT
    threads: RESOURCES.threads
    resources:
        mem_mb=RESOURCES.step_memory,
        runtime=720,
    params:
        threads=RESOURCES.used_threads,
    shell:
        SOLVE


rule companion:
    """Run of the mine on cells of twice the size, all stages in one job, with the cores that other jobs leave."""
    input:
        **INPUTS.of("companion"),
        cells=FILES.grid,  # for the job's memory; not ancient: Snakemake 9 looks at no job below one that runs anew
    output:
        f"{RESULTS}/{COARSE}/grid.nc",
        f"{RESULTS}/{COARSE}/elastic.nc",
        directory(f"{RESULTS}/{COARSE}/steps"),
        directory(f"{RESULTS}/{COARSE}/events"),
        f"{RESULTS}/{COARSE}/catalog.nc",
        f"{RESULTS}/{COARSE}/catalog.csv",
    log:
        f"{LOGS}/{COARSE}.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.companion_memory,
        runtime=720,
    params:
        threads=1,
    shell:
        f"BEFORE='{IN_IDLE_TIME}' {SOLVE}"
