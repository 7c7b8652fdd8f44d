def previous_state(wildcards):
    """The state that a step starts from: the step before, or the elastic history."""
    before = MINE.previous(wildcards.step)
    return result(f"steps/{before}.nc" if before else "elastic.nc")


def step_slice(wildcards):
    """The configuration up to this step."""
    return slice_of(MINE.step_slice(wildcards.step))


rule elastic:
    """Elastic equilibrium of everything mined in history."""
    input:
        grid=f"{RESULTS}/grid.nc",
        code=sources("mpm_core"),
    output:
        f"{RESULTS}/elastic.nc",
    params:
        scene=slice_of(MINE.scene_slice(0)),
    log:
        "logs/{mine}/elastic.log",
    benchmark:
        "benchmarks/{mine}/elastic.tsv"
    threads: 64
    resources:
        mem_mb=8000,
        runtime=240,
    conda:
        "../envs/environment.yaml"
    shell:
        "{PYTHON} mpm_core elastic --scene {params.scene:q} --grid {input.grid} --output {output} --log {log} --threads {threads}"


rule mining_step:
    """Coulomb equilibrium after one mining step, from the state of the step before."""
    input:
        grid=f"{RESULTS}/grid.nc",
        state=previous_state,
        code=sources("mpm_core"),
    output:
        f"{RESULTS}/steps/{{step}}.nc",
    params:
        scene=step_slice,
    log:
        "logs/{mine}/steps/{step}.log",
    benchmark:
        "benchmarks/{mine}/steps/{step}.tsv"
    threads: 64
    resources:
        mem_mb=8000,
        runtime=720,
    conda:
        "../envs/environment.yaml"
    shell:
        "{PYTHON} mpm_core step --scene {params.scene:q} --grid {input.grid} --state {input.state} --output {output} --log {log} --threads {threads}"
