"""What a catalogue's spread consists of: perturbed members, ways of loading, cells and closeness beside each other."""

SPREAD_STUDIES = STUDIES.named("spread_")[::-1]  # the smallest scene first


rule catalog_spread:
    """Variances of potency, number, b and the largest event by source; what an ensemble costs and buys."""
    input:
        results=lambda wildcards: STUDIES.results_of(SPREAD_STUDIES),
        studies=[STUDIES.file(name) for name in SPREAD_STUDIES],
    output:
        table="results/catalog_spread/table.csv",
        page="results/catalog_spread/report.html",
    log:
        "logs/catalog_spread.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        code=source_hash("verification.spread report"),
        default=STUDIES.default_text,
    shell:
        "stage verification.spread report --studies {input.studies:q} --default {params.default:q} --results results/verification"
        " --logs logs/verification --table {output.table} --page {output.page} --log {log}"
