"""What of a record is seismicity: the words of QuakeML and of mines' systems, left out, kept or asked about."""

import gzip
import json
import logging

import numpy as np
import pytest
from catalog_fixtures import SETTINGS
from csv_fixtures import COLUMNS, read
from elk_creek_fixtures import write_tiny_mine
from obspy.core.event.header import EventType

from catalogs.records import read_record
from catalogs.records.event_kinds import EVENT_TYPE, NOT_SEISMIC_WORDS, SEISMIC_WORDS, is_left_out
from catalogs.sources.quakeml import write_quakeml
from common.errors import InputError

QUAKEML = """<?xml version="1.0" encoding="utf-8"?>
<q:quakeml xmlns:q="http://quakeml.org/xmlns/quakeml/1.2" xmlns="http://quakeml.org/xmlns/bed/1.2">
<eventParameters publicID="smi:local/all">{events}</eventParameters></q:quakeml>
"""
EVENT = """<event publicID="smi:local/{name}">{preferred}{type}
{origins}{magnitudes}</event>"""
ORIGIN = """<origin publicID="smi:local/{name}/{number}"><time><value>2019-08-01T0{number}:00:00Z</value></time>
<latitude><value>-41.8</value></latitude><longitude><value>145.4</value></longitude>
<depth><value>{depth}</value></depth>{status}</origin>"""
MAGNITUDE = """<magnitude publicID="smi:local/{name}/m{number}"><mag><value>{value}</value></mag><type>{type}</type>
{status}</magnitude>"""
TABLE = "time,x,y,z,mw,kind,state\n"
SEISMICITY = ("earthquake", "induced or triggered event", "rock burst", "mine collapse", "fluid injection", None)
OTHERS = ("explosion", "quarry blast", "mining explosion", "not existing", "sonic boom", "acoustic noise")


def status(text: str | None) -> str:
    return "" if text is None else f"<evaluationStatus>{text}</evaluationStatus>"


def event(name: str, kind: str | None, origins=(("950", None),), magnitudes=((-0.5, "Mw", None),), preferred="") -> str:
    """One event of a QuakeML file: origins as (depth, status), magnitudes as (value, type, status)."""
    return EVENT.format(
        name=name, preferred=preferred, type="" if kind is None else f"<type>{kind}</type>",
        origins="".join(
            ORIGIN.format(name=name, number=number, depth=depth, status=status(state))
            for number, (depth, state) in enumerate(origins)
        ),
        magnitudes="".join(
            MAGNITUDE.format(name=name, number=number, value=value, type=which, status=status(state))
            for number, (value, which, state) in enumerate(magnitudes)
        ),
    )  # fmt: skip


def quakeml(folder, *events: str, change=lambda text: text, **others):
    path = folder / "record.xml"
    path.write_text(change(QUAKEML.format(events="".join(events))), encoding="utf-8")
    return read_record(SETTINGS | {"reader": "quakeml", "file": str(path)} | others)


def csv(folder, rows, columns=None, **others):
    lines = [f"2019-08-0{day},{day},2,3,-1,{kind},{state}" for day, (kind, state) in enumerate(rows, 1)]
    return read(folder, TABLE + "\n".join(lines) + "\n", COLUMNS | (columns or {}), **others)


def refused(reading, *arguments, **others) -> str:
    with pytest.raises(InputError) as caught:
        reading(*arguments, **others)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_every_type_of_quakeml_is_judged():
    """None is forgotten, none is in two minds; two hold blasts as well as what rock does by itself."""
    known = SEISMIC_WORDS[EVENT_TYPE] | NOT_SEISMIC_WORDS[EVENT_TYPE]
    assert set(EventType.keys()) - known == {"anthropogenic event", "other event"}
    for kind, words in SEISMIC_WORDS.items():
        assert not words & NOT_SEISMIC_WORDS[kind]
        assert not any(is_left_out(kind, word) for word in words)


@pytest.mark.parametrize("kind", OTHERS)
def test_what_is_no_seismicity_is_left_out_of_a_quakeml_record_and_counted(tmp_path, caplog, kind):
    """Six types of six counted as seismicity. On the terminal, in the file's attributes, and kept where asked."""
    events = [event(f"e{number}", one) for number, one in enumerate([*SEISMICITY, kind, kind])]
    with caplog.at_level(logging.WARNING):
        record = quakeml(tmp_path, *events)
    assert record.sizes["event"] == len(SEISMICITY)
    assert record.attrs["rows"] == len(SEISMICITY) + 2
    assert json.loads(record.attrs["dropped"]) == {f"of type {kind}": 2}
    assert f"left out: 2 of type {kind}; record.filter.keep counts what it names" in caplog.text
    kept = quakeml(tmp_path, *events, filter={"keep": kind})
    assert kept.sizes["event"] == len(SEISMICITY) + 2
    assert f"2 {kind}" in kept.attrs["types_text"]
    only = quakeml(tmp_path, *events, filter={"only": {"event_type": kind}})
    assert only.sizes["event"] == 2


@pytest.mark.parametrize("word", ["blast", "Quarry_Blast", "production blast", " Explosion ", "electrical noise"])
def test_a_word_that_is_not_quakemls_does_not_make_an_event_vanish(tmp_path, word):
    """ObsPy ignores an event whose type it does not know: neither counted nor told."""
    record = quakeml(tmp_path, event("a", "earthquake"), event("b", word))
    assert record.attrs["rows"] == 2
    assert json.loads(record.attrs["dropped"]) == {f"of type {' '.join(word.lower().replace('_', ' ').split())}": 1}


@pytest.mark.parametrize("word", ["anthropogenic event", "other event", "Sprengung"])
def test_a_type_that_says_neither_is_asked_about(tmp_path, word):
    """With the two keys that answer."""
    events = [event("a", "earthquake"), event("b", word)]
    line = refused(quakeml, tmp_path, *events)
    assert f"1 of 2 events are of type {word.lower()!r}" in line
    assert "record.filter.keep" in line
    assert quakeml(tmp_path, *events, filter={"keep": [word]}).sizes["event"] == 2
    assert quakeml(tmp_path, *events, filter={"without": {"event_type": word}}).sizes["event"] == 1
    assert quakeml(tmp_path, *events, filter={"only": {"event_type": "earthquake"}}).sizes["event"] == 1


def test_types_that_say_nothing_count_and_are_told(tmp_path):
    """`null` is what QuakeML 1.1 wrote, `not reported` what 1.2 made of it."""
    record = quakeml(tmp_path, event("a", "not reported"), event("b", "null"), event("c", None), event("d", "collapse"))
    assert record.attrs["types_text"] == "1 without a type, 1 collapse, 1 not reported, 1 null"


def test_rejected_origins_magnitudes_and_events_do_not_count(tmp_path):
    """The preferred origin decides, else one that is not rejected; a rejected magnitude is no size, and where rejected
    ones are kept it is one if there is no other."""
    preferred = "<preferredOriginID>smi:local/b/1</preferredOriginID>"
    events = [
        event("a", "earthquake", origins=(("950", "rejected"), ("940", "Confirmed"))),
        event("b", "earthquake", origins=(("950", "final"), ("940", "REJECTED")), preferred=preferred),
        event("c", "earthquake", origins=(("950", "rejected"),)),
        event("d", "earthquake", magnitudes=((2.0, "Mw", "rejected"), (1.0, "Mw", None))),
        event("e", "earthquake", magnitudes=((2.0, "Mw", "rejected"),)),
    ]
    record = quakeml(tmp_path, *events)
    assert json.loads(record.attrs["dropped"]) == {"rejected": 2, "without a size": 1}
    np.testing.assert_allclose(record["location"].values[:, 2], [-940, -950])
    np.testing.assert_allclose(record["mw"], [-0.5, 1.0])
    kept = quakeml(tmp_path, *events, filter={"keep": "rejected"})
    np.testing.assert_allclose(kept["mw"], [-0.5, -0.5, -0.5, 1.0, 2.0])


def test_filters_of_a_quakeml_record_ask_for_type_status_and_mode(tmp_path):
    """It was refused: a QuakeML file has no columns."""
    states = [("950", None), ("950", "final"), ("950", "preliminary")]
    events = [event(f"e{number}", "earthquake", origins=(one,)) for number, one in enumerate(states)]
    assert quakeml(tmp_path, *events, filter={"only": {"evaluation_status": ["Final"]}}).sizes["event"] == 1
    assert quakeml(tmp_path, *events, filter={"without": {"evaluation_status": "preliminary"}}).sizes["event"] == 2
    assert quakeml(tmp_path, *events, filter={"without": {"evaluation_mode": "manual"}}).sizes["event"] == 3
    line = refused(quakeml, tmp_path, *events, filter={"only": {"agency": "x"}})
    assert "record.filter.only.agency: no text of a QuakeML file; such are event_type, evaluation_status" in line


def test_a_csv_record_names_its_columns_of_type_and_status(tmp_path):
    """Left out and counted as of QuakeML; filters ask for them by the kind, or by the column's own name."""
    rows = [("earthquake", "manual"), ("Blast", "manual"), ("", ""), ("rockburst", "Rejected")]
    columns = {"event_type": "kind", "evaluation_status": "state"}
    record = csv(tmp_path, rows, columns)
    assert json.loads(record.attrs["dropped"]) == {"of type blast": 1, "rejected": 1}
    assert record["location"].values[:, 0].tolist() == [1, 3]
    for name in ("event_type", "kind"):
        asked = csv(tmp_path, rows, columns, filter={"only": {name: "Earthquake"}, "keep": ["rejected"]})
        assert asked["location"].values[:, 0].tolist() == [1]
    assert csv(tmp_path, rows, columns, filter={"keep": ["blast", "REJECTED"]}).sizes["event"] == 4


def test_a_csv_column_that_tells_of_blasts_is_not_overlooked(tmp_path):
    """Nobody named it: the line says which two keys answer."""
    rows = [("event", ""), ("blast", ""), ("blast", "")]
    line = refused(csv, tmp_path, rows)
    assert "column 'kind': 2 of 3 rows are 'blast'" in line
    assert "record.columns.event_type: kind" in line
    assert csv(tmp_path, rows, filter={"keep": ["blast"]}).sizes["event"] == 3
    assert csv(tmp_path, rows, filter={"without": {"kind": "Blast"}}).sizes["event"] == 1
    assert "record.columns.evaluation_status: state" in refused(csv, tmp_path, [("a", "rejected"), ("a", "final")])


def test_codes_of_a_mine_are_asked_about_once_and_then_mean_what_is_said(tmp_path):
    rows = [("E", ""), ("B", ""), ("E", "")]
    assert "1 of 3 events are of type 'B'" in refused(csv, tmp_path, rows, {"event_type": "kind"}, filter={"keep": "E"})
    said = {"keep": ["E"], "without": {"kind": "B"}}
    assert csv(tmp_path, rows, {"event_type": "kind"}, filter=said).sizes["event"] == 2


def test_the_texts_of_the_elk_creek_data_are_filters(tmp_path, monkeypatch):
    """By the columns' names in its files."""
    monkeypatch.delenv("ELK_CREEK_DATA", raising=False)
    write_tiny_mine(tmp_path)
    settings = {"mine": "elk_creek", "reader": "elk_creek", "file": str(tmp_path), "location_error": 10.0}
    dates = ["2010-09-01 00:00:00", "2010-09-01 16:00:00.250"]
    assert read_record(settings | {"filter": {"only": {"Date": dates}}}).sizes["event"] == 2
    with pytest.raises(InputError, match=r"record.filter.only.Tag: no such column; the file has Date"):
        read_record(settings | {"filter": {"only": {"Tag": "a"}}})


OTHER_FORMS = {  # as other programs write QuakeML
    "1.1, one namespace": lambda text: text.replace("q:quakeml", "quakeml").replace(
        'xmlns:q="http://quakeml.org/xmlns/quakeml/1.2" xmlns="http://quakeml.org/xmlns/bed/1.2"',
        'xmlns="http://quakeml.org/xmlns/quakeml/1.1"',
    ),
    "real time": lambda text: text.replace("xmlns/quakeml/1.2", "xmlns/quakeml-rt/1.2").replace("bed/", "bed-rt/"),
    "prefixes": lambda text: text.replace("xmlns=", "xmlns:bed=").replace("</", "</bed:").replace("<", "<bed:")
    .replace("<bed:/bed:", "</bed:").replace("bed:q:", "q:").replace("<bed:?", "<?"),
    "no namespace": lambda text: text.replace("q:quakeml", "quakeml").replace(
        ' xmlns:q="http://quakeml.org/xmlns/quakeml/1.2" xmlns="http://quakeml.org/xmlns/bed/1.2"', ""
    ),
    "byte order mark": lambda text: "\ufeff" + text,
}  # fmt: skip


@pytest.mark.parametrize("form", OTHER_FORMS)
def test_other_forms_of_quakeml_are_read(tmp_path, form):
    record = quakeml(tmp_path, event("a", "earthquake"), event("b", "quarry blast"), change=OTHER_FORMS[form])
    assert record.sizes["event"] == 1
    assert json.loads(record.attrs["dropped"]) == {"of type quarry blast": 1}


def test_an_event_that_is_there_twice_counts_once(tmp_path):
    """Downloads that overlap, put together in one file; without a name each is another event."""
    record = quakeml(tmp_path, event("a", "earthquake"), event("b", "earthquake"), event("a", "earthquake"))
    assert json.loads(record.attrs["dropped"]) == {"there twice": 1}
    nameless = [event(name, "earthquake").replace(f'<event publicID="smi:local/{name}">', "<event>") for name in "ab"]
    assert quakeml(tmp_path, *nameless).sizes["event"] == 2


def test_several_origins_and_magnitudes_without_a_preferred_one(tmp_path):
    """The first origin; the first moment magnitude, wherever it stands."""
    origins, magnitudes = (("950", None), ("940", None)), ((2.0, "ML", None), (0.5, "Mw", None), (0.7, "Mww", None))
    record = quakeml(tmp_path, event("a", "earthquake", origins, magnitudes))
    assert (float(record["location"][0, 2]), float(record["mw"][0])) == pytest.approx((-950, 0.5))
    dangling = "<preferredOriginID>smi:local/nowhere</preferredOriginID>"
    record = quakeml(tmp_path, event("a", "earthquake", origins, magnitudes, preferred=dangling))
    assert float(record["location"][0, 2]) == pytest.approx(-950)


MANUAL, AUTOMATIC = "<evaluationMode>manual</evaluationMode>", "<evaluationMode>automatic</evaluationMode>"
FIRST_WORSE = [  # evaluations of which the second counts
    (AUTOMATIC, MANUAL),
    (AUTOMATIC, ""),
    ("", MANUAL),
    (status("preliminary"), status("reviewed")),
    (status("preliminary"), status("confirmed")),
    (status("preliminary"), ""),
    ("", status("Final")),
    (AUTOMATIC + status("reviewed"), MANUAL + status("preliminary")),
    (MANUAL + status("preliminary"), MANUAL + status("reviewed")),
    (MANUAL + status("rejected"), AUTOMATIC),
    (status("rejected"), status("preliminary")),
]


def evaluated(name: str, states: tuple[str, str], preferred: str = "") -> str:
    """An event with two origins, 10 m apart, and two magnitudes, 1 and 2, evaluated so."""
    text = event(name, "earthquake", (("950", "A"), ("940", "B")), ((1.0, "Mw", "A"), (2.0, "Mw", "B")), preferred)
    for letter, state in zip("AB", states, strict=True):
        text = text.replace(status(letter), state)
    return text


@pytest.mark.parametrize("states", FIRST_WORSE)
def test_a_reviewed_origin_and_magnitude_count_before_automatic_ones(tmp_path, caplog, states):
    """Whichever stands first, unless one is preferred; the log says how many are not the first."""
    with caplog.at_level(logging.INFO):
        record = quakeml(tmp_path, evaluated("a", states), evaluated("b", states[::-1]))
    np.testing.assert_allclose(record["location"].values[:, 2], [-940, -950])
    np.testing.assert_allclose(record["mw"], [2.0, 1.0])
    assert "2 events have several origins and " in caplog.text
    assert "reviewed ones count before automatic ones; 1 origins are not the first of their event" in caplog.text
    if "rejected" not in states[0]:
        chosen = "<preferredOriginID>smi:local/a/0</preferredOriginID>"
        record = quakeml(tmp_path, evaluated("a", states, chosen))
        assert float(record["location"][0, 2]) == pytest.approx(-950)


def test_a_magnitude_without_an_evaluation_has_that_of_its_origin(tmp_path):
    def change(text: str) -> str:
        for letter, origin in zip("AB", "01", strict=True):
            text = text.replace(
                f"</type>\n{letter}</magnitude>", f"</type><originID>smi:local/a/{origin}</originID></magnitude>"
            )
        return text

    states = (AUTOMATIC, MANUAL)
    text = event("a", "earthquake", (("950", "A"), ("940", "B")), ((1.0, "Mw", "C"), (2.0, "Mw", "D")))
    for letter, state in zip("ABCD", (*states, "A", "B"), strict=True):
        text = text.replace(status(letter), state)
    record = quakeml(tmp_path, text, change=change)
    assert float(record["mw"][0]) == pytest.approx(2.0)


def test_a_reviewed_mechanism_counts_before_an_automatic_one(tmp_path):
    tensor = "".join(f"<M{axes}><value>{{{axes}}}</value></M{axes}>" for axes in ("rr", "tt", "pp", "rt", "rp", "tp"))

    def mechanism(number: int, size: float, state: str) -> str:
        values = dict.fromkeys(("rr", "rt", "rp", "tp"), 0.0) | {"tt": size, "pp": -size}
        return (
            f'<focalMechanism publicID="smi:local/f{number}"><momentTensor publicID="smi:local/t{number}">'
            f"<tensor>{tensor.format(**values)}</tensor></momentTensor>{state}</focalMechanism>"
        )

    both = mechanism(1, 1e9, AUTOMATIC) + mechanism(2, 4e9, MANUAL)
    record = quakeml(tmp_path, event("a", "earthquake").replace("</event>", f"{both}</event>"))
    assert float(record["moment"][0]) == pytest.approx(4e9)


def test_what_is_no_quakeml_is_one_line_that_says_what_it_is(tmp_path):
    line = refused(quakeml, tmp_path, change=lambda text: "#EventID|Time|Latitude\n1|2019|3\n")
    assert "a table, as FDSN's text is, is read by record.reader: csv" in line
    (tmp_path / "record.xml").write_bytes(gzip.compress(QUAKEML.encode()))
    packed = SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "record.xml")}
    assert "a gzip archive, not a QuakeML file; unpack it" in refused(read_record, packed)
    line = refused(quakeml, tmp_path, change=lambda text: "<seiscomp><a/></seiscomp>")
    assert "record.xml: not QuakeML 1.2, but <seiscomp>" in line


def test_depths_in_kilometres_are_read_where_a_key_says_so(tmp_path):
    """QuakeML has metres; files of others have kilometres."""
    in_km = [event("a", "earthquake", origins=(("0.95", None),))]
    np.testing.assert_allclose(quakeml(tmp_path, *in_km, units={"depth": "km"})["location"].values[:, 2], -950)
    assert "record.units.mw: QuakeML has its own unit" in refused(quakeml, tmp_path, *in_km, units={"mw": "m"})


def test_our_own_file_goes_the_same_way(tmp_path):
    """A type that was changed in it counts as what it then is."""
    from catalog_fixtures import made_up_catalog

    write_quakeml(made_up_catalog(5, kind="recorded"), tmp_path / "own.xml")
    text = (tmp_path / "own.xml").read_text().replace("induced or triggered event", "quarry blast", 2)
    (tmp_path / "own.xml").write_text(text)
    record = read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.xml")})
    assert json.loads(record.attrs["dropped"]) == {"of type quarry blast": 2}
