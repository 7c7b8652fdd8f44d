"""Other entries of rules: options of command lines, flags of outputs, memory."""

from collections.abc import Callable

from snakemake.io import report
from snakemake.iocontainers import InputFiles, Wildcards
from snakemake.ioflags import update
from snakemake.workflow import Workflow

from workflow.folders import COARSE, ELASTIC_ROCK, Folders
from workflow.result_files import ResultFiles
from workflow.rule_memory import mechanics_mb, reading_mb

MAX_JOBS_IN_IDLE_TIME = 2  # So many jobs run beside those that have all cores.


def kept(path: str):
    """A result whose earlier version outlives a stage that fails: stages write whole files or none.

    Only for what says what it was made from (StageInputs.inputs_of), or stands next to a file of the same stage that
    does: Snakemake would use an earlier version as current.
    """
    return update(path)


def each_time(megabytes: int) -> Callable[[Wildcards, int], int]:
    """MB of a rule that asks for a round number, more each time that its job is started (RuleOptions)."""
    return lambda wildcards, attempt: attempt * megabytes


class RuleOptions:
    """Options and resources of the rules of any mine.

    A job in idle time takes no core from others: it runs beside steps on all cores and gets what they leave
    (common.stage). Snakemake starts no job while all its cores are taken. So a step on all cores takes one less of it,
    and resource held_cores keeps two such steps apart. workflow says whether jobs run here, on more than one core.

    attempt: how often Snakemake has started the job. It starts it again with `retries` only, and asks for more memory
    each time, since that may have been what was missing.
    """

    def __init__(self, files: ResultFiles, workflow: Workflow):
        self.files = files
        self.workflow = workflow
        self.folders: Folders = files.folders

    def packed(self, path: str, result: str):
        """A result that `snakemake --report` packs, in its mine's category: labels tell files of one name apart.

        Its caption is workflow/report/<result>.rst, seen from the rule.
        """

        def labels(wildcards: Wildcards) -> dict[str, str]:
            coarse = ", cells of twice the size" if self.folders.parts(wildcards.mine)[1] == COARSE else ""
            return {"result": result + coarse}

        def category(wildcards: Wildcards) -> str:
            return self.folders.parts(wildcards.mine)[0]

        return report(kept(path), caption=f"../report/{result}.rst", category=category, labels=labels)

    def if_made(self, option: str, path: str, made: bool) -> str:
        """A command line option for a result that this scene may not have."""
        return f"--{option} {self.files.own(path)}" if made else ""

    def members(self, wildcards: Wildcards, input: InputFiles) -> str:
        """The command line option for the folders of an ensemble's members; empty without any."""
        return " ".join(["--members", *self.files.runs(wildcards)[1:]]) if input.members else ""

    def comparison(self, wildcards: Wildcards, input: InputFiles) -> str:
        """The command line option for the comparison with the record; empty without one."""
        return f"--comparison {input.comparison}" if input.comparison else ""

    @property
    def runs_here(self) -> bool:
        """Whether jobs run on this machine, started by this process."""
        return self.workflow.local_exec and not self.workflow.remote_exec

    @property
    def has_idle_time(self) -> bool:
        """Whether there is a core besides that of a job that waits for its own threads."""
        return self.runs_here and self.workflow.cores > 1

    def limit_jobs(self) -> None:
        """Limit the cores of all stages of the mechanics that run here at once, and the number of jobs in idle time.

        As the rules are read Snakemake does not say yet where jobs will run: those of a cluster hold no cores here.
        """
        self.workflow.register_resource("in_idle_time", MAX_JOBS_IN_IDLE_TIME)
        if self.workflow.resource_settings.cores:  # else on a cluster
            self.workflow.register_resource("held_cores", self.workflow.resource_settings.cores)

    def threads(self, wildcards: Wildcards) -> int:
        """Snakemake's cores for a stage of the mechanics: none for the companion, which runs in idle time."""
        cores = self.folders.threads(wildcards.mine)
        if not self.has_idle_time:
            return cores
        is_companion = self.folders.parts(wildcards.mine)[1] == COARSE
        return 0 if is_companion else min(cores, self.workflow.cores - 1)

    def stage_cores(self, wildcards: Wildcards, threads: int) -> int:
        """Cores that a stage of the mechanics has threads for; threads: what Snakemake has made of `threads`."""
        if not self.has_idle_time or threads < self.workflow.cores - 1:
            return threads
        most = self.workflow.resource_settings.max_threads or self.workflow.cores  # the user's
        return min(self.folders.threads(wildcards.mine), threads + 1, most)

    def held_cores(self, wildcards: Wildcards, threads: int) -> int:
        """Cores of this machine that a stage of the mechanics holds, of those that limit_jobs counts."""
        return self.stage_cores(wildcards, threads) if self.has_idle_time else 0

    def reading_threads(self, wildcards: Wildcards) -> int:
        """Snakemake's cores for a stage that reads results while stages run that take longer and do not need it."""
        return 0 if self.has_idle_time else 1

    def first_threads(self, wildcards: Wildcards) -> int:
        """Snakemake's cores for a small stage that stages of the mechanics wait for: it starts none beside it."""
        return self.workflow.cores if self.has_idle_time else 1

    def in_idle_time(self, wildcards: Wildcards, threads: int) -> int:
        """Jobs in idle time that this one counts as."""
        return int(threads == 0)

    def elastic_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that the elastic stage needs on the grid."""
        return attempt * mechanics_mb(self.files.mine_of(wildcards), input.grid, elastic=True)

    def step_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a mining step needs on the cells of the step before, and on those that it may add to them."""
        return attempt * mechanics_mb(self.files.mine_of(wildcards), input.state, elastic=False)

    def trial_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a trial of a calibration needs, if its cells are those of the mine."""
        return attempt * mechanics_mb(self.files.mine, input.grid, elastic=False)

    def baseline_memory(self, wildcards: Wildcards, input: InputFiles, attempt: int) -> int:
        """MB that a stage needs which reads all states of the mine in elastic rock."""
        grid = self.files.own(f"{ELASTIC_ROCK}/grid.nc")
        return attempt * reading_mb(self.files.mine, grid, "baselines", input.states)

    def reading_memory(self, stage: str) -> Callable[[Wildcards, InputFiles, int], int]:
        """MB that a stage needs which reads results, for those on the mine's grid."""
        return lambda wildcards, input, attempt: (
            attempt * reading_mb(self.files.mine_of(wildcards), self.files.grid(wildcards), stage, input)
        )
