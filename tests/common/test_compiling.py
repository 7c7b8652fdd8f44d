"""Numba compiles less for the same kernel."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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


STORED = """
import sys
import numba, numpy as np

@numba.njit(parallel=True, cache=True)
def kernel(matrices):
    sums = np.zeros(len(matrices))
    for i in numba.prange(len(matrices)):
        held = {j: np.sqrt(j) for j in range(3)}
        work = np.linalg.solve(matrices[i], np.ones(3))
        np.random.seed(i)
        sums[i] = np.sort(work)[1] + held[2] + np.random.random()
    return sums, [str(len(sums))]

sums, texts = kernel(np.random.default_rng(1).random((50, 3, 3)))
print(sums.tobytes().hex(), texts, *kernel.stats.cache_hits.values(), "numba.np.random.distributions" in sys.modules)
"""


def printed_twice(source: str, folder: Path) -> list[list[str]]:
    """Words that a module prints as one process imports it and stores its kernels, and as another one reads them."""
    (folder / "kernels.py").write_text(source)
    program = f"import mpm_core, sys; sys.path.insert(0, {str(folder)!r}); import kernels"
    words = []
    for _ in range(2):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
        run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        words.append(run.stdout.split())
    return words


def test_a_stored_kernel_is_read_without_what_compiles_others(tmp_path):
    """It calls LAPACK, sorts, hashes, draws and makes texts, as far as kernels may. One that is not stored compiles."""
    first, second = printed_twice(STORED, tmp_path)
    assert first[:-1] == second[:-2]
    assert first[-1:] == ["True"]
    assert second[-2:] == ["1", "False"]


LINKED = """
import numba, numpy as np
from llvmlite import binding

parsed = []
parse = binding.parse_bitcode
binding.parse_bitcode = lambda *arguments: parsed.append(1) or parse(*arguments)

@numba.njit(cache=True)
def inner(value):
    return np.sqrt(value) + 1.0

@numba.njit(parallel=True, cache=True)
def middle(values):
    total = 0.0
    for i in numba.prange(len(values)):
        total += inner(values[i])
    return total

values = np.arange(4.0)
run_alone = inner(9.0), middle(values)
before = len(parsed)

@numba.njit
def outer(values):
    return middle(values) + inner(values[1])

print(*run_alone, outer(values), middle.stats.cache_hits.total(), before, len(parsed))
"""


def test_a_stored_kernel_is_linked_into_one_that_compiles(tmp_path):
    """Its bitcode is parsed for that alone; run as it is stored, it is not."""
    first, second = ([float(word) for word in words] for words in printed_twice(LINKED, tmp_path))
    middle = 4.0 + sum(value**0.5 for value in range(4))
    assert first[:3] == second[:3] == pytest.approx([4.0, middle, middle + 2.0])
    assert second[3] == 1
    assert second[4] == 0 < second[5]
