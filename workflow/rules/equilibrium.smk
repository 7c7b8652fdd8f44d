rule elastic:
    """Elastic equilibrium of everything mined in history."""
    input:
        inputs_of("mpm_core elastic", "elastic", grid=f"{RESULTS}/grid.nc"),
    output:
        kept(f"{RESULTS}/elastic.nc"),
    params:
        code=source_hash("mpm_core elastic"),
        scene=slice_of("elastic"),
    log:
        "logs/{mine}/elastic.log",
    benchmark:
        "benchmarks/{mine}/elastic.tsv"
    threads: threads_of
    resources:
        mem_mb=elastic_memory,
        runtime=240,
    conda:
        "../envs/environment.yaml"
    shell:
        "stage mpm_core elastic --scene {params.scene:q} --grid {input.grid} --output {output} --log {log} --threads {threads}"


rule mining_step:
    """Equilibrium of rock that fails after one mining step, from the state of the step before.

    Before the events of steps that are done: those take one core, so that steps on all cores would wait beside an idle one.
    """
    input:
        inputs_of("mpm_core step", "steps/{step}", grid=grid_of, state=previous_state, bodies=bodies),
    output:
        kept(f"{RESULTS}/steps/{{step}}.nc"),
    params:
        code=source_hash("mpm_core step"),
        scene=step_slice,
    log:
        "logs/{mine}/steps/{step}.log",
    benchmark:
        "benchmarks/{mine}/steps/{step}.tsv"
    priority: 1
    threads: threads_of
    resources:
        mem_mb=step_memory,
        runtime=720,
    conda:
        "../envs/environment.yaml"
    shell:
        "stage mpm_core step --scene {params.scene:q} --grid {input.grid} --state {input.state} --output {output} --log {log} --threads {threads}"
