"""Studies from their cases to their tables, and a verdict on each table: verification/frame.py.

A study with a known answer is a file of config/verification. The rules of a mine run its variants.
"""

STUDY = "results/verification/{study}"
# The study is named by the folder of its table.
VERDICT = "stage verification verdict $(basename $(dirname {input.table})) --table {input.table} --log {log}"


rule answer:
    """One study beside its known answer: a table of expected and obtained, a figure, and what its variants cost."""
    input:
        results=STUDIES.results,
        study=STUDIES.file("{study}"),
    output:
        table=f"{STUDY}/table.csv",
        figure=f"{STUDY}/figure.svg",
        costs=f"{STUDY}/costs.csv",
        made=f"{STUDY}/made.json",
    log:
        "logs/verification/{study}.log",
    conda:
        ENVIRONMENT
    threads: STUDIES.answer_threads
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        code=STUDIES.answer_sources,
        default=STUDIES.default_text,
    shell:
        "stage verification answer {wildcards.study}"
        " --output {output.table} --figure {output.figure} --costs {output.costs} --log {log} --threads {threads}"


rule summary:
    """The rows of all studies with a known answer in one table."""
    input:
        STUDIES.tables,
    output:
        table="results/verification/table.csv",
        made="results/verification/made.json",
    log:
        "logs/verification/table.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        code=package_hash("verification"),
    shell:
        "stage verification table verification --cases {input} --output {output.table} --log {log}"


rule case:
    """One case of a measuring study. Cases of calibration_truth have a rule of their own."""
    input:
        CASES.inputs,
    output:
        "results/{target}/cases/{case}.json",
    log:
        "logs/{target}/cases/{case}.log",
    wildcard_constraints:
        target="|".join(BY_RULE_CASE),
    conda:
        ENVIRONMENT
    threads: CASES.threads
    resources:
        mem_mb=lambda wildcards: MEASURING[wildcards.target].memory,
        runtime=60,
    params:
        code=lambda wildcards: case_sources(wildcards.target),
        settings=lambda wildcards: CASES.settings(wildcards.target),
        options=CASES.options,
    shell:
        "stage verification case {wildcards.target} {wildcards.case} {params.options}"
        " --threads {threads} --output {output} --log {log}"


for target in MEASURING:

    rule:
        """All cases of a measuring study in one table, with its figures and what it was made from beside it."""
        name:
            f"{target}_table"
        input:
            lambda wildcards, target=target: CASES.files(target),
        output:
            table=f"results/{target}/table.csv",
            others=[f"results/{target}/{name}.csv" for name in MEASURING[target].tables],
            made=f"results/{target}/made.json",
        log:
            f"logs/{target}/table.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=2000,
            runtime=30,
        params:
            code=package_hash("verification"),
            settings=lambda wildcards, target=target: CASES.settings(target),
            target=target,
        shell:
            "stage verification table {params.target} --cases {input} --output {output.table} --log {log}"


for target in ("verification", *MEASURING):

    rule:
        """The verdict on the table of a study: it fails if a row fails that is not a known miss."""
        name:
            target
        input:
            table=f"results/{target}/table.csv",
        log:
            f"logs/{target}/verdict.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=1000,
            runtime=10,
        shell:
            VERDICT
