"""What each knob buys: studies whose variants turn one knob at a time, beside each other on one page."""


rule tradeoff_points:
    """What the variants of one study came to, and what they cost."""
    input:
        results=study_results,
        study=f"{BASE}/config/verification/{{study}}.yaml",
    output:
        f"{STUDY}/points.json",
    params:
        code=source_hash("verification.tradeoff points"),
        default=json.dumps(DEFAULT, sort_keys=True),
    log:
        "logs/verification/{study}_points.log",
    benchmark:
        "benchmarks/verification/{study}_points.tsv"
    threads: 1
    resources:
        mem_mb=6000,
        runtime=60,
    conda:
        "../envs/environment.yaml"
    shell:
        "stage verification.tradeoff points --study {input.study} --default {params.default:q}"
        " --results results/verification/{wildcards.study} --logs logs/verification/{wildcards.study}"
        " --points {output} --log {log}"


rule tradeoff:
    """The price list of speed against accuracy: table, plots, the Pareto front of each scene, a sentence for each knob."""
    input:
        points=expand(f"{STUDY}/points.json", study=tradeoff_studies()),
        studies=expand(f"{BASE}/config/verification/{{study}}.yaml", study=tradeoff_studies()),
    output:
        table="results/tradeoff/table.csv",
        page="results/tradeoff/report.html",
    params:
        code=source_hash("verification.tradeoff report"),
        default=json.dumps(DEFAULT, sort_keys=True),
    log:
        "logs/tradeoff.log",
    benchmark:
        "benchmarks/tradeoff.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    conda:
        "../envs/environment.yaml"
    shell:
        "stage verification.tradeoff report --studies {input.studies:q} --points {input.points} --default {params.default:q}"
        " --table {output.table} --page {output.page} --log {log}"
