"""Which module imports which: no circle, and nothing that runs imports the tests."""

import ast
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter

import pytest
from tiny_mines import ROOT

from verification.targets import BY_RULE_CASE, MEASURING, MODEL, SHARED
from workflow.stages import IMPORTS, stages

PACKAGES = (
    "common",
    "mpm_core",
    "seismic",
    "catalogs",
    "calibration",
    "baselines",
    "plans",
    "response",
    "export",
    "shaking",
    "workflow",
    "verification",
)
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
}


def imports(source: str, modules=MODULES) -> set[str]:
    """Modules of ours that a source imports anywhere, for its types alone too; "tests" for any of theirs."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [[alias.name] for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [[f"{node.module}.{alias.name}", node.module] for alias in node.names]
        for either in names:
            found |= {next((name for name in either if name in modules), "")}
            found |= {"tests"} if either[-1].split(".")[0] == "tests" else set()
    return found - {""}


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle, if any do."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_a_circle_is_found():
    graph = {"a": imports("def f():\n    from b import x", {"a", "b"}), "b": imports("import a", {"a", "b"})}
    assert sorted(set(circle(graph))) == ["a", "b"]


def test_no_modules_import_each_other():
    assert circle({name: imports(path.read_text()) - {name} for name, path in MODULES.items()}) == []


def test_no_groups_of_the_mechanics_import_each_other():
    """Each imports only groups above it in this list. Three are modules, the others are folders."""
    order = [
        "simd",
        "geometry",
        "insitu_settings",
        "block_settings",
        "settings",
        "grid",
        "constitutive",
        "kernels",
        "scene",
        "model",
    ]
    order += ["multigrid", "files", "equilibrium", "stages"]
    inside = {name: name.split(".")[1] for name in MODULES if name.startswith("mpm_core.")}
    assert set(inside.values()) == set(order)
    upward = [
        f"{name} imports {found}"
        for name, group in inside.items()
        for found in imports(MODULES[name].read_text()) & set(inside)
        if order.index(inside[found]) > order.index(group)
    ]
    assert upward == []


def test_nothing_that_runs_imports_the_tests():
    """Nor does a rule run them as a stage."""
    assert not [name for name, path in MODULES.items() if "tests" in imports(path.read_text())]
    rules = [ROOT / "Snakefile", ROOT / "verification/Snakefile", *sorted(ROOT.glob("*/rules/*.smk"))]
    assert len(rules) > 7
    assert not [path for path in rules if re.search(r"\b(from|import|stage) tests\b", path.read_text())]


def packages_of(modules: set[str]) -> set[str]:
    """Packages that modules are of."""
    return {name.split(".")[0] for name in modules}


@pytest.mark.parametrize("package", IMPORTS)
def test_what_a_package_imports_is_in_the_hash_of_its_sources(package):
    """`IMPORTS` names the packages; else their results would stay when it changes."""
    found = {name: imports(path.read_text()) for name, path in MODULES.items() if name.split(".")[0] == package}
    assert packages_of(set().union(*found.values())) <= {package, *IMPORTS[package]}


def test_what_a_stage_imports_is_in_the_hash_of_its_sources():
    """Its packages, those that these import, its own module, and the modules that it names."""
    bodies = {}
    for name, path in MODULES.items():
        if name.startswith("workflow.stages."):
            tree = ast.parse(path.read_text())
            bodies |= {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for name, one in stages().items():
        found, left, seen = set(), [name], set()
        while left:  # functions of the module that the stage calls
            function = bodies[left.pop()]
            if function.name not in seen:
                seen.add(function.name)
                found |= imports(ast.unparse(function))
                calls = [node.func for node in ast.walk(function) if isinstance(node, ast.Call)]
                left += [one.id for one in calls if isinstance(one, ast.Name) and one.id in bodies]
        hashed = {*one.packages, *(known for package in one.packages for known in IMPORTS[package]), "common"}
        named = {module for module in one.modules if not module.startswith("workflow.")}
        found |= {other for module in named for other in imports(MODULES[module].read_text())}
        of_workflow = {module for module in found if module.startswith("workflow.")}
        assert packages_of(found - of_workflow - named) <= hashed, name
        assert of_workflow <= {"workflow.stages", one.run.__module__, *one.modules}, name


def measured_modules(module: str) -> set[str]:
    """Modules that a measuring study imports, and those that these do, without those that make pages and figures."""
    of_pages = {f"verification.{name}" for name in ("frame", "made", "page_tables", "pages", "plots")}
    found, left = set(), [module]
    while left:
        one = left.pop()
        if one not in found | of_pages and not one.endswith(".figure"):
            found.add(one)
            left += imports(MODULES[one].read_text()) if one.startswith("verification.") else []
    return found


@pytest.mark.parametrize("target", [*BY_RULE_CASE, "calibration_truth"])
def test_what_a_case_imports_is_in_the_hash_of_its_sources(target):
    parts = [ROOT / "verification" / part for part in (target, *MEASURING[target].uses, *SHARED)]
    found = {
        name
        for name in measured_modules(f"verification.{target}.study")
        if not any(MODULES[name].is_relative_to(part) for part in parts)
    }
    in_job = {"calibration"} if target == "calibration_truth" else set()  # of the calibration that the case repeats
    assert packages_of(found) <= {*MODEL, *in_job}


def test_what_an_answer_imports_is_in_the_hash_of_its_sources():
    """Statistics, coverage and clustering read no results that would change with the code."""
    answers = [path for name, path in MODULES.items() if name.startswith("verification.answers.")]
    assert packages_of(set().union(*(imports(path.read_text()) for path in answers))) <= {
        *MODEL,
        "baselines",
        "plans",
        "verification",
    }


SLOW = {"matplotlib", "numba", "obspy", "pint", "psutil", "pyproj", "scipy.ndimage", "scipy.optimize", "scipy.special"}
SLOW |= {"scipy.spatial", "scipy.stats", "sklearn", "tqdm"}


@pytest.mark.parametrize(
    ("modules", "needs"),
    [
        ("workflow.stages", set()),
        ("seismic.catalog", set()),
        ("catalogs.records, catalogs.compare.grid_convergence", set()),
        ("seismic.events", {"numba", "scipy.spatial", "scipy.special"}),
        ("catalogs.compare.comparison", {"scipy.spatial", "scipy.special"}),
        ("mpm_core.stages.grid_stage", {"numba", "psutil"}),
    ],
)
def test_a_stage_waits_for_no_library_that_it_does_not_need(modules, needs):
    """What is imported before its function begins, of the libraries that take long to import."""
    program = f"import sys, {modules}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(run.stdout.split()) & SLOW == needs
