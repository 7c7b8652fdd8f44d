"""Golden files: written, read, and compared with results, with each difference in a line."""

import difflib
import json
import math
import re
from pathlib import Path

from pins import Pin, Pins, processor

FOLDER = Path(__file__).parent
SUMMARY_TOLERANCE = 0.01  # relative; for another processor or other versions of numpy and numba
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|e[-+−]?\d+)?")
SMALLEST_SCALE = 1e-10  # of a relative difference: smaller values are rounding errors


def golden_file(name: str) -> Path:
    """Place of a golden file."""
    return FOLDER / f"{name}.json"


def write_golden(name: str, pins: Pins) -> None:
    """Write a golden file, one variable or line of a page to a line."""
    text = _json({"processor": processor(), "files": pins})
    golden_file(name).write_text(f"{text}\n", encoding="utf-8")


def _json(value, indent: str = "") -> str:
    """JSON with every list of numbers and every text on one line."""
    inner = indent + " "
    if isinstance(value, dict):
        items = (f"{inner}{json.dumps(key, ensure_ascii=False)}: {_json(value[key], inner)}" for key in value)
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, str) and len(item) > 60 for item in value):
        items = (inner + json.dumps(item, ensure_ascii=False) for item in value)
        return "[\n" + ",\n".join(items) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)


def read_golden(name: str) -> tuple[dict[str, str], Pins]:
    """Processor and pins of a golden file."""
    content = json.loads(golden_file(name).read_text(encoding="utf-8"))
    return content["processor"], content["files"]


def differences(golden: Pins, found: Pins, exact: bool = True) -> list[str]:
    """A line for each difference of results from a golden file.

    exact: hashes are compared. Otherwise variables may differ by SUMMARY_TOLERANCE of their summaries. Of tables only
    the number of lines is compared, of pages only the words, since datasets hold their numbers, too.
    """
    lines = [f"{path}: no such result any more" for path in golden if path not in found]
    lines += [f"{path}: a result that the golden file does not have" for path in found if path not in golden]
    for path in golden:
        if path not in found:
            continue
        compare = _page_differences if path.endswith(".html") else _variable_differences
        lines += [f"{path}: {line}" for line in compare(golden[path], found[path], exact)]
    return lines


def _variable_differences(golden: dict[str, Pin], found: dict[str, Pin], exact: bool) -> list[str]:
    """Differences between the variables of a file."""
    lines = [f"{name}: no such variable any more" for name in golden if name not in found]
    lines += [f"{name}: a new variable" for name in found if name not in golden]
    for name in golden:
        if name not in found:
            continue
        before, after = golden[name], found[name]
        if before[0] != after[0]:
            lines.append(f"{name}: {before[0]} became {after[0]}")
        elif exact and before[1] != after[1]:
            lines.append(f"{name}: values changed{_told(before, after)}")
        elif _summary_difference(before, after) > SUMMARY_TOLERANCE:
            lines.append(f"{name}: values changed by more than {SUMMARY_TOLERANCE:g}{_told(before, after)}")
    return lines


def _told(before: Pin, after: Pin) -> str:
    """What the summaries of two pins say of their difference."""
    if len(before) == 2:
        return ""
    names = ("finite values", "least", "largest", "sum of absolute values")
    changed = [
        f"{name} {old!r} became {new!r}"
        for name, old, new in zip(names, before[2:], after[2:], strict=True)
        if old != new
    ]
    largest = f"largest relative difference {_summary_difference(before, after):.2g}"
    return f": {'; '.join(changed)}; {largest}" if changed else ", but no number of their summary"


def _summary_difference(before: Pin, after: Pin) -> float:
    """Largest relative difference between the summaries of two pins, infinite if more or fewer values are finite.

    Least and largest are compared with the larger magnitude of the two: one of them may be zero but for rounding.
    """
    if len(before) == 2:
        return 0.0
    if before[2] != after[2]:
        return math.inf
    scale = max(abs(before[3]), abs(before[4]), SMALLEST_SCALE)
    ends = max(abs(old - new) for old, new in zip(before[3:5], after[3:5], strict=True)) / scale
    return max(ends, abs(before[5] - after[5]) / max(abs(before[5]), SMALLEST_SCALE))


def _page_differences(golden: dict[str, list[str]], found: dict[str, list[str]], exact: bool) -> list[str]:
    """Lines of a page that have gone (-) or come (+), by heading."""
    differing = []
    for title in [*golden, *(title for title in found if title not in golden)]:
        before, after = golden.get(title, []), found.get(title, [])
        if not exact and [NUMBER.sub("#", line) for line in before] == [NUMBER.sub("#", line) for line in after]:
            continue
        for line in difflib.ndiff(before, after):
            if line[0] in "+-":
                differing.append(f"{title}: {line}")
    return differing
