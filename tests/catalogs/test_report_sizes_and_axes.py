"""The sections of sizes and axes: numbers with intervals, and what they are compared with."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from step_fixtures import events_of

from catalogs.figures import style
from catalogs.report.sections import sizes
from catalogs.report.sections.axes import insitu_axes, iso_share
from catalogs.report.text import between, hundredths, number
from catalogs.settings import InsituStress
from common.datasets import read_dataset


def test_match_is_given_in_numbers_with_intervals(page, mine):
    """Ratio of potencies, difference of b, centroid distance, angle of P axes: each in its section."""
    comparison = read_dataset(mine.comparison)
    angle, interval = comparison["mean_angle"].values[0], comparison["mean_angle_interval"].values[0]
    ratio, distance = comparison["potency_ratio"], comparison["centroid_distance"]
    b_difference, b_interval = float(comparison["b_difference"]), comparison["b_difference_interval"].values
    expected = (
        ("sizes", number(ratio), between(comparison["potency_ratio_interval"].values)),
        ("sizes", hundredths(b_difference), between(b_interval, hundredths)),
        ("events", f"{number(distance)} m", between(comparison["centroid_distance_interval"].values)),
        ("axes", f"{number(angle)}°", between(interval)),
    )
    for section, value, text in expected:
        assert re.search(rf"{re.escape(value)}\s*{re.escape(text)}", page.sections[section]), (section, value)


@pytest.mark.parametrize(("p_value", "told"), [(0.25, " (p = 0.25 if"), (1e-5, " (p < 0.001 if"), (np.nan, "")])
def test_a_ratio_without_a_test_has_no_p_value(p_value, told):
    """No event on either side: "p < 0.001" stood there."""
    comparison = xr.Dataset(
        {
            "model_runs": ((), 1),
            "event_ratio": ((), np.nan),
            "event_ratio_p_value": ((), p_value),
            "event_ratio_interval": ("interval", [np.nan, np.nan]),
        }
    )
    name, _, _ = sizes._ratio(comparison, "event_ratio", "many")
    assert name == "modelled over recorded" + (f"{told} both expect as many)" if told else "")


def test_panels_of_sizes_hold_the_counts_of_both():
    """The second catalogue has a hundred times the events of the first."""
    generator, catalogs = np.random.default_rng(0), []
    for count in (40, 4000):
        size = generator.exponential(0.5, count)
        catalogs.append(sizes.Sizes("", "k", size, 0.9, (0.8, 1.0), np.log10(count), 0.0, np.zeros((3, 0))))
    with style.applied():
        figure = sizes.potency_frequency(catalogs)
    for axes, count in zip(figure.axes, (40, 4000), strict=True):
        low, high = axes.get_ylim()
        assert low <= 1.0
        assert count <= high


def test_isotropic_share_is_said_to_be_an_input():
    """At 10 degrees N = 1.420277: 0.420277 / 4.260831 = 9.86 %, and 0.420277 / 3.840554 = 10.9 %. The angle of the drop
    is the residual one; fill that does not fail has none."""
    rock = {"model": "coulomb", "dilation_angle": {"intact": "3 deg", "residual": "10 deg"}}
    materials = {"ore": rock | {"dilation_angle": {"intact": "10 deg", "residual": "0 deg"}}, "host": rock}
    said = iso_share(SimpleNamespace(config={"materials": materials | {"fill": {"model": "elastic"}}}))
    assert "an input: 9.9 to 11 % in a cell of host (10°), 0 % in a cell of ore (0°)." in said
    planes = rock | {"planes": {"dilation_angle": {"intact": "9 deg", "residual": "5 deg"}}}
    said_of_planes = iso_share(SimpleNamespace(config={"materials": {"host": planes}}))
    assert "host (10°), 5.3 % in slip on the planes of host (5°)." in said_of_planes
    assert "is no evidence for the model" in said
    assert "in mines (McGarr 1992)." in said
    assert iso_share(SimpleNamespace(config={"materials": {"fill": {"model": "elastic"}}})) == ""
    assert iso_share(SimpleNamespace(config={})) == ""


def test_insitu_axes_are_those_at_the_depth_of_the_events():
    """East most compressed at the surface, north 50 m below it; potency decides where between events that is."""
    stress = InsituStress(constant=(-3.0, -1.0, -2.0, 0, 0, 0), gradient=(0, -0.1, 0, 0, 0, 0), surface=100.0)
    catalog = events_of([1e-9, 1.0])
    catalog["location"].values[:, 2] = [100.0, 50.0]
    axes = insitu_axes(SimpleNamespace(insitu=stress, resolved=catalog))
    np.testing.assert_allclose(np.abs(axes), [[0, 1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-9)
    shallow = insitu_axes(SimpleNamespace(insitu=stress, resolved=catalog.isel(event=[0])))
    np.testing.assert_allclose(np.abs(shallow), [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-9)
    assert insitu_axes(SimpleNamespace(insitu=None, resolved=catalog)) is None
