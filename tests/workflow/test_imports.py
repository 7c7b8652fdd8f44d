"""Which module imports which: no circle, and nothing that runs imports the tests."""

import ast
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter

import pytest
from tiny_mines import ROOT

PACKAGES = (
    "common",
    "mpm_core",
    "seismic",
    "catalogs",
    "calibration",
    "baselines",
    "plans",
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
    """Each imports only groups above it in this list; `settings` is a module, the others are folders."""
    order = ["simd", "geometry", "settings", "grid", "constitutive", "kernels", "scene", "model", "multigrid", "files"]
    order += ["equilibrium", "stages"]
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
