"""What setting up the hierarchy costs beside an elastic solution in a process of its own, as every stage is one.

Run ``python -m tests.benchmarks.setup`` on a quiet machine. Required: a third. The scene is that of
tests.benchmarks.multigrid. Each turn is a new process whose kernels are loaded; it allocates all that it needs anew.

What that costs depends on where the memory comes from. A virtual machine may have given its free memory back to its
host, and to have it again then takes 20 to 40 times as long as the machine's own page faults. So turns alternate: `at
hand`, right after as much memory has been touched and freed as the turn will need, and `from the host`, after a pause
in which free memory goes back. Where nothing is lent, both are alike.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time

import numpy as np

from mpm_core.multigrid.solver import ElasticSolver
from tests.benchmarks.grid import BASE_SHAPE, LEVELS
from tests.benchmarks.multigrid import scene

AT_HAND, FROM_HOST = "at hand", "from the host"
MEMORY = 4 << 30  # bytes: more than set-up and solution take
PAUSE = 5.0  # s


def turn(grid, cell_nodes, held, rock, load) -> dict:
    """Seconds of set-up and of a solution, and the processor's in the kernel of the operating system."""
    clock = [(time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_stime)]
    solver = ElasticSolver(grid, cell_nodes, held, rock)
    clock.append((time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_stime))
    solution = solver.solve(load, 1e-6, 100)
    clock.append((time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_stime))
    assert solution.ratio <= 1e-6
    (set_up, set_up_system), (solve, solve_system) = np.diff(clock, axis=0)
    return {"set_up": set_up, "solution": solve, "set_up_system": set_up_system, "solution_system": solve_system}


def one_process(memory: str) -> None:
    """What a turn's process does; its times go to standard output."""
    turn(*scene(BASE_SHAPE, 2))  # a smaller one: loads the kernels
    arguments = scene(BASE_SHAPE, LEVELS)
    if memory == AT_HAND:
        np.zeros(MEMORY, np.uint8)[::4096] = 1
    else:
        time.sleep(PAUSE)
    print(json.dumps(turn(*arguments)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=5, help="turns of which the median is taken")
    parser.add_argument("--memory", choices=[AT_HAND, FROM_HOST], help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.memory:
        one_process(arguments.memory)
        return
    turns: dict[str, list[dict]] = {AT_HAND: [], FROM_HOST: []}
    command = [sys.executable, "-m", "tests.benchmarks.setup", "--memory"]
    for _ in range(arguments.repetitions):
        for memory, found in turns.items():
            answer = subprocess.run([*command, memory], stdout=subprocess.PIPE, text=True, check=True).stdout
            found.append(json.loads(answer))
    print(f"{'memory':16}{'set-up s':>10}{'(system)':>10}{'solution s':>12}{'(system)':>10}{'share':>8}   of each turn")
    for memory, found in turns.items():
        middle = {key: statistics.median(answer[key] for answer in found) for key in found[0]}
        shares = [answer["set_up"] / answer["solution"] for answer in found]
        print(f"{memory:16}{middle['set_up']:10.2f}{middle['set_up_system']:10.2f}", end="")
        print(f"{middle['solution']:12.2f}{middle['solution_system']:10.2f}{statistics.median(shares):8.2f}   ", end="")
        print(*(f"{share:.2f}" for share in shares))


if __name__ == "__main__":
    main()
