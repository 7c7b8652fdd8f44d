rule answer:
    """One study beside its known answer: rows of expected and obtained, and a figure."""
    input:
        results=STUDIES.results,
        study=STUDIES.file("{study}"),
    output:
        rows=f"{STUDY}/rows.csv",
        figure=f"{STUDY}/figure.svg",
    log:
        "logs/verification/{study}.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=STUDIES.answer_sources,
        default=STUDIES.default_text,
    shell:
        "stage verification answer --study {input.study} --default {params.default:q}"
        " --results results/verification/{wildcards.study} --logs logs/verification/{wildcards.study}"
        " --rows {output.rows} --figure {output.figure} --log {log}"


rule verification_report:
    """All studies on one page, and all their rows in one table."""
    input:
        answers=STUDIES.answers,
    output:
        page=report("results/verification/report.html", caption="verification.rst", category="verification"),
        summary="results/verification/summary.csv",
    log:
        "logs/verification/report.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=source_hash("verification report"),
        studies=STUDIES.verified_files,
        default=STUDIES.default_text,
    shell:
        "stage verification report --studies {params.studies:q} --default {params.default:q} --results results/verification"
        " --logs logs/verification --page {output.page} --summary {output.summary} --log {log}"


rule verification:
    """Every scene that has a known answer; fails if a row of the summary fails."""
    input:
        summary="results/verification/summary.csv",
        page="results/verification/report.html",
    log:
        "logs/verification/verdict.log",
    conda:
        "../../workflow/envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    shell:
        "stage verification verdict --summary {input.summary} --page {input.page} --log {log}"
