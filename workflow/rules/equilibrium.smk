rule elastic:
    """Elastic equilibrium of everything mined in history."""
    input:
        STAGES.inputs_of("mpm_core elastic", "elastic", grid=FILES.grid),
    output:
        kept(f"{RESULTS}/elastic.nc"),
    log:
        "logs/{mine}/elastic.log",
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.threads
    resources:
        in_idle_time=OPTIONS.in_idle_time,
        held_cores=OPTIONS.held_cores,
        stage_cores=OPTIONS.stage_cores,
        mem_mb=OPTIONS.elastic_memory,
        runtime=240,
    params:
        code=source_hash("mpm_core elastic"),
        scene=STAGES.slice_of("elastic"),
    shell:
        "CORES_OF_STAGE={resources.stage_cores} stage mpm_core elastic --scene {params.scene:q} --grid {input.grid} --output {output} --log {log} --threads {resources.stage_cores}"


rule mining_step:
    """Equilibrium of rock that fails after one mining step, from the state of the step before.

    Before stages on one core, which would otherwise begin first and hold up steps on all cores.
    """
    input:
        STAGES.inputs_of(
            "mpm_core step", "steps/{step}", grid=FILES.grid, state=FILES.previous_state, bodies=FILES.bodies
        ),
    output:
        kept(f"{RESULTS}/steps/{{step}}.nc"),
    log:
        "logs/{mine}/steps/{step}.log",
    priority: 1
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.threads
    resources:
        in_idle_time=OPTIONS.in_idle_time,
        held_cores=OPTIONS.held_cores,
        stage_cores=OPTIONS.stage_cores,
        mem_mb=OPTIONS.step_memory,
        runtime=720,
    params:
        code=source_hash("mpm_core step"),
        scene=STAGES.step_slice,
    shell:
        "CORES_OF_STAGE={resources.stage_cores} stage mpm_core step --scene {params.scene:q} --grid {input.grid} --state {input.state} --output {output} --log {log} --threads {resources.stage_cores}"
