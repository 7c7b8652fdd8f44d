"""Speed beside other codes. `threads` is all there are: one case at a time, so that none disturbs another."""

from verification.benchmarks import targets


rule benchmark_case:
    """One code, problem and size. The cases stand in one row, codes in turns, and run in that order."""
    input:
        before=targets.runs_before,
    output:
        targets.RUN,
    log:
        "logs/benchmarks/{problem}/{code}/{across}.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 64
    resources:
        mem_mb=21000,
        runtime=60,
    params:
        code=source_hash(
            "verification.benchmarks measure", "verification.benchmarks solve", "verification/benchmarks/peers/"
        ),
        settings=targets.settings_slice,
        earlier=targets.smaller_runs,
        environments=f"{targets.RESULTS}/environments",
    shell:
        "stage verification.benchmarks measure {wildcards.problem} {wildcards.code} {wildcards.across}"
        " --earlier {params.earlier} --environments {params.environments} --output {output} --threads {threads} --log {log}"


rule benchmarks:
    """Elastic and Coulomb equilibrium at growing size, both schemes beside other codes, and a brittle step: table, plot, page."""
    input:
        runs=targets.all_runs,
    output:
        table=f"{targets.RESULTS}/table.csv",
        figure=f"{targets.RESULTS}/figure.svg",
        page=f"{targets.RESULTS}/report.html",
    log:
        "logs/benchmarks/report.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        code=source_hash("verification.benchmarks report"),
        settings=targets.settings_slice,
    shell:
        "stage verification.benchmarks report --runs {input.runs}"
        " --table {output.table} --figure {output.figure} --page {output.page} --log {log}"
