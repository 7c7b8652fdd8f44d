"""Run the mines of golden files and write the files anew: python tests/golden/write.py [tiny] [demo] [elk_creek].

Without words, the tiny mines. What has changed since the last writing is printed.
"""

import sys
import tempfile
from pathlib import Path

from golden_files import differences, golden_file, read_golden, write_golden
from golden_mines import RUNS, results_of


def main(names: list[str]) -> None:
    """Write the golden files of these names."""
    if unknown := set(names) - set(RUNS):
        sys.exit(f"{', '.join(sorted(unknown))}: no golden file; there are {', '.join(RUNS)}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            found, others = results_of(name, Path(folder))
        if golden_file(name).is_file():
            for line in differences(read_golden(name)[1], found):
                print(f"{name}: {line}")
        for path in others:
            print(f"{name}: {path} is not pinned")
        write_golden(name, found)


if __name__ == "__main__":
    main(sys.argv[1:] or ["tiny"])
