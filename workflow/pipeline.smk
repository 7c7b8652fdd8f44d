"""The rules of the pipeline: what is made of what. Each stage is declared in workflow/stages."""

from snakemake.utils import min_version

min_version("9.0")


include: "rules/common.smk"
include: "rules/mechanics.smk"
include: "rules/catalogue.smk"
include: "rules/response.smk"
include: "rules/comparison.smk"
include: "rules/requests.smk"
include: "rules/calibration.smk"
include: "rules/baselines.smk"
include: "rules/plans.smk"
include: "rules/export.smk"
include: "../verification/Snakefile"


wildcard_constraints:
    mine=FOLDERS.pattern,
    step=NAME,


onstart:
    try:
        note_owner(MINE.name, MINE_FILE, "name" in OVERRIDES)
    except InputError as error:
        sys.exit(str(error))
    order = [rule.name for rule in workflow.rules]
    repeated = [
        RepeatedJob(job.rule.name, Path(job.input.job), Path(job.output[0]), Path(job.log[0]), job.threads)
        for job in sorted(workflow.dag.needrun_jobs(), key=lambda job: order.index(job.rule.name))
        if "job" in job.input.keys() and job.output and job.log
    ]
    if said := notice(repeated, workflow.resource_settings.cores or 1):
        print(said, file=sys.stderr)
    if FILES.has_catalog and not FILES.has_quakeml:
        print(
            f"{MINE.name}: frame has no place on Earth: no catalog.xml, catalog.csv in mine coordinates",
            file=sys.stderr,
        )
