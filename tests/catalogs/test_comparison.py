import json
import re

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import made_up_catalog
from job_runs import run_job

from catalogs.compare.comparison import compare
from catalogs.compare.layout import FACE_FIELDS, FIELDS
from catalogs.compare.locations import compare_locations
from catalogs.compare.size_measures import SIZE_BIN_WIDTH
from catalogs.sources.completeness import SEARCH_BIN_WIDTH
from common.datasets import read_dataset, write_dataset
from common.errors import InputError

QUICK = {"resamplings": 199}
FACED = {
    "steps": [{"name": "2019-08", "start": "2019-08-01", "end": "2019-10-01"}],
    "face": [
        {"date": "2019-08-01", "ends": [[-100.0, -50.0], [-100.0, 50.0]]},
        {"date": "2019-10-01", "ends": [[0.0, -50.0], [0.0, 50.0]]},
    ],
}


def as_record(catalog: xr.Dataset, **attributes) -> xr.Dataset:
    record = catalog.copy(deep=True)
    record.attrs |= {"kind": "twin", "location_error": 0.0} | attributes
    record.attrs.pop("potency_floor", None)
    return record


def test_bins_are_as_wide_as_the_file_says_and_large_catalogues_are_thinned(monkeypatch):
    """Of the plots, and of the search for completeness; locations are compared by as many events as memory takes."""
    catalog, counts = made_up_catalog(300), []

    def counted(model, record, *rest, **settings):
        counts.extend([len(model), len(record)])
        return compare_locations(model, record, *rest, **settings)

    monkeypatch.setattr("catalogs.compare.place_and_axis_measures.MAX_EVENTS_COMPARED", 100)
    monkeypatch.setattr("catalogs.compare.place_and_axis_measures.compare_locations", counted)
    result = compare(catalog, as_record(catalog), QUICK)
    assert result.attrs["size_bin_width"] == SIZE_BIN_WIDTH
    np.testing.assert_allclose(np.diff(result["size_bin_lower"]), SIZE_BIN_WIDTH)
    np.testing.assert_allclose(np.diff(result["cut_log_potency"]), SEARCH_BIN_WIDTH)
    assert counts == [100, 100]


def test_a_catalogue_beside_itself_differs_in_nothing():
    catalog = made_up_catalog(300)
    result = compare(catalog, as_record(catalog), QUICK)
    assert result["potency_ratio"] == pytest.approx(1.0)
    np.testing.assert_allclose(result["centroid_offset"], 0.0, atol=1e-12)
    assert result["energy_distance"] < 1.0
    np.testing.assert_array_equal(result["nearest_distance"][:2], 0.0)
    assert result["b_difference"] == 0.0
    assert result["b_difference_p_value"] == pytest.approx(1.0)
    np.testing.assert_allclose(result["mean_angle"], 0.0, atol=1e-6)
    assert result["summed_kagan"] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(result["mean_trend"][:, 0] % 180, result["mean_trend"][0, 0] % 180)
    assert result.attrs["axes_present"] == 1


def test_axes_of_a_record_of_two_events_are_not_compared():
    """However alike they are: two blocks do not say how far their mean may be off."""
    catalog = made_up_catalog(300)
    record = as_record(catalog.isel(event=[0, 1]))
    result = compare(catalog, record, QUICK)
    assert result["events_with_axes"].values.tolist()[1] == 2
    assert result.attrs["axes_present"] == 0
    assert result["mean_angle"].isnull().all()
    assert result["mean_cone"].isnull().all()
    assert "3 are needed to estimate the error of their mean" in result.attrs["axes_text"]


PLACES_AND_AXES = (
    "mean_angle_p_value",
    "energy_distance_interval",
    "nearest_distance_interval",
    "cross_ratio_interval",
    "mean_angle_interval",
)
TESTED = ("energy_p_value", "centroid_offset_interval", "centroid_distance_interval", "shift_noticed",
          "mechanism_turn_interval", "mechanism_turn_p_value", "mechanism_turn_noticed")  # fmt: skip


@pytest.mark.parametrize("members", [0, 1, 2])
def test_a_model_that_ran_fewer_than_three_times_has_no_interval_of_places_and_axes(members):
    """One run does not say how another would differ: the tests of the first page take its events to be as clustered as
    the record's, other intervals and p-values are unknown, and both sentences say what gives them. Three runs do."""
    catalog = made_up_catalog(300)
    others = [made_up_catalog(300, seed=20 + k) for k in range(members)]
    result = compare(catalog, as_record(made_up_catalog(300, seed=3)), QUICK | {"members": members}, others)
    assert np.isfinite(result["energy_distance"])
    assert np.isfinite(result["mean_angle"]).all()
    for name in PLACES_AND_AXES:
        assert np.isfinite(result[name]).all() == (members == 2), name
    for name in TESTED:
        assert np.isfinite(result[name]).all(), name
    assert np.isfinite(result["mean_cone"].sel(catalogue="record")).all()
    for name in ("location_text", "axes_text"):
        asked = "Set ensemble to 2 or more, better to 8" in result.attrs[name]
        assert asked == (members < 2), result.attrs[name]


@pytest.mark.parametrize(("others", "have"), [(0, "only 1 has"), (1, "only 2 have"), (2, None)])
def test_an_ensemble_whose_runs_have_no_events_is_not_said_to_have_run_once(others, have):
    """Of nine runs one, two or three have events above the cut, the others small ones or none: the text asked for an
    ensemble of 8. All nine count in the mean tensor."""
    catalog, record = made_up_catalog(300), as_record(made_up_catalog(300, seed=3))
    small = made_up_catalog(50, seed=30)
    small["potency"] = small["potency"] * 1e-4
    members = [made_up_catalog(300, seed=20 + k) for k in range(others)]
    members += [small] * 4 + [small.isel(event=slice(0))] * (4 - others)
    result = compare(catalog, record, QUICK | {"members": 8}, members)
    runs = [run for run in (catalog, *members) if run.sizes["event"]]
    tensors = [run["potency_tensor"].values[run["potency"].values >= 10 ** float(result["cut"])] for run in runs]
    np.testing.assert_allclose(result["summed_tensor"][0], np.concatenate(tensors).sum(axis=0) / 9)
    assert np.isfinite(result["mean_angle_p_value"]).all() == (have is None)
    for name in ("location_text", "axes_text"):
        said = result.attrs[name]
        assert "Set ensemble" not in said
        if have is None:
            assert "Intervals come from resampling 3 runs" in said
        elif "cannot be compared" in said:
            assert have == "only 1 has"
            assert "two modelled events of two runs" in said
        else:
            assert f"of the model's 9 runs {have} events" in said


def test_runs_without_clear_axes_do_not_count_for_the_mean_axes():
    """Four runs, of which two have sources of one principal value only: no axis is clear."""
    catalog = made_up_catalog(300)
    members = [made_up_catalog(300, seed=20 + k) for k in range(3)]
    for member in members[1:]:
        member["potency_tensor"][:] = member["potency"].values[:, None, None] * np.eye(3)
    result = compare(catalog, as_record(made_up_catalog(300, seed=3)), QUICK | {"members": 3}, members)
    assert result["mean_angle_p_value"].isnull().all()
    assert "of the model's 4 runs only 2 have events with clear axes" in result.attrs["axes_text"]
    assert "The turn of the mean mechanism takes the model's events to be as" in result.attrs["axes_text"]
    assert np.isfinite(result["energy_p_value"])


def test_a_turn_that_is_not_known_is_not_said_to_be_tested():
    """No modelled source has a clear axis, so there is no mean mechanism."""
    catalog = made_up_catalog(300)
    catalog["potency_tensor"][:] = catalog["potency"].values[:, None, None] * np.eye(3)
    result = compare(catalog, as_record(made_up_catalog(300, seed=3)), QUICK)
    assert np.isnan(result["mechanism_turn"])
    assert ". Measures of axes have no interval and no p-value: the model ran once" in result.attrs["axes_text"]
    assert "turn of the mean mechanism" not in result.attrs["axes_text"]


def test_a_shifted_turned_steeper_copy_is_found_out():
    """Record moved 40 m east of the model, another 0.4 in b: each shows, with its sign, and the interval holds it."""
    catalog = made_up_catalog(400, seed=1, b=0.6)
    members = [made_up_catalog(400, seed=20 + k, b=0.6) for k in range(8)]
    record = as_record(made_up_catalog(500, seed=2, b=1.0, shift=(40, 0, 0)))
    result = compare(catalog, record, QUICK | {"members": 8}, members)
    low, high = result["centroid_offset_interval"].values[0]
    assert low < -40 < high < 0
    assert result["energy_p_value"] == pytest.approx(1 / 1000)
    low, high = result["b_difference_interval"].values
    assert low < -0.4 < high < 0
    assert result["b_difference_p_value"] < 0.01


@pytest.mark.parametrize(
    ("floor", "which", "cut"), [(10**-1.5, "model floor", -1.5), (1e-6, "record completeness", None)]
)
def test_the_larger_of_floor_and_completeness_cuts_both_and_is_named(floor, which, cut):
    catalog = made_up_catalog(400)
    catalog.attrs["potency_floor"] = floor
    result = compare(catalog, as_record(made_up_catalog(900, seed=3)), QUICK)
    assert result.attrs["cut_is"] == which
    assert which.split()[0] in result.attrs["cut_text"]
    expected = float(result["record_completeness"]) if cut is None else cut
    assert float(result["cut"]) == pytest.approx(expected)
    for name, events in (("model_used", catalog), ("record_used", made_up_catalog(900, seed=3))):
        np.testing.assert_array_equal(result[name] == 1, np.log10(events["potency"].values) >= float(result["cut"]))


def test_unresolved_events_count_in_the_sum_of_all_and_nowhere_else():
    """Giants far away, marked unresolved: without them every statistic is what it was."""
    catalog = made_up_catalog(200)
    spoiled = catalog.copy(deep=True)
    spoiled["resolved"][:] = np.where(np.arange(200) < 20, 0, 1)
    spoiled["location"][:20] = 1e6
    spoiled["potency"][:20] = 1e3
    clean = catalog.isel(event=slice(20, None))
    record = as_record(made_up_catalog(300, seed=4))
    one, other = compare(spoiled, record, QUICK), compare(clean, record, QUICK)
    for name in ("b", "centroid", "energy_distance", "mean_axis", "summed_tensor", "potency_ratio", "cumulative"):
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    assert one["events_total"].values.tolist() == [200, 300]
    assert one["events_resolved"].values.tolist() == [180, 300]
    assert one["summed_potency_all"][0] > 2e4


def test_a_record_without_tensors_has_no_axes_and_says_so():
    record = as_record(made_up_catalog(300, seed=5))
    record["potency_tensor"][:] = np.nan
    result = compare(made_up_catalog(200), record, QUICK)
    assert result.attrs["axes_present"] == 0
    assert "no tensors" in result.attrs["axes_text"]
    assert np.isnan(result["mean_axis"]).all()
    assert np.isfinite(result["b"]).all()


def test_orientations_of_their_own_restrict_the_model_to_their_time():
    """As in Elk Creek: sizes from one catalogue, orientations of August from another."""
    source = made_up_catalog(150, seed=6)
    record = as_record(made_up_catalog(300, seed=5))
    record["potency_tensor"][:] = np.nan
    norm = np.sqrt((source["potency_tensor"] ** 2).sum(("xyz", "axis")))
    record["orientation_time"] = ("orientation", source["time"].values)
    record["orientation_location"] = (("orientation", "xyz"), source["location"].values)
    record["orientation_tensor"] = (("orientation", "xyz", "axis"), (source["potency_tensor"] / norm).values)
    record.attrs["orientation_filter"] = json.dumps({"start": "2019-08-01", "end": "2019-09-01"})
    catalog = made_up_catalog(400, seed=7)
    result = compare(catalog, record, QUICK)
    assert result.attrs["summed_weight"] == "unit"
    august = catalog["time"].values < np.datetime64("2019-09-01")
    np.testing.assert_array_equal(result["model_axes_used"] == 1, august & (result["model_used"] == 1))
    assert np.all(result["mean_angle"] < 10)


def test_nothing_modelled_is_a_comparison_too():
    catalog = made_up_catalog(200)
    result = compare(catalog.isel(event=[]), as_record(catalog), QUICK)
    assert np.isnan(result["energy_distance"])
    assert "locations cannot be compared" in result.attrs["location_text"]
    assert "The model has 0" in result.attrs["location_text"]
    assert result["events_total"].values.tolist() == [0, 200]


@pytest.mark.parametrize(("tensors", "face"), [(True, False), (False, False), (True, True)])
def test_every_variable_has_its_unit_and_its_meaning(tensors, face, tmp_path):
    """Of the layout, in the file, coordinates too; and nothing of the layout is missing. A face adds its own."""
    record = as_record(made_up_catalog(200, seed=8))
    if not tensors:
        record["potency_tensor"][:] = np.nan
    settings = QUICK | (FACED if face else {})
    write_dataset(compare(made_up_catalog(200), record, settings), tmp_path / "comparison.nc")
    result = read_dataset(tmp_path / "comparison.nc")
    layout = {field.name: field for field in (*FIELDS, *(FACE_FIELDS if face else ()))}
    assert set(result.variables) == set(layout)
    for name, variable in result.variables.items():
        assert variable.dims == layout[name].dims, name
        assert len(variable.attrs["long_name"]) > 10, name
        assert variable.attrs.get("units", "") == layout[name].unit, name
    assert result["centroid_distance"].attrs["units"] == "m"
    assert result["summed_tensor"].attrs["units"] == "m3"
    assert result["mean_trend"].attrs["units"] == "degree"


@pytest.mark.parametrize("floor", [1e-3, np.nan])
def test_an_empty_record_is_compared_and_the_sentences_say_why_nothing_came_out(floor):
    """No event inside the domain in these months: every number NaN, no error, no 'nan' in a sentence."""
    catalog = made_up_catalog(200)
    catalog.attrs["potency_floor"] = floor
    result = compare(catalog, as_record(catalog.isel(event=[])), QUICK)
    both = compare(catalog.isel(event=[]), as_record(catalog.isel(event=[])), QUICK)
    assert result["events_total"].values.tolist() == [200, 0]
    assert np.isnan(result["potency_ratio"])
    for one in (result, both):
        said = " ".join(one.attrs[name] for name in ("cut_text", "size_text", "location_text", "axes_text"))
        assert "nan" not in said
        assert "The record has no b: it has 0 events, and 10 are needed" in said
    assert both.attrs["cut_is"] == ("model floor" if floor > 0 else "nothing")


def test_few_events_give_no_b_and_say_so():
    """'b = nan' was what the report printed."""
    record = as_record(made_up_catalog(200, seed=8))
    result = compare(made_up_catalog(200), record.isel(event=np.arange(9)), QUICK)
    assert np.isnan(result["b"][1])
    assert re.search(r"The record has no b: it has \d events, and 10 are needed", result.attrs["size_text"])
    assert "nan" not in result.attrs["size_text"]


STEPS = [{"name": "a", "start": "2019-08-01", "end": "2019-09-30"}]


def test_no_recorded_event_is_a_result():
    """Of 60 days: 3.69 events (95 %, Poisson) bound what is expected, and 200 modelled ones are not compatible."""
    catalog = made_up_catalog(200)
    result = compare(catalog, as_record(catalog.isel(event=[])), QUICK | {"steps": STEPS})
    np.testing.assert_allclose(result["event_rate_interval"] * result["exposure"], [0.0, 3.6889], rtol=1e-4)
    assert result["event_ratio_p_value"] < 1e-6
    low, high = result["event_ratio_interval"].values
    assert low > 30
    assert np.isinf(high)
    expected = "the record has no event in 60 days. The expected number of recorded events is less than 3.69 (95 %). "
    assert result.attrs["sums_text"].startswith(expected)
    quiet = compare(catalog.isel(event=[0]), as_record(catalog.isel(event=[])), QUICK | {"steps": STEPS})
    assert quiet["event_ratio_p_value"] > 0.2


@pytest.mark.parametrize("count", [1, 10])
def test_a_record_of_few_events_has_ratios_and_no_completeness(count):
    """Its cut is the model's floor or its smallest event, and the sentence says which and why."""
    record = as_record(made_up_catalog(count, seed=8))
    result = compare(made_up_catalog(100), record, QUICK | {"steps": STEPS})
    assert np.isnan(result["record_completeness"])
    assert result.attrs["cut_is"] == "smallest recorded"
    assert float(result["cut"]) == pytest.approx(np.log10(record["potency"].values.min()))
    assert f"the record has {count} event" in result.attrs["cut_text"]
    for name in ("event_ratio", "potency_ratio"):
        low, high = result[f"{name}_interval"].values
        assert 0 < low < float(result[name]) < high < np.inf
    below = as_record(made_up_catalog(count, seed=8))
    below["potency"][:] = 2e-4
    result = compare(made_up_catalog(100), below, QUICK | {"steps": STEPS})
    assert result.attrs["cut_is"] == "model floor"
    assert float(result["cut"]) == pytest.approx(-3.0)


def test_members_are_the_models_chance():
    """Five runs and more: the mean of all over the record, its interval from what they differ by; fewer count for
    nothing, and the sentence says so."""
    catalog, record = made_up_catalog(100), as_record(made_up_catalog(100, seed=9))
    alike = [catalog] * 4
    apart = [made_up_catalog(count, seed=count) for count in (40, 80, 160, 320)]
    one, three, same, other = (
        compare(catalog, record, QUICK | {"members": len(members)}, members)
        for members in ([], apart[:3], alike, apart)
    )
    for name in ("event_ratio_interval", "potency_ratio_interval"):
        widths = [np.ptp(np.log(each[name].values)) for each in (same, one, other)]
        assert widths[0] < widths[1] < widths[2]
        np.testing.assert_array_equal(one[name], three[name])
    assert other["model_runs"] == 5
    above = [np.sum(run["potency"].values >= 10 ** float(other["cut"])) for run in (catalog, *apart)]
    np.testing.assert_allclose(other["event_ratio"], np.mean(above) / float(other["events_above_cut"][1]))
    assert "assumed to be as clustered as those of the record" in one.attrs["sums_text"]
    assert "differences between its 5 runs" in other.attrs["sums_text"]


def test_a_quiet_record_has_a_ratio_of_potency_if_other_runs_have_events():
    """The mine's own run has none above the cut, its members have some: what they are worth is known from them."""
    catalog = made_up_catalog(60)
    own = catalog.copy(deep=True)
    own["potency"][:] = 1e-9
    members = [catalog.isel(event=slice(number, number + 5)) for number in range(8)]
    result = compare(own, as_record(catalog.isel(event=[])), QUICK | {"members": 8}, members)
    assert result["events_above_cut"].values.tolist()[1] == 0
    assert np.isfinite(result["potency_ratio_p_value"])


def test_faults_are_named():
    catalog = made_up_catalog(50)
    with pytest.raises(InputError, match=r"comparison\.block_size: unknown key"):
        compare(catalog, as_record(catalog), {"block_size": 3})
    with pytest.raises(InputError, match="of mine demo, record of other"):
        compare(catalog, as_record(catalog, mine="other"), QUICK)


def test_the_stage_writes_the_same_bytes_with_one_thread_or_two(tmp_path):
    write_dataset(made_up_catalog(150), tmp_path / "catalog.nc")
    write_dataset(as_record(made_up_catalog(200, seed=9)), tmp_path / "record.nc")
    inputs = {name: tmp_path / f"{name}.nc" for name in ("catalog", "record")}
    found = []
    for threads in ("1", "2"):
        environment = {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        outputs = [tmp_path / threads / "comparison.nc"]
        done = run_job(tmp_path, "comparison", {"comparison": QUICK | {"steps": []}}, outputs, environment, **inputs)
        assert done.returncode == 0, done.stderr
        found.append(outputs[0].read_bytes())
    assert found[0] == found[1]
    assert "config_hash" in read_dataset(outputs[0]).attrs
