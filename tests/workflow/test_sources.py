"""A rule depends on what its stage runs: no less, as the stages show that run, and no more, as Snakemake is asked."""

import ast
import json
import re
import shutil
from pathlib import Path

import pytest
from stand_ins import noting
from tiny_mines import ROOT, TINY, changed, copy_checkout, edited, jobs, snakemake, write_mine

from common.sources import _import_statements, _imports, source_files, source_hash

SHARED = "common"
APART = ("mpm_core", "seismic", "catalogs")  # they meet through files
PACKAGES = (SHARED, *APART, "calibration", "baselines", "plans", "verification", "workflow")
# Snakemake alone reads these, but for two: the schema, which is made from the models (workflow/generate.py), is for
# editors, and no result depends on the list of the kernels that are compiled first.
NO_DATA = (
    *("workflow/report/", "workflow/envs/", "workflow/rules/", "verification/rules/", "verification/Snakefile"),
    *("workflow/schemas/", "mpm_core/stages/first_kernels.txt"),
)
BY_NAME = {  # modules that import others by a name made at run time, and who sees to it
    "verification/__main__.py",  # an answer: its rule names the module beside the stage
    "verification/pages.py",  # a command of its own that writes pages of docs; no rule runs it
    "mpm_core/stages/first_kernels.py",  # the modules of kernels that the stage itself calls
    "workflow/stage_server.py",  # what stages import themselves, in a copy of it
    "workflow/plan.py",  # excavations_from: what it makes is part of the slices of settings
}


def names(files) -> set[str]:
    """Paths below the checkout."""
    return {path.relative_to(ROOT).as_posix() for path in map(Path, files) if path.is_relative_to(ROOT)}


def modules(package: str) -> dict[str, Path]:
    """Every module of a package by its dotted name."""
    paths = sorted((ROOT / package).rglob("*.py"))
    return {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in paths}


def test_packages_meet_through_files():
    """mpm_core, seismic and catalogs import nothing of each other, and what they share nothing of any."""
    for package in (SHARED, *APART):
        for module, path in modules(package).items():
            found = {name.split("/")[0] for name in names(source_files(module))}
            assert found <= {package, SHARED}, path


def test_no_module_is_imported_where_the_sources_do_not_show_it():
    """By a name made at run time: it is said above why those that do are no gap."""
    calls = {"import_module", "__import__", "run_module", "run_path", "exec", "eval", "spec_from_file_location"}
    found = set()
    for path in (path for package in PACKAGES for path in modules(package).values()):
        called = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
        if calls & {getattr(function, "id", getattr(function, "attr", "")) for function in called}:
            found |= names([path])
    assert found == BY_NAME


def test_import_statements_are_found_without_the_rest_of_a_module():
    """A slow twin: the whole module, parsed. A docstring with lines that begin like imports is parsed as a whole."""
    for path in (path for package in PACKAGES for path in modules(package).values()):
        source = path.read_text()
        assert set(_imports(_import_statements(source), path)) == set(_imports(ast.parse(source), path)), path
    text = '"""Words.\n\nfrom here on\nimport of ore\n"""\nfrom common import (\n    disk,  # full\n    errors,\n)'
    found = set(_imports(_import_statements(text), ROOT / "module.py"))
    assert found == {"common.disk", "common.errors"}


def test_every_file_that_is_no_module_belongs_to_one():
    """A template that no module beside it says the name of would be missed in silence."""
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.is_file())
    data = {name for name in names(files) if not name.endswith((".py", ".pyc")) and not name.startswith(NO_DATA)}
    assert "catalogs/report/templates/report.html.j2" in data
    claimed = {name for package in PACKAGES for module in modules(package) for name in names(source_files(module))}
    assert data - claimed == set()


def test_a_rule_depends_on_the_stage_that_it_runs():
    """`code` and the shell command of every rule that makes a file name the same stage."""
    text = "\n".join(path.read_text() for path in sorted(ROOT.glob("*/rules/*.smk")))
    rules = dict(re.findall(r"^rule (\w+):\n(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL))
    making = {name: rule for name, rule in rules.items() if "    output:" in rule}
    assert len(making) > 15
    for name, rule in making.items():
        stage = re.search(r"stage ([\w.]+(?: [a-z]\w*)?)", rule.partition("    shell:")[2])[1]
        code = re.search(r"code=(?:source_hash\(\s*\"([^\"]*)\"|STUDIES.answer_sources)", rule)[1]
        assert (code or "verification answer") == stage, name
        assert re.fullmatch("[0-9a-f]{16}", source_hash(stage))


def test_what_is_not_there_has_no_sources():
    """A misspelt stage or module stops the workflow instead of depending on nothing."""
    for absent in ("catalogs reportt", "catalog report", "verification/benchmarks/peer/", "config/defaults.yaml"):
        with pytest.raises(ValueError, match="sources"):
            source_hash(absent)


def test_a_stage_alone_counts_of_its_command_line():
    """What one stage imports within its function is no source of another, helpers that it calls are."""
    assert "catalogs/report/templates/report.html.j2" in names(source_files("catalogs report"))
    assert "catalogs/records/csv_reader.py" in names(source_files("catalogs record"))
    for stage in ("record", "quakeml", "compare", "spread", "twin", "vtk"):
        found = names(source_files(f"catalogs {stage}"))
        assert {"catalogs/__main__.py", "catalogs/__init__.py", "common/stage.py"} <= found
        assert not found & {"catalogs/report/page.py", "catalogs/report/templates/report.html.j2", "common/pages.py"}
    assert names(source_files("mpm_core grid")).isdisjoint(
        {"mpm_core/multigrid/cycle.py", "mpm_core/stages/equilibrium_stages.py"}
    )
    assert "mpm_core/multigrid/cycle.py" in names(source_files("mpm_core step"))  # through its helper _solve
    assert names(source_files("verification/benchmarks/peers/")) >= {"verification/benchmarks/peers/ogs.txt"}


@pytest.mark.slow
def test_stages_use_no_file_that_their_sources_lack(undisturbed, spoiled, base, notes, tmp_path):
    """Every stage of a mine, as it runs: what it has imported at its end, and what else it has opened."""
    shutil.copytree(notes, tmp_path / "notes")
    on_request = ("spread.nc", "scene.png", "twin.csv", "vtk/elastic.vtu", "vtk/solids.vtm", "vtk/catalog.vtu")
    with edited(base / "files/tiny.yaml", changed(TINY, ensemble=1)) as file:
        targets = (f"results/tiny/{name}" for name in on_request)
        status, text = snakemake(file, spoiled, *targets, interpreter=noting(tmp_path / "notes"))
    assert status == 0, text
    ran = set()
    for path in (tmp_path / "notes").glob("*.json"):
        noted = json.loads(path.read_text())
        stage = " ".join(noted["command"])
        used = {name for name in names(noted["files"]) if name.startswith(tuple(f"{one}/" for one in PACKAGES))}
        assert {name for name in used - names(source_files(stage)) if not name.startswith(NO_DATA)} == set(), stage
        assert any(name.endswith("/datasets.py") for name in used), stage
        ran.add(stage)
    assert ran == {
        *(f"mpm_core {stage}" for stage in ("grid", "elastic", "step", "vtk", "solids")),
        *("seismic events", "seismic catalog", "seismic closeness"),
        *(
            f"catalogs {stage}"
            for stage in ("scene", "record", "quakeml", "compare", "spread", "twin", "vtk", "report")
        ),
    }


@pytest.fixture(scope="module")
def standing(tmp_path_factory, leave_empty_in_copies):
    """A copy of the checkout in which a mine stands as finished, with empty results; asks what an edit would run."""
    base = tmp_path_factory.mktemp("sources")
    checkout, mine = copy_checkout(base / "checkout"), write_mine(TINY, base / "files" / "tiny.yaml")

    def run(*options: str) -> dict[str, int]:
        status, text = snakemake(mine, base / "run", *options, interpreter=leave_empty_in_copies, checkout=checkout)
        assert status == 0, text
        return {rule: count for rule, count in jobs(text).items() if rule != "all"}

    def edit(files: str) -> dict[str, int]:
        before = {checkout / name: (checkout / name).read_text() for name in files.split()}
        for path, text in before.items():
            path.write_text(f"{text}\n")
        try:
            return run("--dry-run")
        finally:
            for path, text in before.items():
                path.write_text(text)

    run()
    return edit


REPORT = {"report": 1}
COMPARE = REPORT | {"compare": 1}
CATALOG = COMPARE | {"catalog": 1, "quakeml": 1}
EVENTS = CATALOG | {"events": 2, "closeness": 1}
MECHANICS = EVENTS | {"elastic": 1, "mining_step": 2}
EDITS = {
    "workflow/terminal.py verification/report.py verification/extremes/mines.py": {},
    "catalogs/events_vtk.py mpm_core/files/state_vtk.py": {},
    "catalogs/report/templates/report.html.j2": REPORT,
    "common/pages.py catalogs/figures/style.py": REPORT,
    "catalogs/records/csv_reader.py": {"record": 1} | COMPARE,
    "seismic/catalog.py": CATALOG,
    "seismic/families.py": EVENTS,
    "common/event_table.py": EVENTS | {"record": 1},
    "mpm_core/kernels/operator_3.py": MECHANICS,
    "mpm_core/grid/octree.py": MECHANICS | {"grid": 1},
}


@pytest.mark.parametrize("files", EDITS)
def test_an_edit_runs_the_stages_that_use_the_files(standing, files):
    """And what follows from their results, and nothing else."""
    assert standing(files) == EDITS[files]
