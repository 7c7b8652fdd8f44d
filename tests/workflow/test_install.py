"""The script that installs, and the lock file on the systems that the documentation names.

Which wheels exist cannot be told without a network: the registry is asked where WHEELS_ONLINE is set. Tested here is
that on each system the lock file pins each package that another one needs, once, in a version that fits.
"""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

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
    """By the Python that is asked for, and where they run: a folder that was moved has programs of its old place."""
    programs = checkout / ".venv/bin"
    programs.mkdir(parents=True)
    shutil.copy(checkout / "requirements.lock", checkout / ".venv/installed.lock")
    for name, text in (("snakemake", "exit 0"), ("python", "echo Python 3.13.1"), ("other", "echo Python 3.12.0")):
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    assert install(checkout, "").returncode == 0
    assert install(checkout, str(programs / "python")).returncode == 0
    (checkout / "fails").write_text('#!/bin/sh\ncase "$1" in -c) exit 1;; esac\necho Python 3.12.0\n')
    (checkout / "fails").chmod(0o755)
    assert install(checkout, str(checkout / "fails")).returncode == 1
    (programs / "snakemake").write_text("#!/no/such/python\n")
    assert install(checkout, str(checkout / "fails")).returncode == 1
    (programs / "snakemake").write_text("#!/bin/sh\n")
    (checkout / "requirements.lock").write_text("numpy==2.0.1\n")
    assert install(checkout, "no_such_python").returncode == 1


def test_packages_are_installed_beside_the_script_whatever_environment_is_active(checkout):
    """uv takes VIRTUAL_ENV or that of conda, which then had them, and each later call said that all was there."""
    assert ".venv/bin/uv pip install -q --python .venv/bin/python " in (checkout / "install").read_text()


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


# ---- systems ----

LINUX, MAC = (
    {"sys_platform": "linux", "platform_system": "Linux", "platform_machine": "x86_64", "os_name": "posix"},
    {"sys_platform": "darwin", "platform_system": "Darwin", "platform_machine": "arm64", "os_name": "posix"},
)
SYSTEMS = [(name, system, python) for name, system in (("linux", LINUX), ("mac", MAC)) for python in (11, 12, 13)]
PLATFORMS = {"linux": "x86_64-manylinux_2_28", "mac": "aarch64-apple-darwin"}  # names of uv
PLAIN_PYTHON = (
    "connection-pool",
    "mplstereonet",
    "omf",
    "properties",
    "vectormath",
)  # without wheels, without compilers


def environment(system: dict, python: int) -> dict:
    return system | {
        "python_version": f"3.{python}", "python_full_version": f"3.{python}.0", "implementation_name": "cpython",
        "platform_python_implementation": "CPython", "extra": "",
    }  # fmt: skip


def pinned(system: dict, python: int) -> dict[str, str]:
    """Versions of the lock file by package. Fails where one is pinned twice."""
    found: dict[str, str] = {}
    for line in re.findall(r"^[A-Za-z0-9].*?==.*?(?= \\$)", (ROOT / "requirements.lock").read_text(), re.MULTILINE):
        one = Requirement(line)
        if one.marker is None or one.marker.evaluate(environment(system, python)):
            name = canonicalize_name(one.name)
            assert name not in found, f"{name} twice"
            found[name] = next(iter(one.specifier)).version
    return found


def needs(requirements: list[str], extras: set[str], system: dict, python: int) -> list[Requirement]:
    """Those of some requirements that hold on a system, with one of the extras or none."""
    here = environment(system, python)
    return [
        one for one in map(Requirement, requirements)
        if one.marker is None or any(one.marker.evaluate(here | {"extra": extra}) for extra in ("", *extras))
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "system", "python"), SYSTEMS)
def test_the_lock_file_resolves_on_each_documented_system(name, system, python):
    """From the project down, by what the installed packages say that they need and on which Python they run."""
    locked = pinned(system, python)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *(one for some in project["optional-dependencies"].values() for one in some)]
    waiting, seen = needs(wanted, set(), system, python), set[tuple[str, str]]()
    while waiting:
        one = waiting.pop()
        package = canonicalize_name(one.name)
        assert package in locked, f"{package} is needed and not pinned"
        assert one.specifier.contains(locked[package], prereleases=True), f"{one}: {locked[package]} is pinned"
        for extra in {"", *one.extras} - {extra for known, extra in seen if known == package}:
            seen.add((package, extra))
            try:
                installed = importlib.metadata.distribution(package)
            except importlib.metadata.PackageNotFoundError:
                continue  # of another system
            if installed.version != locked[package]:
                continue  # of another Python: what this one needs is not known here
            runs_on = SpecifierSet(installed.metadata.get("Requires-Python") or "")
            assert runs_on.contains(f"3.{python}.5"), f"{package}: {runs_on}"
            waiting += needs(installed.requires or [], {extra} if extra else set(), system, python)


def test_readme_page_and_script_name_the_same_systems():
    readme, page, script = (
        (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/how-to/other-systems.md", "install")
    )
    for name, system, python in SYSTEMS:
        assert f'"{system["platform_system"]} {system["platform_machine"]} 3.{python}"' in script, name
    assert script.count('"Linux') + script.count('"Darwin') == len(SYSTEMS)
    assert "Python 3.11, 3.12 or 3.13, on Linux (x86_64) or macOS 15 (Apple processor)" in readme
    assert "| Linux with glibc 2.28 or newer | x86_64 | 3.11, 3.12, 3.13 |" in page
    assert "| macOS 15 or newer | Apple (arm64) | 3.11, 3.12, 3.13 |" in page


@pytest.mark.skipif(not os.environ.get("WHEELS_ONLINE"), reason="WHEELS_ONLINE asks the registry for wheels")
@pytest.mark.parametrize(("name", "system", "python"), SYSTEMS)
def test_each_package_has_a_wheel_or_is_plain_python(tmp_path, name, system, python):
    command = [Path(sys.executable).parent / "uv", "pip", "install", "--dry-run", "--no-deps", "--require-hashes"]
    command += ["--only-binary", ":all:", *(word for one in PLAIN_PYTHON for word in ("--no-binary", one))]
    command += ["--python-platform", PLATFORMS[name], "--python-version", f"3.{python}", "--target", tmp_path / "none"]
    done = subprocess.run(
        [*command, "-r", ROOT / "requirements.lock"],
        env=os.environ | {"MACOSX_DEPLOYMENT_TARGET": "15.0"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


TOLD = {"Linux x86_64 3.12": False, "Linux aarch64 3.12": True, "Linux x86_64 3.14": True, "Darwin x86_64 3.13": True}


@pytest.mark.parametrize(("system", "is_told"), TOLD.items())
def test_a_system_without_all_wheels_is_one_line_before_the_download(checkout, system, is_told):
    (checkout / "python").write_text(f'#!/bin/sh\n[ "$1" = -c ] && echo {system} && exit 0\nexit 1\n')
    (checkout / "python").chmod(0o755)
    lines = install(checkout, str(checkout / "python")).stderr.splitlines()
    assert (f"install: {system}: some packages have no wheel" in lines[0]) is is_told


def test_a_package_that_cannot_be_built_ends_in_one_line(checkout):
    """The environment is there, and uv fails."""
    (checkout / ".venv/bin").mkdir(parents=True)
    for name, code in (("python", 0), (".venv/bin/pip", 0), (".venv/bin/uv", 1)):
        (checkout / name).write_text(f'#!/bin/sh\n[ "$1" = -c ] && echo Linux aarch64 3.12\nexit {code}\n')
        (checkout / name).chmod(0o755)
    done = install(checkout, str(checkout / "python"))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("install: failed for Linux aarch64 3.12; the lines above name")
    assert not (checkout / ".venv/installed.lock").exists()
