"""What the numbers were measured on, and whether something else ran beside."""

import os
import platform
import resource
import time
from pathlib import Path

import psutil


def machine() -> str:
    """Processor, cores, memory, system and Python, as far as they can be told."""
    name = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name)
    memory = psutil.virtual_memory().total / 1e9
    return f"{name}, {os.cpu_count()} cores, {memory:.0f} GB, {platform.system()}, Python {platform.python_version()}"


def processor_time() -> tuple[float, float, float]:
    """Seconds so far: processor time of the whole machine, of this process with its ended children, and the clock.

    What a virtual machine's host gave to others counts as the machine's.
    """
    times = psutil.cpu_times()
    idle = times.idle + getattr(times, "iowait", 0.0)
    guests = getattr(times, "guest", 0.0) + getattr(times, "guest_nice", 0.0)  # count in user time already
    own = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(times) - guests - idle, sum(use.ru_utime + use.ru_stime for use in own), time.perf_counter()
