"""A byte of a result that has changed on the disk is told, or changes nothing: never another number without a word."""

import subprocess
import sys

import netCDF4
import numpy as np
import pytest
import xarray as xr
from job_runs import ROOT

from common.datasets import MIN_VALUES_COMPRESSED, checksum, open_dataset, read_dataset, rows_of_chunk, write_dataset
from common.errors import InputError

random = np.random.default_rng(4)
MANY = 2 * MIN_VALUES_COMPRESSED


def scene() -> xr.Dataset:
    """Every kind of variable that results have, on either side of the size from which netCDF's own checksum is used."""
    return xr.Dataset(
        {
            "stress": (("particle", "voigt"), random.normal(size=(MANY, 6)), {"units": "Pa"}),
            "failed": ("particle", np.arange(MANY, dtype=np.int32)),
            "step": ("event", np.array(["history", "2019-08", ""])),
            "time": ("event", np.array(["2019-08-01", "2019-08-02", "NaT"], "datetime64[ns]")),
            "mw": ("event", np.array([0.5, np.nan, -1.0])),
            "resolved": ("event", np.array([1, 0, 1], np.int8)),
            "cut": ((), -2.5),
            "since": ("event", np.array(["2019-08-01", "2019-08-02", "NaT"], "datetime64[s]")),
            "swapped": ("event", np.array([1.0, 2.0, 3.0], ">f8")),
        },
        coords={"interval": ["lower", "upper"]},
        attrs={"mine": "demo", "location_error": 5.0, "count": 3, "lower": [0.0, 1.0, 2.0], "one": [7], "text": ["a"]},
    )


def test_what_is_written_is_what_is_read(tmp_path):
    """Every kind of variable and attribute has the same checksum before and after."""
    path = tmp_path / "a.nc"
    written = scene()
    write_dataset(written, path)
    read = read_dataset(path)
    with netCDF4.Dataset(path) as stored:
        assert stored.checksum == checksum(read)
    for name, variable in written.variables.items():
        np.testing.assert_array_equal(read[name], variable)


FLIP = """
import sys
from pathlib import Path
import numpy as np
from common.datasets import read_dataset
from common.errors import InputError

source, copy = map(Path, sys.argv[1:3])
good, content = read_dataset(source), source.read_bytes()
places = np.unique(np.concatenate([
    np.random.default_rng(7).integers(0, len(content), 60),
    [content.index(text) + 1 for text in (b"demo", b"history", b"upper", b"location_error")],
]))
counts = {"told": 0, "harmless": 0, "silent": 0}
for place in places:
    changed = bytearray(content)
    changed[place] ^= 1 << int(place) % 8
    copy.write_bytes(changed)
    try:
        read = read_dataset(copy)
        plain = [{key: np.ravel(value).tolist() for key, value in one.attrs.items()} for one in (read, good)]
        same = read.drop_attrs().identical(good.drop_attrs()) and plain[0] == plain[1]
        kind = "harmless" if same else "silent"
    except InputError as error:
        assert str(error).startswith(str(copy)) and "run the same command again" in str(error), error
        kind = "told"
    counts[kind] += 1
print(counts["told"], counts["harmless"], counts["silent"])
"""


def test_a_flipped_bit_anywhere_is_told_or_harmless(tmp_path):
    """In numbers, text, names, attributes and the library's own tables. In a process of its own: HDF5 may end it."""
    write_dataset(scene(), tmp_path / "good.nc")
    run = subprocess.run(
        [sys.executable, "-c", FLIP, str(tmp_path / "good.nc"), str(tmp_path / "bad.nc")],
        cwd=ROOT, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-2000:]
    told, _, silent = map(int, run.stdout.split())
    assert silent == 0
    assert told > 40  # most bytes are numbers


def test_a_block_that_meets_damage_later_names_the_file(tmp_path):
    """Of two open files the damaged one is named; other errors stay what they are."""
    for name in ("good.nc", "bad.nc"):
        write_dataset(scene(), tmp_path / name)
    content = bytearray((tmp_path / "bad.nc").read_bytes())
    numbers = scene_bytes(tmp_path / "bad.nc")
    content[numbers] ^= 16
    (tmp_path / "bad.nc").write_bytes(content)
    with (
        pytest.raises(InputError, match=r"bad\.nc: damaged"),
        open_dataset(tmp_path / "bad.nc") as bad,
        open_dataset(tmp_path / "good.nc") as good,
    ):
        assert good["stress"].values.shape == bad["stress"].values.shape
    with pytest.raises(RuntimeError, match="of another kind"), open_dataset(tmp_path / "good.nc"):
        raise RuntimeError("of another kind")


def scene_bytes(path) -> int:
    """Where in the file a number of `stress` stands."""
    return path.read_bytes().index(read_dataset(path)["stress"].values[5].tobytes())


@pytest.mark.parametrize("rows", [1, 65536, 65537, 140000, 1_000_003])
def test_chunks_are_of_one_size(rows):
    """No chunk is filled up with more rows than there are chunks."""
    chunk = rows_of_chunk(rows)
    chunks = -(-rows // chunk)
    assert 0 <= chunks * chunk - rows < chunks
