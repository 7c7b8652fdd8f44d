rule grid:
    """Cells, nodes, hanging-node constraints, and the part of each cell inside each excavation."""
    input:
        STAGES.inputs_of("mpm_core grid", "grid", solids=FILES.solids),
    output:
        kept(f"{RESULTS}/grid.nc"),
    log:
        "logs/{mine}/grid.log",
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.threads
    resources:
        in_idle_time=OPTIONS.in_idle_time,
        held_cores=OPTIONS.held_cores,
        stage_cores=OPTIONS.stage_cores,
        mem_mb=each_time(4000),  # of some million cells; how many there are is known when it is done
        runtime=30,
    params:
        code=source_hash("mpm_core grid"),
        scene=STAGES.slice_of("grid"),
    shell:
        "CORES_OF_STAGE={resources.stage_cores} stage mpm_core grid --scene {params.scene:q} --output {output} --log {log} --threads {resources.stage_cores}"


rule vtk:
    """A stage for ParaView, on request: results/<mine>/vtk/elastic.vtu or vtk/steps/<step>.vtu."""
    input:
        grid=FILES.grid,
        state=f"{RESULTS}/{{stage}}.nc",
    output:
        f"{RESULTS}/vtk/{{stage}}.vtu",
    log:
        "logs/{mine}/vtk/{stage}.log",
    wildcard_constraints:
        stage="elastic|steps/.+",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.reading_memory("vtk"),
        runtime=30,
    params:
        code=source_hash("mpm_core vtk"),
    shell:
        "stage mpm_core vtk --grid {input.grid} --state {input.state} --output {output} --log {log}"


rule vtk_solids:
    """Excavations and rock bodies for ParaView, on request: vtk/solids.vtm names the files of its folder."""
    input:
        solids=FILES.solids,
    output:
        names=f"{RESULTS}/vtk/solids.vtm",
        surfaces=directory(f"{RESULTS}/vtk/solids"),
    log:
        "logs/{mine}/vtk/solids.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(2000),
        runtime=30,
    params:
        code=source_hash("mpm_core solids"),
        scene=STAGES.slice_of("solids"),
    shell:
        "stage mpm_core solids --scene {params.scene:q} --output {output.names} --log {log}"
