"""Scenes at the extremes, drawn by seed, and relations between scenes that must hold."""


rule extremes:
    """400 random scenes, a fifth of them also scaled, shifted, reordered and by the other scheme; fails at a fault."""
    output:
        table="results/extremes/table.csv",
    params:
        code=source_hash("verification.extremes", "config/default.yaml"),
    log:
        "logs/extremes.log",
    benchmark:
        "benchmarks/extremes.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=120,
    conda:
        "../../workflow/envs/environment.yaml"
    shell:
        "stage verification.extremes --table {output.table} --log {log}"
