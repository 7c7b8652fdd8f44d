"""Memory that is free for this process: of the machine, within the limits of its container or of a cluster's job."""

from collections.abc import Iterator
from pathlib import Path

import psutil

MEMBERSHIP = Path("/proc/self/cgroup")  # control groups of this process: a line for each hierarchy
GROUPS = Path("/sys/fs/cgroup")
UNIFIED = ("memory.max", "memory.current", "")  # of version 2: limit, use, and how names in memory.stat begin
SEPARATE = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_")  # of version 1
CACHES = ("inactive_file", "active_file")  # part of the use, which the kernel gives back


def free_memory() -> float:
    """Bytes that this process may take in addition to what it holds."""
    return float(min([psutil.virtual_memory().available, *_left_in_groups()]))


def _left_in_groups() -> Iterator[float]:
    """Bytes that are left to each control group of this process that has a limit. Elsewhere than on Linux none."""
    try:
        lines = MEMBERSHIP.read_text(encoding="utf-8").splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        root, names = (GROUPS / "memory", SEPARATE) if controllers else (GROUPS, UNIFIED)
        group = root / path.lstrip("/")
        for folder in [group, *group.parents][: len(group.relative_to(root).parts) + 1]:
            try:  # A container has the folder of its own group at the root.
                limit, used = (float((folder / name).read_text()) for name in names[:2])
                held = dict(one.split() for one in (folder / "memory.stat").read_text().splitlines())
                yield limit - used + sum(float(held[names[2] + cache]) for cache in CACHES)
            except (OSError, ValueError, KeyError):  # without a limit, or not there
                continue
