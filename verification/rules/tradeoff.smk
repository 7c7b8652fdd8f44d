"""What each knob buys: studies whose variants turn one knob at a time, beside each other on one page."""

TRADEOFF_STUDIES = STUDIES.named("tradeoff_")


rule tradeoff_points:
    """What the variants of one study came to, and what they cost."""
    input:
        results=STUDIES.results,
        study=STUDIES.file("{study}"),
    output:
        f"{STUDY}/points.json",
    log:
        "logs/verification/{study}_points.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=6000,
        runtime=60,
    params:
        code=source_hash("verification.tradeoff points"),
        default=STUDIES.default_text,
    shell:
        "stage verification.tradeoff points --study {input.study} --default {params.default:q}"
        " --results results/verification/{wildcards.study} --logs logs/verification/{wildcards.study}"
        " --points {output} --log {log}"


rule tradeoff:
    """The price list of speed against accuracy: table, plots, the Pareto front of each scene, a sentence for each knob."""
    input:
        points=expand(f"{STUDY}/points.json", study=TRADEOFF_STUDIES),
        studies=[STUDIES.file(name) for name in TRADEOFF_STUDIES],
    output:
        table="results/tradeoff/table.csv",
        page="results/tradeoff/report.html",
    log:
        "logs/tradeoff.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=source_hash("verification.tradeoff report"),
        default=STUDIES.default_text,
    shell:
        "stage verification.tradeoff report --studies {input.studies:q} --points {input.points} --default {params.default:q}"
        " --table {output.table} --page {output.page} --log {log}"
