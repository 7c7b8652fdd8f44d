"""Memory that is free: of the machine, or less where a container or a cluster's job has a limit."""

from types import SimpleNamespace

import psutil
import pytest

from common import free_memory
from common.free_memory import SEPARATE, UNIFIED

GB = 10**9


@pytest.fixture
def groups(monkeypatch, tmp_path):
    """Writes the control groups of this process: its line, and limit, use and caches by folder; 100 GB are free."""
    monkeypatch.setattr(free_memory, "GROUPS", tmp_path)
    monkeypatch.setattr(free_memory, "MEMBERSHIP", tmp_path / "membership")
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=100 * GB))

    def write(line: str, names: tuple[str, str, str], **folders: tuple) -> float:
        (tmp_path / "membership").write_text(f"12:cpu,cpuacct:/x\n{line}\n")
        for folder, (limit, used, caches) in folders.items():
            own = tmp_path / folder.replace("_", "/")
            own.mkdir(parents=True, exist_ok=True)
            (own / names[0]).write_text(f"{limit}\n")
            (own / names[1]).write_text(f"{used}\n")
            parts = {"anon": 5, f"{names[2]}inactive_file": caches // 4, f"{names[2]}active_file": caches - caches // 4}
            (own / "memory.stat").write_text("".join(f"{name} {size}\n" for name, size in parts.items()))
        return free_memory.free_memory()

    return write


def test_a_job_has_what_its_group_leaves(groups):
    """File caches are given back. The limit may be that of a group above."""
    assert groups("0::/job/step", UNIFIED, job=(8 * GB, 3 * GB, GB), job_step=("max", 2 * GB, 0)) == 6 * GB
    assert groups("0::/job/step", UNIFIED, job_step=(4 * GB, 2 * GB, 0)) == 2 * GB


def test_groups_of_version_1_count(groups):
    line = "4:memory,hugetlb:/slurm/job"
    assert groups(line, SEPARATE, memory_slurm_job=(8 * GB, 3 * GB, GB)) == 6 * GB
    assert groups(line, SEPARATE, memory_slurm_job=(2**63 - 4096, 3 * GB, GB)) == 100 * GB  # none


def test_a_container_has_its_group_at_the_root(groups):
    """Its path is that of the machine, which the container does not see."""
    assert groups("4:memory:/docker/0123", SEPARATE, memory=(4 * GB, GB, 0)) == 3 * GB


def test_without_groups_the_machine_counts(groups, tmp_path):
    assert groups("0::/job", UNIFIED) == 100 * GB
    (tmp_path / "membership").unlink()
    assert free_memory.free_memory() == 100 * GB
