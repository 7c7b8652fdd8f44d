"""The numerics driven until they break: one knob at a time, each run beside a known truth, and the page of all."""

from verification.stability.keys import KEYS, SEEDS, SEVERAL_SEEDS

KNOBS = {"stability": KEYS, "extremes": SEVERAL_SEEDS}  # of each target


wildcard_constraints:
    target="|".join(KNOBS),


rule stability_points:
    """How the runs of one knob ended, and by how much they are wrong."""
    output:
        "results/stability/points/{knob}.json",
    log:
        "logs/stability/{knob}.log",
    wildcard_constraints:
        knob="|".join([*KEYS, SEEDS]),
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        code=source_hash("verification.stability points", "config/default.yaml"),
    shell:
        "stage verification.stability points --knob {wildcards.knob} --points {output} --log {log}"


rule stability_report:
    """All knobs of a target on one page, and all their runs in one table."""
    input:
        lambda wildcards: expand("results/stability/points/{knob}.json", knob=KNOBS[wildcards.target]),
    output:
        table="results/{target}/table.csv",
        page="results/{target}/report.html",
    log:
        "logs/{target}/report.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        code=source_hash("verification.stability report"),
    shell:
        "stage verification.stability report --points {input} --table {output.table} --page {output.page} --log {log}"


rule stability:
    """The page of all knobs; fails if a run is a fault, or wrong beyond what is known."""
    input:
        table="results/stability/table.csv",
        page="results/stability/report.html",
    log:
        "logs/stability/verdict.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        code=source_hash("verification.stability verdict"),
    shell:
        "stage verification.stability verdict --table {input.table} --page {input.page} --log {log}"


use rule stability as extremes with:
    input:
        table="results/extremes/table.csv",
        page="results/extremes/report.html",
    log:
        "logs/extremes/verdict.log",
