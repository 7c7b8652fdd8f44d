"""Events as points for ParaView, and back."""

from xml.etree import ElementTree

import meshio
import numpy as np
from catalog_fixtures import made_up_catalog

from catalogs.sources.events_vtk import write_points

PARAVIEW = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]  # XX, YY, ZZ, XY, YZ, XZ: its names of six components


def test_events_are_points_with_units_in_their_names(tmp_path):
    """Place, sizes, axes and times as the catalogue has them; steps numbered in their order."""
    catalog = made_up_catalog(40, shift=(1e6, 5e6, 0))
    catalog["step"][:10] = "2019-07"
    write_points(catalog, tmp_path / "events.vtu")
    mesh = meshio.read(tmp_path / "events.vtu")
    np.testing.assert_array_equal(mesh.points, catalog["location"].values)
    np.testing.assert_array_equal(mesh.cells_dict["vertex"].ravel(), np.arange(40))
    data = mesh.point_data
    np.testing.assert_array_equal(data["potency_m3"], catalog["potency"].values)
    np.testing.assert_allclose(10 ** data["log10_potency"], catalog["potency"].values)
    np.testing.assert_array_equal(data["p_axis"], catalog["p_axis"].values)
    tensor = catalog["potency_tensor"].values
    np.testing.assert_array_equal(data["potency_tensor_m3"], np.stack([tensor[:, i, j] for i, j in PARAVIEW], axis=1))
    first = np.datetime64("1970-01-01") + np.timedelta64(round(data["time_days_since_1970"][0] * 86400), "s")
    assert abs(first - catalog["time"].values[0]) < np.timedelta64(1, "s")
    np.testing.assert_array_equal(data["step"], [0] * 10 + [1] * 30)


def test_what_is_not_known_and_a_catalogue_without_events(tmp_path):
    """NaN for a time or an axis that a record lacks, -1 for its step; no event is no point, not an error."""
    catalog = made_up_catalog(2)
    catalog["time"][0], catalog["step"][:] = np.datetime64("NaT", "ns"), ""
    catalog["p_axis"][1] = np.nan
    write_points(catalog, tmp_path / "events.vtu")
    data = meshio.read(tmp_path / "events.vtu").point_data
    np.testing.assert_array_equal(np.isnan(data["time_days_since_1970"]), [True, False])
    assert np.isnan(data["p_axis"][1]).all()
    np.testing.assert_array_equal(data["step"], [-1, -1])
    write_points(made_up_catalog(0), tmp_path / "none.vtu")
    piece = ElementTree.parse(tmp_path / "none.vtu").find(".//Piece")  # VTK reads it, meshio does not
    assert (piece.get("NumberOfPoints"), piece.get("NumberOfCells")) == ("0", "0")
