"""What the rules share: names, slices of the configuration. Nothing is run here.

Rules depend on the sources that their stage runs (pipeline.sources) by hash, a parameter. As input files they would be
looked at, all of them, for every waiting job, every second: a third of a core for some 300 jobs.
"""

import functools
import json
import shlex

from catalogs.records import READERS
from pipeline.provenance import config_hash, files_of, identity, read_made_from
from pipeline.sources import source_hash
from pipeline.stage import name_parent_of_stages
from verification.studies import load_study
from workflow.memory import mechanics_mb, reading_mb
from workflow.slices import SliceFiles

RESULTS = "results/{mine}"
NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"
ENSEMBLE = "ensemble"  # folder of its perturbed members, by number
CATALOGUES = ("catalog.nc", "catalog.csv", "catalog.xml", "closeness.nc")
COARSE = "coarse"  # folder of its companion on cells of twice the size
MINES = f"{re.escape(MINE.name)}|verification/{NAME}/{NAME}"  # with results of their own: this run's mine, variants
STUDY = "results/verification/{study}"
HAS_CATALOG = bool(MINE.dated_steps)
HAS_QUAKEML = HAS_CATALOG and MINE.has_place
HAS_COARSE = MINE.has_companion
HAS_RECORD = HAS_CATALOG and "record" in MINE.values
# `stage` in the rules below. exec: a stage is a child of this process, not of a shell between them, and ends with it
# (pipeline.stage).
name_parent_of_stages()
shell.prefix(
    f"set -euo pipefail; export PYTHONPATH={shlex.quote(str(BASE))}; "
    f'stage() {{{{ exec {shlex.quote(sys.executable)} -m "$@"; }}}}; '
)


wildcard_constraints:
    mine=f"({MINES})(/{ENSEMBLE}/[1-9][0-9]*|/{COARSE})?",
    study=NAME,
    step=NAME,


def kept(path):
    """A result whose earlier version outlives a stage that fails: stages write whole files or none.

    Only for what says what it was made from (inputs_of), or stands beside a file of the same stage that does: Snakemake
    would take an earlier version as current.
    """
    return update(path)


SLICES = SliceFiles(at_once=not workflow.is_main_process)  # written by onstart, which other processes do not call


@functools.cache
def study(name):
    """A study of config/verification, read when a rule first asks for it."""
    try:
        return load_study(os.path.relpath(BASE / f"config/verification/{name}.yaml"), DEFAULT)
    except InputError as error:
        sys.exit(str(error))


def mine_of(wildcards):
    """Configuration behind results/{mine}: this run's mine or a variant of a study, or a member of either."""
    return mine_at(wildcards.mine)


@functools.cache
def mine_at(folder):
    """Configuration behind results/<folder>."""
    place, part = parts_of(folder)
    mine = MINE if place == MINE.name else variant_of_study(*place.split("/")[1:])
    if part == COARSE:
        return mine.coarser()
    return mine.member(int(part.split("/")[1])) if part else mine


def place_of(wildcards):
    """Folder of the mine below results, and which part of it is meant: ensemble/<number>, coarse or, empty, itself."""
    return parts_of(wildcards.mine)


def parts_of(folder):
    """The same of results/<folder>."""
    return re.fullmatch(f"({MINES})/?({ENSEMBLE}/[0-9]+|{COARSE}|)", folder).groups()


def shared(wildcards):
    """Folder of the grid and the elastic state: a member of an ensemble has none of its own."""
    place, part = place_of(wildcards)
    return f"results/{place if part.startswith(ENSEMBLE) else wildcards.mine}"


def variant_of_study(name, variant):
    """Configuration of a study's variant."""
    mines = study(name).mines
    if variant not in mines:
        sys.exit(f"config/verification/{name}.yaml: variants: no '{variant}'; there are {', '.join(mines)}")
    return mines[variant]


def step_of(wildcards):
    """Name of the step, if the mine lists it."""
    mine = mine_of(wildcards)
    if wildcards.step not in mine.mined_steps:
        sys.exit(f"{wildcards.mine}: steps: no '{wildcards.step}'; there are {', '.join(mine.mined_steps) or 'none'}")
    return wildcards.step


def result(path):
    """A result of the mine of this run."""
    return f"results/{MINE.name}/{path}"


def stage_results(place, mine, folders=("steps", "events")):
    """Files of all stages of a mine and of its ensemble up to their events, below results/<place>."""
    runs = ["", *(f"{ENSEMBLE}/{number}/" for number in range(1, mine.members + 1))]
    steps = [f"{run}{folder}/{step}.nc" for run in runs for folder in folders for step in mine.mined_steps]
    return [f"results/{place}/{file}" for file in ["grid.nc", "elastic.nc", *steps]]


def step_results(folder):
    """One file per listed step, in order."""
    return [result(f"{folder}/{step}.nc") for step in MINE.mined_steps]


def events_of(wildcards):
    """Events of all listed steps, in order."""
    return [f"results/{wildcards.mine}/events/{step}.nc" for step in mine_of(wildcards).mined_steps]


def dated_steps_of(wildcards):
    """States of the dated steps, in order."""
    return [f"results/{wildcards.mine}/steps/{step}.nc" for step in mine_of(wildcards).dated_steps]


def all_results():
    """Every stage's file: a missing intermediate is made again, not overlooked behind a standing report."""
    files = ["report.html"]
    if MINE.dated_steps:
        files += ["catalog.nc", "catalog.csv", "closeness.nc"]
        if HAS_QUAKEML:
            files.append("catalog.xml")
        if "record" in MINE.values:
            files += ["record.nc", "comparison.nc"]
    if MINE.members:
        files.append("spread.nc")
    if HAS_COARSE:
        files.append("grid_convergence.nc")
    return stage_results(MINE.name, MINE) + [result(file) for file in files]


def planned_results():
    """All results that the mine's plan may leave: those of all_results, of the companion, and what is made on request."""
    files = [*all_results(), result("twin.csv")]
    places = [f"{MINE.name}/{ENSEMBLE}/{number}" for number in range(1, MINE.members + 1)]
    if HAS_COARSE:
        places.append(f"{MINE.name}/{COARSE}")
        files += stage_results(places[-1], MINE.coarser())
    return files + [f"results/{place}/{file}" for place in places for file in CATALOGUES]


def grid_of(wildcards):
    """The grid of a mine, which the members of an ensemble share with their mine."""
    return f"{shared(wildcards)}/grid.nc"


def previous_state(wildcards):
    """The state that a step starts from: the step before, or the elastic history."""
    before = mine_of(wildcards).previous(step_of(wildcards))
    return f"results/{wildcards.mine}/steps/{before}.nc" if before else f"{shared(wildcards)}/elastic.nc"


def solids(wildcards):
    """Files that the grid is built from."""
    return mine_of(wildcards).solids()


def bodies(wildcards):
    """Files of rock bodies, of which cells that a step splits are sampled anew."""
    mine = mine_of(wildcards)
    return mine.bodies() if mine.is_adaptive else []


@functools.cache
def sliced(folder, stage):
    """Of the slice that a stage of results/<folder> depends on: its file, its hash and the files that it names.

    stage: by its result's name without ending. A stage without settings has no file.
    """
    if workflow.execution_settings and workflow.execution_settings.no_hooks and not workflow.dryrun:
        SLICES.begin()
    values = mine_at(folder).slice_of(stage)
    file = SLICES.name(folder, stage, values) if values else ""
    return file, config_hash(values), tuple(files_of(values))


def slice_file(folder, stage):
    """The file of a stage's slice."""
    return sliced(folder, stage)[0]


def inputs_of(command, stage, result="", **files):
    """Inputs of the stage that makes results/{mine}/<result>, or <stage>.nc; files: names, or functions of wildcards.

    Where that result stands, but says that it was made from another configuration, other sources or other inputs than
    these, it is made again (pipeline.provenance). Snakemake compares times and its own notes: it drops the notes of a
    job that fails, and gives the earlier result that it puts back a new time, so that it would take it as current.
    """

    def inputs(wildcards):
        found = {name: file(wildcards) if callable(file) else named(file, wildcards) for name, file in files.items()}
        made = named(stage, wildcards)
        output = f"results/{wildcards.mine}/{result or f'{made}.nc'}"
        paths = [path for one in found.values() for path in ([one] if isinstance(one, str) else one)]
        if all(map(os.path.exists, [output, *paths])):
            results = [path for path in paths if path.endswith(".nc")]
            if read_made_from(output) != identity(*sliced(wildcards.mine, made)[1:], command, results):
                workflow.dag.forcefiles.add(output)
        return found

    return unpack(inputs)


def named(files, wildcards):
    """A file's name, or a list of such, with the wildcards filled in."""
    return files.format(**wildcards) if isinstance(files, str) else files


def slice_of(stage):
    """Parameter of a rule: the slice that its stage depends on."""
    return lambda wildcards: slice_file(getattr(wildcards, "mine", MINE.name), stage)


def step_slice(wildcards):
    """The configuration up to this step."""
    return slice_file(wildcards.mine, f"steps/{step_of(wildcards)}")


def event_slice(wildcards):
    """The configuration that the events of a step depend on, its dates included."""
    return slice_file(wildcards.mine, f"events/{step_of(wildcards)}")


def runs_of(wildcards):
    """Folders of the runs of an ensemble: the mine's own, then the members."""
    members = range(1, mine_of(wildcards).members + 1)
    return [f"results/{wildcards.mine}", *(f"results/{wildcards.mine}/{ENSEMBLE}/{number}" for number in members)]


def dated_results(wildcards):
    """What the spread of an ensemble is read from: steps and events of all dated steps of all runs."""
    steps = mine_of(wildcards).dated_steps
    return [f"{run}/{folder}/{step}.nc" for run in runs_of(wildcards) for folder in ("steps", "events") for step in steps]


def packed(path, result):
    """A result that `snakemake --report` packs, in its mine's category: labels tell files of one name apart."""

    def labels(wildcards):
        coarse = ", cells of twice the size" if place_of(wildcards)[1] == COARSE else ""
        return {"result": result + coarse}

    caption = f"../report/{result}.rst"
    return report(kept(path), caption=caption, category=lambda wildcards: place_of(wildcards)[0], labels=labels)


def member_events(wildcards):
    """Events of all dated steps of the members of an ensemble; empty without one."""
    return [f"{run}/events/{step}.nc" for run in runs_of(wildcards)[1:] for step in mine_of(wildcards).dated_steps]


def members_option(wildcards, input):
    """The command line option for the folders of these members; empty without any."""
    return " ".join(["--members", *runs_of(wildcards)[1:]]) if input.members else ""


def comparison_of(wildcards):
    """The comparison with the record, if there is one."""
    return result("comparison.nc") if HAS_RECORD and wildcards.mine == MINE.name else []


def comparison_option(wildcards, input):
    """The command line option for it."""
    return f"--comparison {input.comparison}" if input.comparison else ""


def threads_of(wildcards):
    """As many as there are, but one where a study's scenes are so small that two run better side by side."""
    place, _ = place_of(wildcards)
    return 64 if place == MINE.name else study(place.split("/")[1]).threads


def elastic_memory(wildcards, input):
    """MB that the elastic stage needs on the grid."""
    return mechanics_mb(mine_of(wildcards), input.grid, elastic=True)


def step_memory(wildcards, input):
    """MB that a mining step needs on the cells of the step before, and on those that it may add to them."""
    return mechanics_mb(mine_of(wildcards), input.state, elastic=False)


def reading_memory(stage):
    """MB that a stage needs which reads results, for those on the mine's grid."""
    return lambda wildcards, input: reading_mb(mine_of(wildcards), grid_of(wildcards), stage, input)


def record_files():
    """Recorded data that the record is read from; a folder's reader looks after its own files."""
    if not HAS_RECORD or READERS[MINE.values["record"]["reader"]].READS_FOLDER:
        return []
    return MINE.record_slice()["file"]


def if_made(option, path, made):
    """A command line option for a result that this scene may not have."""
    return f"--{option} {result(path)}" if made else ""


def answer_sources(wildcards):
    """Hash of what a study's answer runs: the stage, and the module that it is told by name."""
    return source_hash("verification answer", f"verification.{study(wildcards.study).answer}.answer")


def studies():
    """Names of all studies that the target `verification` runs."""
    names = sorted(path.stem for path in (BASE / "config/verification").glob("*.yaml"))
    return [name for name in names if not study(name).on_request]


def tradeoff_studies():
    """Names of the studies of speed against accuracy, by the start of their names: the others need not be read."""
    return sorted(path.stem for path in (BASE / "config/verification").glob("tradeoff_*.yaml"))


def spread_studies():
    """Names of the studies of a catalogue's spread, likewise; the smallest scene first."""
    return sorted((path.stem for path in (BASE / "config/verification").glob("spread_*.yaml")), reverse=True)


def spread_results(wildcards):
    """Results of all stages of all of these, members of their ensembles included."""
    return [file for name in spread_studies() for file in results_of_study(name)]


def study_files(wildcards):
    """The files of these studies."""
    return [f"{BASE}/config/verification/{name}.yaml" for name in studies()]


def study_results(wildcards):
    """Results of all stages of all variants of a study."""
    return results_of_study(wildcards.study)


def results_of_study(name):
    """The same, of a study by its name."""
    place, chosen = f"verification/{name}", study(name)
    folders = ("steps", "events") if chosen.events else ("steps",)
    return [file for key, mine in chosen.mines.items() for file in stage_results(f"{place}/{key}", mine, folders)]


def answers(wildcards):
    """Rows and figures of all studies."""
    return [f"results/verification/{name}/{file}" for name in studies() for file in ("rows.csv", "figure.svg")]
