"""Measurement of one case in a process of its own, watched for time and memory. Short cases are repeated."""

import json
import logging
import math
import os
import platform
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import psutil

from common.costs import processor_time
from common.stage import PARENT, die_with_parent
from verification.benchmarks.peers.stope import sizes
from verification.benchmarks.settings import PEERS, ROOT, Case, Code, Settings

POLL_INTERVAL = 0.2  # Time between two looks at a process, s.
MAX_PREPARATION = 900.0  # Time for meshes and compilation before a solution begins, s.
MIN_GROWTH, MAX_GROWTH = 1.0, 2.0  # Time is taken to grow as a power of the number of cells between these.
DONE, STOPPED, NOT_RUN, FAILED, LEFT_OUT = "done", "stopped", "not run", "failed", "left out"


class Unavailable(Exception):
    """A peer cannot be installed. The message is one line."""


def measure(settings: Settings, case: Case, threads: int, earlier: list[dict], environments: Path) -> dict:
    """A row of the table: the case, its sizes, outcome and remark, and what was measured.

    earlier: rows of the same code and problem with fewer cells. environments: folder of the peers' environments.
    """
    numbers = settings.numbers(case, threads)
    row = asdict(case) | sizes(numbers) | {"cell": numbers["cell"], "outcome": DONE, "remark": ""}
    row |= {"threads": threads, "machine": machine()}
    row["begun"] = datetime.now(UTC).isoformat(sep=" ", timespec="seconds").removesuffix("+00:00")
    time_limit = settings.time_limit_of(case.code)
    remark = foreseen(row["cells"], earlier, time_limit, settings.memory_limit)
    if remark:
        return row | {"outcome": NOT_RUN, "remark": remark}
    answers: list[dict] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.json"
        path.write_text(json.dumps(numbers))
        try:
            command = command_of(settings.codes[case.code], case, path, threads, environments)
        except Unavailable as error:
            return row | {"outcome": LEFT_OUT, "remark": str(error)}
        before = times_now()
        while len(answers) < settings.repetitions:
            outcome, more = watch(command, threads, time_limit, settings.memory_limit)
            if outcome != DONE:
                return row | {"outcome": outcome, "remark": more[-1]["reason"]}
            answers += more
            if more[-1]["seconds"] > settings.repeat_below:
                break
        taken, ours, elapsed = (now - then for now, then in zip(times_now(), before, strict=True))
    others = max(taken - ours, 0.0) / elapsed
    middle = {key: statistics.median(answer[key] for answer in answers) for key in ("seconds", "cpu_seconds", "memory")}
    return row | answers[-1] | middle | {"repetitions": len(answers), "others": others}


def machine() -> str:
    """Processor, cores, memory, system and Python, as far as they are known."""
    name = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name)
    memory = psutil.virtual_memory().total / 1e9
    return f"{name}, {os.cpu_count()} cores, {memory:.0f} GB, {platform.system()}, Python {platform.python_version()}"


def times_now() -> tuple[float, float, float]:
    """Processor time of the whole machine, that of this process with its ended children, and the clock; all in s.

    Time that a virtual machine's host gave to others counts as the machine's.
    """
    times = psutil.cpu_times()
    idle = times.idle + getattr(times, "iowait", 0.0)
    guests = getattr(times, "guest", 0.0) + getattr(times, "guest_nice", 0.0)  # User time includes them.
    return sum(times) - guests - idle, processor_time(), time.perf_counter()


def foreseen(cells: int, earlier: list[dict], time_limit: float, memory_limit: float) -> str:
    """Why a case is expected to exceed its limits (s, GB), extrapolated from smaller ones; empty if it is not."""
    if not earlier:
        return ""
    last = earlier[-1]
    if last["outcome"] != DONE:
        return last["remark"] if last["outcome"] == NOT_RUN else f"{last['cells']:,} cells: {last['remark']}"
    power, per_cell = MIN_GROWTH, last["memory"] / last["cells"]
    if len(earlier) > 1:
        before = earlier[-2]
        power = math.log(last["seconds"] / before["seconds"]) / math.log(last["cells"] / before["cells"])
        power = min(max(power, MIN_GROWTH), MAX_GROWTH)
        per_cell = (last["memory"] - before["memory"]) / (
            last["cells"] - before["cells"]
        )  # The memory of libraries does not grow.
    seconds = last["seconds"] * (cells / last["cells"]) ** power
    memory = last["memory"] + per_cell * (cells - last["cells"])
    if seconds > time_limit:
        return f"about {seconds:.0f} s foreseen, {time_limit:g} s allowed"
    if memory > memory_limit:
        return f"about {memory:.0f} GB foreseen, {memory_limit:g} GB allowed"
    return ""


def command_of(code: Code, case: Case, path: Path, threads: int, environments: Path) -> list[str]:
    """Command that solves the case whose numbers stand in the file `path`."""
    if code.script:
        return [str(peer_python(code, environments)), str(PEERS / code.script), str(path)]
    return [sys.executable, "-m", "verification", "solve", case.name, "--threads", str(threads)]


def peer_python(code: Code, environments: Path) -> Path:
    """Python that runs a peer: that of its environment, which uv makes where it is missing, or the system's.

    Raises Unavailable.
    """
    if code.module:
        return system_python(code.module)
    beside = Path(sys.executable).with_name("uv")
    uv = str(beside) if beside.exists() else shutil.which("uv")
    if not uv:
        raise Unavailable("not installed: needs uv (pip install uv)")
    folder = (environments / Path(code.requirements).stem).absolute()
    python = folder / "bin" / "python"
    steps = [["pip", "install", "--python", str(python), "-r", str(PEERS / code.requirements)]]
    if not python.exists():
        steps.insert(0, ["venv", "--python", sys.executable, str(folder)])
    for step in steps:
        made = subprocess.run([uv, "--quiet", *step], capture_output=True, text=True)
        if made.returncode:
            logging.info("uv %s: %s", step[0], made.stderr)
            raise Unavailable("not installed: is there a network?")
    return python


def system_python(module: str) -> Path:
    """The system's Python. Raises Unavailable where it lacks a module."""
    python = shutil.which("python3", path=os.defpath)
    if not python or subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
        raise Unavailable(f"not installed: the system's Python has no module {module}")
    return Path(python)


def watch(command: list[str], threads: int, time_limit: float, memory_limit: float) -> tuple[str, list[dict]]:
    """Run a command to its end or to its limits. Returns the outcome and the announced results of its solutions.

    The last result has the reason where the command failed or was stopped. The time limit (s) applies to each solution,
    from the line that announces it; the memory limit (GB) applies to all processes of the command together.
    """
    of_stage = (PARENT, "PYTHONSAFEPATH")  # Of a rule: its parent is not this command's, whose scripts import others.
    environment = {name: value for name, value in os.environ.items() if name not in of_stage} | {
        "PYTHONPATH": str(ROOT),
        "OMP_NUM_THREADS": str(threads),
        "NUMBA_NUM_THREADS": str(threads),
    }
    with tempfile.TemporaryDirectory() as folder:
        said, errors = Path(folder) / "said", Path(folder) / "errors"
        with said.open("w") as out, errors.open("w") as err:
            process = psutil.Popen(
                command, stdout=out, stderr=err, env=environment, start_new_session=True, preexec_fn=die_with_parent
            )
            reason = _until_end(process, said, time_limit, memory_limit)
        answers = [answer for answer in _answers(said) if "seconds" in answer]
        logging.info("%s\n%s", " ".join(command), errors.read_text(errors="replace")[-4000:])
        if reason:
            return STOPPED, [{"reason": reason}]
        if not answers or process.returncode:
            last = (errors.read_text(errors="replace").strip().splitlines() or ["no message"])[-1]
            return FAILED, [{"reason": f"ended with status {process.returncode}: {last[:200]}"}]
        if not all(answer["converged"] for answer in answers):
            return FAILED, [{"reason": answers[-1]["reason"][:200]}]
        return DONE, answers


def _until_end(process: psutil.Popen, said: Path, time_limit: float, memory_limit: float) -> str:
    """Wait for a process, or end it with all that it has started. Returns why; empty if it ended by itself."""
    clock, limit, heard = time.perf_counter(), MAX_PREPARATION, 0
    reason = ""
    try:
        while process.poll() is None and not reason:
            time.sleep(POLL_INTERVAL)
            said_so_far = len(_answers(said))
            if said_so_far != heard:
                clock, heard = time.perf_counter(), said_so_far
                limit = time_limit if heard % 2 else MAX_PREPARATION  # An odd number of lines: a solution has begun.
            if time.perf_counter() - clock > limit:
                reason = f"took more than {limit:g} s" + ("" if heard % 2 else " to prepare")
            elif _memory(process) > memory_limit:
                reason = f"took more than {memory_limit:g} GB"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return reason


def _answers(said: Path) -> list[dict]:
    """Complete lines of JSON. Peers print other lines as well."""
    lines = said.read_text(errors="replace").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.startswith("{") and line.endswith("\n")]


def _memory(process: psutil.Process) -> float:
    """Resident memory of a process and all that it has started, GB."""
    total = 0
    try:
        for one in (process, *process.children(recursive=True)):
            total += one.memory_info().rss
    except psutil.Error:  # The process has ended meanwhile.
        pass
    return total / 1e9
