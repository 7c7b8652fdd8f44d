"""The script that installs: it asks for what is missing in one line, and does nothing where all is there."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def checkout(tmp_path):
    """A folder with the script and a lock file."""
    shutil.copy(ROOT / "install", tmp_path)
    (tmp_path / "requirements.lock").write_text("numpy==2.0.0\n")
    return tmp_path


def install(checkout: Path, python: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [checkout / "install"],
        env={"PATH": "/usr/bin:/bin", "PYTHON": python},
        capture_output=True,
        text=True,
        check=False,
    )


def test_nothing_is_done_where_the_packages_of_this_lock_file_are_installed(checkout):
    (checkout / ".venv").mkdir()
    shutil.copy(checkout / "requirements.lock", checkout / ".venv/installed.lock")
    assert install(checkout, "no_such_python").returncode == 0
    (checkout / "requirements.lock").write_text("numpy==2.0.1\n")
    assert install(checkout, "no_such_python").returncode == 1


@pytest.mark.parametrize("python", ["no_such_python", "false"])
def test_a_missing_or_old_python_is_one_line(checkout, python):
    done = install(checkout, python)
    assert done.returncode == 1
    assert f"{python} is missing or older than Python 3.11" in done.stderr.splitlines()[-1]
    assert not (checkout / ".venv").exists()


def test_a_failed_installation_is_none(checkout):
    """An interpreter that makes no environment leaves no note that all is there."""
    (checkout / "python").write_text('#!/bin/sh\ncase "$1" in -c) exit 0;; esac\nexit 1\n')
    (checkout / "python").chmod(0o755)
    assert install(checkout, str(checkout / "python")).returncode == 1
    assert not (checkout / ".venv/installed.lock").exists()
