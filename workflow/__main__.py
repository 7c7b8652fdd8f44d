"""Runs a job of the pipeline: python -m workflow results/<mine>/jobs/<stage>/<hash>.json --output <paths>"""

from dataclasses import replace
from pathlib import Path

from common.command_line import CommandLine
from common.job import read_job, remove_earlier, stage_of
from common.stage import run_stage
from workflow.stages import stages


def main() -> None:
    """Parse the command line and run the job."""
    parser = CommandLine(prog="python -m workflow", description=__doc__)
    parser.add_argument("job", type=Path, help="file of the job, JSON")
    parser.add_argument(
        "--output", type=Path, nargs="+", required=True, help="paths written, as the stage's rule names them"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--log", type=Path, help="log file; standard error without it")
    chosen = parser.parse_args()
    name = stage_of(chosen.job, stages())
    if not name:
        parser.error(f"{chosen.job}: no job of a stage; there are {', '.join(stages())}")
    stage = stages()[name]

    def run() -> None:
        job = replace(read_job(chosen.job), outputs=tuple(chosen.output), threads=chosen.threads)
        job = replace(job, logs=chosen.log.parent if chosen.log else None)
        remove_earlier(chosen.job)
        stage.run(job)
        # A dry run meanwhile may have written others, which would be older than the results of this one.
        remove_earlier(chosen.job)

    run_stage(f"{name} {chosen.output[0]}", chosen.log, run, stage.about)


if __name__ == "__main__":
    main()
