import json
import re

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import SETTINGS, awkward_catalog
from obspy import UTCDateTime, read_events
from obspy.core.event import ConfidenceEllipsoid, Magnitude, OriginUncertainty, QuantityError
from scipy.stats import chi2, norm

from catalogs.compare.locations import location_errors
from catalogs.records import read_record
from catalogs.records.quakeml_events import location_uncertainty
from catalogs.sources.quakeml import write_quakeml
from common.errors import InputError
from common.event_table import read_events as read_table
from common.event_table import write_events


@pytest.fixture
def catalog() -> xr.Dataset:
    return awkward_catalog()


def foreign(catalog, path, change=lambda number, event: None):
    """Our file as another program would write it, without tensors, each event changed."""
    write_quakeml(catalog, path)
    events = read_events(str(path))
    del events.extra
    for number, event in enumerate(events):
        del event.extra
        event.focal_mechanisms, event.preferred_focal_mechanism_id = [], None
        change(number, event)
    events.write(str(path), format="QUAKEML")
    return SETTINGS | {"reader": "quakeml", "file": str(path)}


def test_foreign_quakeml_is_read_through_latitude_longitude_depth_and_moment(catalog, tmp_path):
    """Our file without the mine namespace: locations to 1 mm, tensors to round-off, times to the microsecond."""
    write_quakeml(catalog, tmp_path / "own.xml")
    events = read_events(str(tmp_path / "own.xml"))
    del events.extra
    for event in events:
        del event.extra
    events.write(str(tmp_path / "foreign.xml"), format="QUAKEML")
    record = read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "foreign.xml")})
    assert record.attrs["kind"] == "recorded"
    np.testing.assert_allclose(record["location"], catalog["location"], atol=1e-3)
    np.testing.assert_allclose(record["potency_tensor"], catalog["potency_tensor"], rtol=1e-9, atol=1e-16)
    assert np.all(np.abs(record["time"].values - catalog["time"].values) <= np.timedelta64(1, "us"))
    with_tensor = np.arange(30) != 3
    np.testing.assert_allclose(record["potency"][with_tensor], catalog["potency"][with_tensor], rtol=1e-9)
    np.testing.assert_allclose(record["mw"], catalog["mw"], atol=1e-9)


def test_our_own_file_as_a_record_keeps_every_bit_and_takes_the_filter(catalog, tmp_path):
    write_quakeml(catalog, tmp_path / "own.xml")
    settings = SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.xml"), "twin": True}
    record = read_record(settings | {"filter": {"minimum_potency": 1e-2}})
    kept = catalog["potency"].values >= 1e-2
    assert record.attrs["kind"] == "twin"
    assert record["location"].values.tobytes() == catalog["location"].values[kept].tobytes()


def test_our_own_file_is_no_record_unless_it_is_said_to_be_a_twin(catalog, tmp_path):
    write_quakeml(catalog, tmp_path / "own.xml")
    settings = SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.xml")}
    with pytest.raises(InputError, match=r"own.xml: is synthetic, made by a model: say record.twin: true"):
        read_record(settings)
    write_quakeml(catalog.assign_attrs(kind="recorded"), tmp_path / "own.xml")
    assert read_record(settings).attrs["kind"] == "recorded"


def test_our_own_file_of_another_frame_is_refused(catalog, tmp_path):
    """Its x, y and z were taken as they are, a kilometre off in the frame of now."""
    write_quakeml(catalog, tmp_path / "own.xml")
    settings = SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.xml"), "twin": True}
    frame = json.loads(catalog.attrs["frame"])
    same = read_record(settings | {"frame": frame})
    np.testing.assert_array_equal(same["location"], catalog["location"])
    with pytest.raises(InputError, match=r"own.xml: has x, y and z in another frame, .* 1.11e\+03 m from where"):
        read_record(settings | {"frame": frame | {"latitude": frame["latitude"] + 0.01}})
    assert read_record(settings | {"frame": {"surface": "0 m"}}).sizes == same.sizes
    text, count = re.subn(r"(latitude[^0-9-]{1,20})-41\.8\b", r"\1-95", (tmp_path / "own.xml").read_text(), count=1)
    assert count == 1
    (tmp_path / "own.xml").write_text(text)
    with pytest.raises(InputError, match=r"own.xml: its frame is not what was written there"):
        read_record(settings)


def test_files_joined_into_one_keep_all_their_events(catalog, tmp_path):
    """ObsPy reads the first of several eventParameters; it was a traceback."""
    settings = foreign(catalog, tmp_path / "record.xml")
    one = read_record(settings)
    path = tmp_path / "record.xml"
    text = path.read_text()
    (start, end) = (
        re.search("<eventParameters", text).start(),
        text.index("</quakeml>") if "</quakeml>" in text else (text.index("</q:quakeml>")),
    )
    again = text[start:end].replace("smi:", "smi:again.").replace("quakeml:", "quakeml:again.")
    path.write_text(text[:end] + again + text[end:])
    assert read_record(settings).sizes["event"] == 2 * one.sizes["event"]
    write_quakeml(catalog, path)
    text = path.read_text()
    body = re.search(r"<eventParameters.*</eventParameters>", text, re.DOTALL)[0]
    path.write_text(text.replace(body, body + body))
    with pytest.raises(InputError, match=r"record.xml: joins catalogues that this project wrote"):
        read_record(settings | {"twin": True})


def test_a_foreign_file_states_the_error_of_each_event(catalog, tmp_path):
    """In degrees and metres, as a circle and a depth at a level, as an ellipsoid; one without depth has none. All are
    root mean square errors in 3-D, and the comparison takes the record's own where an event has none."""

    def state(number, event):
        origin = event.origins[0]
        origin.latitude_errors = origin.longitude_errors = origin.depth_errors = QuantityError()
        origin.origin_uncertainty = None
        if number == 0:
            east = 30.0 / (111_195 * np.cos(np.radians(origin.latitude)))
            origin.latitude_errors = QuantityError(uncertainty=20.0 / 111_195)
            origin.longitude_errors = QuantityError(uncertainty=east)
            origin.depth_errors = QuantityError(uncertainty=60.0)
        elif number == 1:
            circle = np.sqrt(chi2.ppf(0.9, 2)) * 10.0
            origin.origin_uncertainty = OriginUncertainty(horizontal_uncertainty=circle, confidence_level=90.0)
            origin.depth_errors = QuantityError(uncertainty=norm.ppf(0.95) * 10.0, confidence_level=90.0)
        elif number == 2:
            axes = np.sqrt(chi2.ppf(0.9, 3)) * np.array([20.0, 30.0, 60.0])
            names = ("semi_minor_axis_length", "semi_intermediate_axis_length", "semi_major_axis_length")
            turns = dict.fromkeys(("major_axis_plunge", "major_axis_azimuth", "major_axis_rotation"), 0.0)
            body = ConfidenceEllipsoid(**dict(zip(names, axes, strict=True)), **turns)
            origin.origin_uncertainty = OriginUncertainty(confidence_ellipsoid=body, confidence_level=90.0)
        elif number == 3:
            origin.origin_uncertainty = OriginUncertainty(horizontal_uncertainty=10.0)

    record = read_record(foreign(catalog, tmp_path / "foreign.xml", state) | {"location_error": 25.0})
    write_events(record, tmp_path / "record.nc")
    record = read_table(tmp_path / "record.nc")
    np.testing.assert_allclose(record["location_uncertainty"][:3], [70.0, np.sqrt(300.0), 70.0], rtol=1e-4)
    assert np.isnan(record["location_uncertainty"][3:]).all()
    np.testing.assert_allclose(location_errors(record)[[0, 3, 4]], [70.0, 25.0, 25.0], rtol=1e-4)


OWN_FAULTS = {  # what stands in the file, what is put there, what the line says
    "text": (r"<mine:location>[^<]*", "<mine:location>here and there", "event 1: mine:location: 'here and there'"),
    "short": (r"<mine:location>[^<]*", "<mine:location>1.0 2.0", "event 1: mine:location: '1.0 2.0'"),
    "missing": (r"<mine:potency>[^<]*</mine:potency>", "", "event 1: mine:potency is missing"),
    "no time": (r"<mine:time>[^<]*", "<mine:time>yesterday", "event 1: mine:time: 'yesterday'"),
    "a number too large": (r"<mine:particles>[^<]*", "<mine:particles>99999999999999", "event 1: mine:particles"),
    "attributes broken": (r"<mine:attributes>[^<]*", "<mine:attributes>{", "mine:attributes: not JSON"),
    "attributes of another kind": (r"<mine:attributes>[^<]*", "<mine:attributes>[1]", "mine:attributes: not a mapping"),
    "absurd": (r"<mine:mw>[^<]*", "<mine:mw>400.0", "event 1: Mw 400 is no event's size"),
    "cut off": (r"<mine:location>(.|\n)*", "<mine:loc", "not QuakeML 1.2"),
}


def test_the_location_error_of_our_own_file_is_what_another_reads(catalog, tmp_path):
    """Depth and horizontal shares of one root mean square distance; a depth in km has its uncertainty in km, too."""
    write_quakeml(catalog.assign_attrs(location_error=30.0), tmp_path / "own.xml")
    origin = read_events(tmp_path / "own.xml")[0].origins[0]
    assert location_uncertainty(origin) == pytest.approx(30.0, rel=1e-4)
    origin.depth_errors.uncertainty /= 1000.0
    assert location_uncertainty(origin, 1000.0) == pytest.approx(30.0, rel=1e-4)


@pytest.mark.parametrize("fault", OWN_FAULTS)
def test_our_own_file_spoiled_is_one_line(catalog, tmp_path, fault):
    """It was a traceback, or numbers of another event."""
    pattern, text, says = OWN_FAULTS[fault]
    write_quakeml(catalog, tmp_path / "own.xml")
    content, count = re.subn(pattern, text, (tmp_path / "own.xml").read_text(), count=1)
    assert count == 1
    (tmp_path / "own.xml").write_text(content)
    with pytest.raises(InputError) as error:
        read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.xml")})
    assert says in str(error.value)
    assert "own.xml" in str(error.value)


def test_foreign_times_keep_both_sides_of_their_uncertainty(catalog, tmp_path):
    """One number stands for both sides; of two, each for its own; none is not known."""

    def state(number, event):
        given = [{"uncertainty": 2.0}, {"lower_uncertainty": 3.0, "upper_uncertainty": 4.0}, {}]
        event.origins[0].time_errors = QuantityError(**given[min(number, 2)])

    record = read_record(foreign(catalog, tmp_path / "foreign.xml", state))
    np.testing.assert_array_equal(record["time_lower_uncertainty"][:3], [2.0, 3.0, np.nan])
    np.testing.assert_array_equal(record["time_upper_uncertainty"][:3], [2.0, 4.0, np.nan])


def test_foreign_magnitudes_are_refused_by_name_or_converted_as_stated(catalog, tmp_path):
    """Half of the events have ML alone, one of them a second magnitude in Mw, which then counts."""

    def local(number, event):
        if number % 2:
            event.magnitudes[0].magnitude_type = "ML"
        if number == 5:
            event.magnitudes.append(Magnitude(mag=0.25, magnitude_type="Mww"))

    settings = foreign(catalog, tmp_path / "foreign.xml", local)
    with pytest.raises(InputError, match=r"14 of 30 events are of type ML: only Mw is a moment"):
        read_record(settings)
    record = read_record(settings | {"conversions": {"ML": {"slope": 0.5, "offset": 0.1}}})
    expected = catalog["mw"].values.copy()
    expected[1::2] = 0.5 * expected[1::2] + 0.1
    expected[5] = 0.25
    np.testing.assert_allclose(record["mw"], expected, atol=1e-9)
    left_out = read_record(settings | {"conversions": {"ML": "none"}})
    np.testing.assert_allclose(left_out["mw"], np.delete(expected, [n for n in range(1, 30, 2) if n != 5]), atol=1e-9)
    assert json.loads(left_out.attrs["dropped"]) == {"without a size": 14}


def test_events_without_origin_depth_or_magnitude_are_left_out_and_counted(catalog, tmp_path):
    def spoil(number, event):
        if number == 0:
            event.origins, event.preferred_origin_id = [], None
        if number == 1:
            event.origins[0].depth = None
        if number == 2:
            event.magnitudes, event.preferred_magnitude_id = [], None

    record = read_record(foreign(catalog, tmp_path / "foreign.xml", spoil))
    assert record.sizes["event"] == 27
    assert json.loads(record.attrs["dropped"]) == {"without a time": 1, "without a place": 1, "without a size": 1}


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [("latitude", 95.0, "95 is no latitude"), ("time", UTCDateTime(2500, 1, 1), "years run from 1678 to 2261")],
)
def test_origins_that_are_nowhere_or_never_are_one_line(catalog, tmp_path, key, value, says):
    settings = foreign(catalog, tmp_path / "foreign.xml", lambda _, event: setattr(event.origins[0], key, value))
    with pytest.raises(InputError, match=says):
        read_record(settings)


def test_a_file_is_what_it_holds_not_what_it_is_called(catalog, tmp_path):
    """ObsPy unpacks whatever is called .zip."""
    write_quakeml(catalog, tmp_path / "own.zip")
    assert (
        read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "own.zip"), "twin": True}).sizes["event"]
        == 30
    )
    (tmp_path / "text.zip").write_text("no archive")
    with pytest.raises(InputError, match=r"text.zip: not QuakeML"):
        read_record(SETTINGS | {"reader": "quakeml", "file": str(tmp_path / "text.zip")})
