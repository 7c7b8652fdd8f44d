"""Spoiled records, at random from a seed: each is read, or refused in one line that names it; never a traceback.

EXTREMES=3000 in the environment runs as many.
"""

import os
import random
import re

import numpy as np
import pytest
from catalog_fixtures import SETTINGS, made_up_catalog

from catalogs.records import read_record
from catalogs.sources.quakeml import write_quakeml
from common.errors import InputError

TABLE = """time,x,y,z,mw
2019-08-01T12:00:00,100.5,200,300,-1.0
2019-08-13T00:00:00.5,110,1200,300,0.5
2019-08-14,-5,3,12e1,-0.25"""
COLUMNS = {name: name for name in ("time", "x", "y", "z", "mw")}
CELLS = (
    '|-99|-999|nan|inf|-inf|1e300|1e-400|0|400|x|é|\0|#|\'|"|"a|1,5|1.500,2|1,500.2|95|2019-08-01|1/2/2019|0001-01-01|'
    "9999-12-31|2019-13-45|12:61|١٢|  7 |+5|--5|1_000|0x10|1e5e5|NULL|;|\t|=1+1|\u22123|½|1e|.|-|2019-08-01T12:00+99|"
    "2019-08-01 24:00|20190801T120000Z|1564617600|Aug|13/13/2019|1 000,5"
).split("|")
KINDS = (
    "potency",
    "log_potency",
    "moment",
    "magnitude",
    "magnitude_type",
    "latitude",
    "depth",
    "step",
    "moment_xx",
    "energy",
    "log_energy",
    "log_moment",
    "event_type",
    "evaluation_status",
    "year",
    "zzz",
)
NAMES = ("x", "mw", "time", "q", ["time", "x"], {"a": 1}, None, 3, "", " x ")
DOMAIN = {"lower": [-500, -500, -500], "upper": [500, 500, 500], "plane": None}
SETTINGS_AT_RANDOM = {
    "time_zone": ("UTC", "+10:00", "Nowhere", "Europe/Berlin", "", "+99", "/etc/passwd", "a\0b"),
    "date_order": ("day", "month"),
    "decimal": ("comma", "point"),
    "missing": ([], [0], [-99, 300]),
    "units": ({"x": "ft"}, {"z": "km"}, {"x": "Pa"}, {"mw": "1"}, {"x": "9**9**9"}, {"y": "m" * 300}),
    "conversions": ({"ML": "none"}, {"untyped": {"slope": 1, "offset": 0}}),
    "domain": (DOMAIN,),
    "period": ({"start": "2019-08-01", "end": "2019-09-01"},),
    "encoding": ("gbk", "utf-16", "cp1252", "base64", "", "\0", "idna", "utf-7"),
    "time_format": ("excel", "unix", "unix_ms"),
    "energy_conversion": ({"slope": 1, "offset": 5},),
    "filter": ({"keep": ["blast", "rejected"]}, {"maximum": {"q": 1}}, {"minimum": {"mw": 0}}),
}
VALUES = (
    "",
    "nan",
    "inf",
    "-1",
    "1e300",
    "abc",
    "95",
    "-999",
    "2500-01-01T00:00:00Z",
    "é",
    " 1 2 ",
    "0",
    "true",
    "9" * 30,
)
COUNT = int(os.environ.get("EXTREMES", "150"))


def spoiled_table(generator: random.Random) -> tuple[bytes, dict]:
    """A CSV file with cells, bytes, separators, encodings and settings changed at random."""
    rows = [line.split(",") for line in TABLE.splitlines()]
    for _ in range(generator.choice((0, 0, 1, 1, 2))):
        generator.choice(rows)[generator.randrange(5)] = generator.choice(CELLS)
    separator, end = generator.choice(",,,;\t| "), generator.choice(("\n", "\n", "\r\n", "\r"))
    text = end.join(separator.join(row) for row in rows)
    encoding = generator.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1", "utf-32", "cp037"))
    content = text.encode(encoding, "replace")
    if generator.random() < 0.2:
        place = generator.randrange(len(content) + 1)
        content = content[:place] + generator.randbytes(3) + content[place + generator.randint(0, 4) :]
    columns = dict(COLUMNS)
    if generator.random() < 0.2:
        columns[generator.choice((*KINDS, *COLUMNS))] = generator.choice(NAMES)
    chosen = {name: generator.choice(some) for name, some in SETTINGS_AT_RANDOM.items() if generator.random() < 0.15}
    return content, chosen | {"columns": columns}


def spoiled_quakeml(text: str, generator: random.Random) -> str:
    """A QuakeML file with values changed, elements left out, cut off, or a character replaced."""
    for _ in range(generator.randint(1, 3)):
        value = generator.choice(list(re.finditer(r">([^<>]+)<", text)))
        element = generator.choice(list(re.finditer(r"<([\w:]+)[^<>]*>[^<>]*</\1>", text)))
        place = generator.randrange(len(text))
        text = generator.choice(
            [
                text[: value.start(1)] + generator.choice(VALUES) + text[value.end(1) :],
                text[: value.start(1)] + generator.choice(VALUES) + text[value.end(1) :],
                text[: element.start()] + text[element.end() :],
                text[:place] + generator.choice('<>&"x0') + text[place + 1 :],
            ]
        )
        if generator.random() < 0.05:
            return text[:place]
    return text


def read_or_line(settings: dict) -> bool:
    """Whether the record is read; if it is, its numbers are sound."""
    line = ""
    try:
        record = read_record(SETTINGS | settings)
    except InputError as error:
        line = str(error)
    if line:
        assert len(line) < 600
        return False
    assert np.isfinite(record["location"]).all()
    assert (record["potency"] > 0).all()
    assert (np.abs(record["mw"]) <= 12).all()
    assert not np.isnat(record["time"]).any()
    return True


@pytest.mark.filterwarnings("error")
def test_spoiled_tables(tmp_path):
    generator = random.Random(17)
    read = []
    for _ in range(COUNT):
        content, settings = spoiled_table(generator)
        (tmp_path / "record.csv").write_bytes(content)
        read.append(read_or_line(settings | {"reader": "csv", "file": str(tmp_path / "record.csv")}))
    assert any(read)
    assert not all(read)


def test_spoiled_quakeml(tmp_path):
    """Our own, and the same as another program would write it."""
    generator = random.Random(17)
    write_quakeml(made_up_catalog(3), tmp_path / "own.xml")
    own = (tmp_path / "own.xml").read_text()
    foreign = re.sub(r"<mine:\w+(/>|>[^<]*</mine:\w+>)", "", own)
    read = []
    for _ in range(COUNT // 3):
        (tmp_path / "record.xml").write_text(spoiled_quakeml(generator.choice((own, foreign)), generator))
        domain = {"domain": DOMAIN} if generator.random() < 0.5 else {}
        read.append(read_or_line(domain | {"reader": "quakeml", "file": str(tmp_path / "record.xml")}))
    assert any(read)
    assert not all(read)
