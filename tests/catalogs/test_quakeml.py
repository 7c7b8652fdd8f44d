import io

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import LAME, SHEAR, awkward_catalog, made_up_catalog
from obspy import UTCDateTime, read_events
from obspy.imaging.beachball import MomentTensor, aux_plane, mt2plane
from obspy.io.quakeml.core import _validate

from catalogs.records.quakeml_events import own_catalog
from catalogs.sources.mechanisms import axis_from_trend_plunge
from catalogs.sources.quakeml import write_quakeml
from catalogs.sources.sizes import estimate_b
from common.errors import InputError
from common.event_table import NAMES, write_events
from common.event_table import read_events as read_table
from common.source_tensors import moment_from_potency


@pytest.fixture
def catalog() -> xr.Dataset:
    return awkward_catalog()


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
