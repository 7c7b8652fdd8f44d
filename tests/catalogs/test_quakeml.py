import io
import json
import re

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import FRAME, LAME, SETTINGS, SHEAR, made_up_catalog
from obspy import UTCDateTime, read_events
from obspy.core.event import ConfidenceEllipsoid, Magnitude, OriginUncertainty, QuantityError
from obspy.imaging.beachball import MomentTensor, aux_plane, mt2plane
from obspy.io.quakeml.core import _validate
from pyproj import CRS
from scipy.stats import chi2, norm

from catalogs.compare.locations import location_errors
from catalogs.records import read_record
from catalogs.records.quakeml_events import location_uncertainty, own_catalog
from catalogs.sources.geographic_frame import MineFrame
from catalogs.sources.mechanisms import axis_from_trend_plunge
from catalogs.sources.quakeml import write_quakeml
from catalogs.sources.sizes import estimate_b
from common.errors import InputError
from common.event_table import NAMES, new_catalog, write_events
from common.event_table import read_events as read_table
from common.source_tensors import moment_from_potency


@pytest.fixture
def catalog() -> xr.Dataset:
    """Thirty events with nanoseconds, one without a tensor, awkward names and attributes."""
    catalog = made_up_catalog(30)
    for name in ("potency_tensor", "moment_tensor", "p_axis", "b_axis", "t_axis", "iso", "clvd", "dc"):
        catalog[name][3] = np.nan
    catalog["step"][7] = "a <b> & 'c'"
    catalog.attrs |= {"note": "stress < strength & rising", "seismic_fraction": 0.1, "truncated": 1}
    return catalog


def test_written_and_read_back_is_identical_bit_for_bit(catalog, tmp_path):
    write_quakeml(catalog, tmp_path / "catalog.xml")
    again = own_catalog(read_events(tmp_path / "catalog.xml"))
    xr.testing.assert_identical(again, catalog)
    for name in NAMES:
        if catalog[name].dtype.kind != "O":
            assert again[name].values.tobytes() == catalog[name].values.tobytes(), name


def test_netcdf_gives_the_same_catalogue_back(catalog, tmp_path):
    catalog["time_lower_uncertainty"][1:], catalog["time_upper_uncertainty"][1:] = 5.0, 6.0
    write_events(catalog, tmp_path / "catalog.nc")
    xr.testing.assert_identical(read_table(tmp_path / "catalog.nc"), catalog)


def test_two_runs_write_the_same_bytes_and_no_random_identifier(catalog, tmp_path):
    for name in ("one.xml", "two.xml"):
        write_quakeml(catalog, tmp_path / name)
    text = (tmp_path / "one.xml").read_bytes()
    assert text == (tmp_path / "two.xml").read_bytes()
    assert b"creationTime" not in text
    identifiers = {event.resource_id.id for event in read_events(io.BytesIO(text))}
    assert identifiers == {f"smi:local/demo/synthetic/event/{number:06d}" for number in range(1, 31)}


def test_obspy_accepts_the_file_and_reads_what_any_reader_should(catalog, tmp_path):
    write_quakeml(catalog, tmp_path / "catalog.xml")
    assert _validate(str(tmp_path / "catalog.xml"))
    event = read_events(str(tmp_path / "catalog.xml"))[0]
    assert event.preferred_origin().depth == -catalog["location"].values[0, 2]
    assert event.preferred_magnitude().magnitude_type == "Mw"
    potency = catalog["potency_tensor"].values[0]
    tensor = event.preferred_focal_mechanism().moment_tensor.tensor
    volume_part = LAME * np.trace(potency)
    assert tensor.m_rr == pytest.approx(volume_part + 2 * SHEAR * potency[2, 2])  # up is z
    assert tensor.m_pp == pytest.approx(volume_part + 2 * SHEAR * potency[0, 0])  # east is x
    assert tensor.m_rt == pytest.approx(-2 * SHEAR * potency[1, 2])  # south is -y
    assert tensor.m_rp == pytest.approx(2 * SHEAR * potency[0, 2])
    assert tensor.m_tp == pytest.approx(-2 * SHEAR * potency[0, 1])


def test_shares_are_those_of_the_moment_tensor_beside_them(tmp_path):
    """A crack that opens, lambda = mu: potency diag(1, 0, 0), moment diag(3, 1, 1): tr / 3 = 5/3, CLVD 4/3, no shear.
    A closing one has the same sizes: QuakeML's shares have no sign."""
    catalog = made_up_catalog(2)
    catalog["potency_tensor"][0], catalog["potency_tensor"][1] = np.diag([1.0, 0, 0]), np.diag([-1.0, 0, 0])
    catalog["moment_tensor"].values[:] = moment_from_potency(catalog["potency_tensor"].values, 1e10, 1e10)
    write_quakeml(catalog, tmp_path / "catalog.xml")
    for event in read_events(str(tmp_path / "catalog.xml")):
        tensor = event.preferred_focal_mechanism().moment_tensor
        shares = tensor.iso, tensor.clvd, tensor.double_couple
        np.testing.assert_allclose(shares, [5 / 9, 4 / 9, 0.0], atol=1e-12)


@pytest.mark.parametrize(("kind", "says"), [("synthetic", True), ("twin", True), ("recorded", False)])
def test_every_event_says_whether_it_is_synthetic_and_none_is_called_damage(tmp_path, kind, says):
    """ "rock burst" is damage at an opening: an event of Mw -1 of a model was called so, and nothing said synthetic."""
    write_quakeml(made_up_catalog(3).assign_attrs(kind=kind), tmp_path / "catalog.xml")
    catalog = read_events(str(tmp_path / "catalog.xml"))
    for what, text in [
        (catalog, catalog.description),
        *((event, "".join(one.text for one in event.event_descriptions)) for event in catalog),
    ]:
        assert what.creation_info.agency_id == kind
        assert ("Synthetic event of a numerical model of mine demo, not recorded" in (text or "")) == says
    assert {event.event_type for event in catalog} == {"induced or triggered event"}


def test_unresolved_events_stay_out_of_the_file_and_a_clients_b_is_ours(tmp_path):
    """Events below what the cells resolve are many and small: with them a client's b would be another."""
    catalog = made_up_catalog(400, b=0.7)
    catalog["resolved"].values[:] = catalog["potency"].values >= 3e-3
    write_quakeml(catalog, tmp_path / "catalog.xml")
    events = read_events(str(tmp_path / "catalog.xml"))
    rows = np.flatnonzero(catalog["resolved"].values)
    assert [event.resource_id.id for event in events] == [
        f"smi:local/demo/synthetic/event/{row + 1:06d}" for row in rows
    ]
    assert f"{400 - len(rows)} unresolved events of 400 are left out" in events.description
    floor = catalog.attrs["potency_floor"]
    (comment,) = events.comments
    assert f"potency of {floor:.3g} m3 on (log P {np.log10(floor):.2f})" in comment.text
    mw = np.array([event.preferred_magnitude().mag for event in events])
    own = catalog["potency"].values[rows]
    of_client = np.log10(np.e) / (mw - mw.min()).mean()  # Aki (1965)
    assert of_client == pytest.approx(
        np.log10(np.e) / (catalog["mw"].values[rows] - catalog["mw"].values[rows].min()).mean()
    )
    ours = estimate_b(np.log10(own), np.log10(own.min()))
    assert of_client == pytest.approx(1.5 * ours.b, rel=0.05)
    xr.testing.assert_identical(own_catalog(read_events(tmp_path / "catalog.xml")), catalog.isel(event=rows))


def test_unresolved_events_need_no_place(tmp_path):
    catalog = made_up_catalog(3)
    catalog["resolved"][0], catalog["location"][0] = 0, np.nan
    write_quakeml(catalog, tmp_path / "catalog.xml")
    assert len(read_events(str(tmp_path / "catalog.xml"))) == 2


def test_times_and_their_uncertainty_stay_within_the_step(tmp_path):
    """They reached up to half a step beyond it, for all events but the middle one."""
    catalog = made_up_catalog(40)
    start, end = np.datetime64("2019-07-20", "ns"), np.datetime64("2019-10-05T12:00:00", "ns")
    catalog["time"] = catalog["time"].astype("datetime64[us]").astype("datetime64[ns]")
    catalog["time_lower_uncertainty"] = (
        "event",
        (catalog["time"].values - start) / np.timedelta64(1, "s"),
        {"units": "s"},
    )
    catalog["time_upper_uncertainty"] = (
        "event",
        (end - catalog["time"].values) / np.timedelta64(1, "s"),
        {"units": "s"},
    )
    write_quakeml(catalog, tmp_path / "catalog.xml")
    for event in read_events(str(tmp_path / "catalog.xml")):
        origin = event.preferred_origin()
        assert origin.time_errors.uncertainty is None
        assert origin.time - origin.time_errors.lower_uncertainty == UTCDateTime("2019-07-20")
        assert origin.time + origin.time_errors.upper_uncertainty == UTCDateTime("2019-10-05T12:00:00")


def test_nodal_planes_and_axes_stand_beside_the_tensor_and_agree_with_obspys_own(tmp_path):
    """ObsPy finds planes from the tensor by other code (mt2plane, aux_plane). And the double couple of each plane,
    by Aki and Richards (2002, box 4.4), has the file's P and T axes."""
    catalog = made_up_catalog(200)
    write_quakeml(catalog, tmp_path / "catalog.xml")
    events = read_events(str(tmp_path / "catalog.xml"))
    clear = np.isfinite(catalog["p_axis"].values).all(axis=1) & np.isfinite(catalog["t_axis"].values).all(axis=1)
    assert clear.sum() > 100
    for event, wanted in zip(events, clear, strict=True):
        mechanism = event.preferred_focal_mechanism()
        if not wanted:
            assert mechanism.nodal_planes is None
            continue
        tensor = mechanism.moment_tensor.tensor
        keys = ("m_rr", "m_tt", "m_pp", "m_rt", "m_rp", "m_tp")
        first = mt2plane(MomentTensor(*(getattr(tensor, key) / 1e8 for key in keys), 0))
        theirs = [double_couple(first.strike, first.dip, first.rake)]
        theirs.append(double_couple(*aux_plane(first.strike, first.dip, first.rake)))
        planes = [mechanism.nodal_planes.nodal_plane_1, mechanism.nodal_planes.nodal_plane_2]
        assert planes[0].strike != planes[1].strike
        for plane in planes:
            assert 0 <= plane.strike < 360
            assert 0 <= plane.dip <= 90
            ours = double_couple(plane.strike, plane.dip, plane.rake)
            np.testing.assert_allclose(ours, theirs[0], atol=1e-5)
            np.testing.assert_allclose(ours, theirs[1], atol=1e-5)
            p, _, t = np.linalg.eigh(ours)[1].T
            for axis, vector in ((mechanism.principal_axes.p_axis, p), (mechanism.principal_axes.t_axis, t)):
                given = axis_from_trend_plunge(axis.azimuth, axis.plunge)
                assert abs(given @ vector) == pytest.approx(1.0, abs=1e-9)


def double_couple(strike, dip, rake):
    """Unit double couple of a fault, east north up: Aki and Richards (2002), box 4.4, which has north east down."""
    s, d, r = np.radians([strike, dip, rake])
    xx = -(np.sin(d) * np.cos(r) * np.sin(2 * s) + np.sin(2 * d) * np.sin(r) * np.sin(s) ** 2)
    xy = np.sin(d) * np.cos(r) * np.cos(2 * s) + 0.5 * np.sin(2 * d) * np.sin(r) * np.sin(2 * s)
    xz = -(np.cos(d) * np.cos(r) * np.cos(s) + np.cos(2 * d) * np.sin(r) * np.sin(s))
    yy = np.sin(d) * np.cos(r) * np.sin(2 * s) - np.sin(2 * d) * np.sin(r) * np.cos(s) ** 2
    yz = -(np.cos(d) * np.cos(r) * np.sin(s) - np.cos(2 * d) * np.sin(r) * np.cos(s))
    zz = np.sin(2 * d) * np.sin(r)
    return np.array([[yy, xy, -yz], [xy, xx, -xz], [-yz, -xz, zz]])


def test_an_empty_catalogue_is_still_a_valid_file(catalog, tmp_path):
    write_quakeml(catalog.isel(event=[]), tmp_path / "catalog.xml")
    xr.testing.assert_identical(own_catalog(read_events(tmp_path / "catalog.xml")), catalog.isel(event=[]))


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


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda catalog: catalog.attrs.pop("frame"), "frame"),
        (lambda catalog: catalog["time"].values.__setitem__(0, np.datetime64("NaT")), "without time or location"),
        (lambda catalog: catalog["location"].values.__setitem__((2, 1), np.nan), "without time or location"),
    ],
)
def test_what_quakeml_cannot_hold_is_refused(catalog, tmp_path, spoil, message):
    spoil(catalog)
    with pytest.raises(InputError, match=message):
        write_quakeml(catalog, tmp_path / "catalog.xml")
    assert list(tmp_path.iterdir()) == []


def test_frame_north_is_111_km_per_degree_and_goes_there_and_back():
    """One degree of latitude at 41.8 S is 111,066 m on WGS 84 (meridian radius 6,363,700 m)."""
    frame = MineFrame(FRAME)
    location = np.array([[0, 0, 950], [0, 1110.66, -30], [500, 0, 0]])
    latitude, longitude, depth = frame.to_globe(location)
    np.testing.assert_allclose(latitude[:2], [-41.8, -41.79], atol=1e-6)
    assert longitude[2] > 145.4
    np.testing.assert_array_equal(depth, [-950, 30, 0])
    np.testing.assert_allclose(frame.to_map(latitude, longitude, depth), location, atol=1e-6)


def test_frame_from_a_projected_system():
    for crs in (32755, "EPSG:32755", CRS.from_epsg(32755).to_wkt()):
        latitude, longitude, _ = MineFrame({"crs": crs, "surface": 0.0}).to_globe([[500_000.0, 5_372_000.0, 0.0]])
        assert longitude[0] == pytest.approx(147.0)
        assert latitude[0] == pytest.approx(-41.8, abs=0.02)


@pytest.mark.parametrize(
    ("crs", "longitude", "latitude"),
    [
        (32755, 147.0, -41.8),
        (2193, 174.0, -41.0),  # lists the northing first
        ("EPSG:2193+7839", 174.0, -41.0),
        ("+proj=tmerc +lon_0=174 +axis=neu +type=crs", 174.0, -41.0),
        (2053, 29.0, -26.0),  # west and south
        (5513, 15.0, 49.8),  # south and west
        ("+proj=tmerc +lon_0=29 +axis=wsu +datum=WGS84 +units=m +type=crs", 29.0, -26.0),
    ],
)
def test_x_is_east_and_y_north_wherever_the_axes_of_a_system_run(crs, longitude, latitude):
    """1 km along x leads east, 1 km along y north, but for the convergence of meridians."""
    frame = MineFrame({"crs": crs})
    origin = frame.to_map(np.array([latitude]), np.array([longitude]), np.zeros(1))
    north, east, _ = frame.to_globe(origin + np.array([[0, 0, 0], [1000, 0, 0], [0, 1000, 0]]))
    assert east[1] - east[0] > 0.009 > 0.002 > abs(north[1] - north[0])
    assert north[2] - north[0] > 0.008 > 0.002 > abs(east[2] - east[0])


@pytest.mark.parametrize(
    ("crs", "axes"),
    [(3413, "south and south"), (3031, "north and north")],  # polar: each axis follows a meridian
)
def test_a_system_whose_axes_follow_no_direction_of_the_compass_is_refused(crs, axes):
    with pytest.raises(InputError, match=rf"frame\.crs: .*: its axes run {axes}, not along a map") as error:
        MineFrame({"crs": crs})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        ({}, "give either"),
        ({"latitude": 1.0}, "give either"),
        ({"latitude": 1.0, "longitude": 2.0, "crs": 32755}, "give either"),
        ({"latitude": 91.0, "longitude": 2.0}, "degrees"),
        ({"crs": "nonsense"}, "neither an EPSG code nor WKT"),
        ({"crs": 4326}, "expected a projected system, not a geographic"),
    ],
)
def test_bad_frames_are_named(frame, message):
    with pytest.raises(InputError, match=message):
        MineFrame(frame)


def test_what_is_no_catalogue_is_refused():
    attributes = {"mine": "demo", "kind": "recorded"}
    with pytest.raises(InputError, match="magnitude is unknown"):
        new_catalog(1, attributes, magnitude=[1.0])
    with pytest.raises(InputError, match="shape"):
        new_catalog(2, attributes, potency=[1.0])
    with pytest.raises(InputError, match="kind"):
        new_catalog(1, {"mine": "demo", "kind": "guess"})
