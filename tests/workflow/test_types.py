"""Types: the packages that are listed in pyproject.toml have no error."""

import subprocess
import sys

import pytest
from tiny_mines import ROOT


@pytest.mark.slow
def test_listed_packages_have_no_type_error():
    """mypy reads the list and what is loosened where from pyproject.toml."""
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stdout + done.stderr
