"""Results of the tiny mines are those of the golden files. So are, on request, those of the demo and of Elk Creek.

The request is the variable GOLDEN: GOLDEN=demo,elk_creek.
"""

import os
import warnings

import pytest
from golden_files import SUMMARY_TOLERANCE, differences, read_golden
from golden_mines import RUNS, results_of
from pins import processor

REQUESTED = os.environ.get("GOLDEN", "").split(",")


def when_requested(name: str):
    """A name of a golden file, as a parameter that is skipped unless it is requested or small."""
    skip = pytest.mark.skipif(name != "tiny" and name not in REQUESTED, reason=f"runs with GOLDEN={name}")
    return pytest.param(name, marks=[pytest.mark.slow, skip])


@pytest.mark.parametrize("name", [when_requested(name) for name in RUNS])
def test_results_are_pinned(name, tmp_path):
    """To the bit on the processor that the golden file was written on, else by summaries."""
    written_on, golden = read_golden(name)
    here = processor()
    if here != written_on:
        other = ", ".join(f"{key} {written_on[key]}, here {here[key]}" for key in here if here[key] != written_on[key])
        warnings.warn(
            f"{name}.json was written with {other}: values are compared to {SUMMARY_TOLERANCE:g} only", stacklevel=1
        )
    found, others = results_of(name, tmp_path)
    if others:
        warnings.warn(f"{name}: not pinned: {', '.join(others)}", stacklevel=1)
    changed = differences(golden, found, exact=here == written_on)
    remedy = f"If this is meant, run `python tests/golden/write.py {name}`, and say why in the commit"
    assert not changed, "\n".join([*changed, remedy])
