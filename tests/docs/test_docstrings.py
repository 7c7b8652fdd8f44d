"""The examples of the packages' docstrings give what they say."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PACKAGES = ("baselines", "catalogs", "common", "export", "mpm_core", "plans", "seismic", "workflow")
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text()
]


def test_every_package_that_users_import_has_examples():
    assert {name.partition(".")[0] for name in MODULES} >= {"catalogs", "common", "mpm_core", "seismic"}


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_docstrings_hold(name):
    module = importlib.import_module(name)
    found = doctest.testmod(module)
    assert found.attempted > 0, "the examples are not seen: a decorator hides their docstring"
    assert found.failed == 0
