"""Numba compiles less for the same kernel."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
KERNEL = """
import hashlib, json, sys
import numba, numpy as np
from numba.core import codegen

made = []
find = codegen.JITCodeLibrary._finalize_specific

def note(library):
    made.append(library.name)
    find(library)

codegen.JITCodeLibrary._finalize_specific = note

@numba.njit
def root(value):
    return np.sqrt(value)

@numba.njit(parallel=True, error_model="numpy")
def kernel(values, sums):
    total = 0.0
    for i in numba.prange(len(sums)):
        work = np.zeros(3)
        for j in range(values.shape[1]):
            work[j % 3] += root(values[i, j])
        sums[i] = work.sum() / work[0]
        total += 1.0
    rest = np.empty_like(sums)
    for i in numba.prange(len(sums)):
        rest[i] = sums[i] - values[i, 0]
    return total, rest

values = np.random.default_rng(1).random((1000, 7))
sums = np.empty(1000)
total, rest = kernel(values, sums)
print(json.dumps([hashlib.sha256(sums.tobytes() + rest.tobytes()).hexdigest(), total, made]))
"""


def compiled(before: str) -> tuple[str, float, list[str]]:
    """Digest of what the kernel calculates, its sum, and the libraries that were made into machine code."""
    run = subprocess.run([sys.executable, "-c", before + KERNEL], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return tuple(json.loads(run.stdout))


def test_a_kernel_is_made_into_machine_code_once_and_calculates_the_same():
    """Both loops, a function that one of them calls and a sum over threads; numba itself makes three parts of a loop
    beside the kernel."""
    digest, total, plain = compiled("")
    ours = compiled("import mpm_core")
    assert ours[:2] == (digest, total)
    assert total == 1000.0
    parts = [name for name in plain if name not in ours[2]]
    assert len(plain) - len(ours[2]) == len(parts) == 6
    assert "kernel" in ours[2]
    assert "root" in ours[2]
