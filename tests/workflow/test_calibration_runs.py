"""`snakemake calibrate` for the tiny mine: trials, page, table and mine files; what it refuses before anything runs."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from tiny_mines import ROOT, TINY, changed, edited, merged, snakemake, write_mine

from common.errors import InputErrors
from common.job import content_of
from workflow.calibration_trials import CalibrationTrials
from workflow.configuration import load

QUANTITIES = [
    {"key": "materials.host.cohesion.residual", "range": ["0.2 MPa", "1 MPa"], "scale": "log", "source": "test"},
    {"key": "materials.host.friction_angle.residual", "range": ["15 deg", "25 deg"], "source": "test"},
]
FEW = {"trials": 4, "batches": 1, "batch_trials": 1}
DESIGN = {"trials": 6, "replicates": 1, "pairs": 2, "complete_above": "0.001 m^3"}
CALIBRATED = changed(TINY, calibration={"quantities": QUANTITIES, **DESIGN})
BATCHED = changed(CALIBRATED, **{f"calibration.{key}": number for key, number in FEW.items()})


MARKS = {"start": ["25 m", "35 m", "40 m"], "end": ["25 m", "35 m", "50 m"]}
READ = {"file": "gap.csv", "units": "mm", "error": "2 mm"}
CELL = {"name": "cell", "at": ["50 m", "47 m", "57 m"], "axis": {"trend": "90 deg"}}
READINGS = "date,value\n2019-08-20,470\n2019-08-30,510\n"
BOTH_TERMS = (["potency", "number"], ["potency", "number", "instruments"])
WITH_INSTRUMENTS = changed(
    {key: value for key, value in CALIBRATED.items() if key != "record"},
    **{
        "calibration.terms": ["instruments"],
        "observations": {"closures": [MARKS | READ | {"name": "gap"}], "points": [CELL]},
    },
)


def trials_of(mine: dict, tmp_path) -> CalibrationTrials:
    """Trials of a mine's file."""
    file = write_mine(mine, tmp_path / "mine.yaml")
    return CalibrationTrials(load(merged(mine), file), file)


def test_trials_change_what_is_named_and_nothing_else(tmp_path):
    """Elastic state and grid are those of the mine; residual rows differ from trial to trial; replicates are perturbed
    in their steps alone; pairs differ by their cells."""
    trials = trials_of(CALIBRATED, tmp_path)
    assert (trials.all_names, trials.finer) == (["1", "2", "3", "4", "5", "6", "7"], ["2", "3"])
    first, second, replicate = (trials.slice_of(name, "own") for name in ("2", "3", "1"))
    assert first["grid"] == second["grid"] == trials.mine.grid_slice()
    hosts = [one["elastic"]["materials"]["host"] for one in (first, second)]
    for host, point in zip(hosts, trials.points[1:], strict=False):
        assert host["cohesion"]["residual"] == pytest.approx(0.2e6 * 5.0 ** point[0], rel=1e-5)
        assert host["friction_angle"]["residual"] == pytest.approx(15.0 + 10.0 * point[1], rel=1e-5)
    without = [{**host, "cohesion": 0, "friction_angle": 0} for host in hosts]
    assert without[0] == without[1]
    assert "realization" not in replicate["elastic"]
    assert [step["scene"]["realization"] for step in replicate["steps"]] == [1, 1]
    assert trials.slice_of("2", "doubled")["grid"]["grid"]["levels"] == first["grid"]["grid"]["levels"] - 1


def instrument_trials(tmp_path, **values) -> CalibrationTrials:
    """Trials of the mine with instruments and without a record."""
    (tmp_path / "gap.csv").write_text(READINGS)
    return trials_of(changed(WITH_INSTRUMENTS, **values), tmp_path)


def test_trials_read_the_model_where_instruments_with_readings_are(tmp_path):
    """Places alone, so that other readings, errors and zeros leave trials as they are; the fit depends on all."""
    trials = instrument_trials(tmp_path)
    assert (trials.record, trials.readings) == ([], ["results/tiny/calibration/readings.nc"])
    assert trials.record_check == []
    observed = CALIBRATED | {"observations": WITH_INSTRUMENTS["observations"]}
    asked = (trials_of(changed(observed, **{"calibration.terms": terms}), tmp_path) for terms in BOTH_TERMS)
    assert len({str(one.record_slice()) for one in asked}) == 1  # a record that is asked again would hold trials back
    assert [path.rpartition("/")[2] for path in trials.figures] == ["pairs.svg", "instruments.svg"]
    slices = trials.slice_of("2", "own")["instruments"]
    assert [one["name"] for one in slices["observations"]["closures"]] == ["gap"]
    assert slices["observations"]["points"] == []  # it has no readings
    other = instrument_trials(tmp_path, **{"observations.closures.0.error": "5 mm"})
    assert other.slice_of("2", "own") == trials.slice_of("2", "own")
    assert other.readings_slice() != trials.readings_slice()
    assert other.posterior_hash != trials.posterior_hash
    moved = instrument_trials(tmp_path, **{"observations.closures.0.end": ["25 m", "35 m", "48 m"]})
    assert moved.slice_of("2", "own") != trials.slice_of("2", "own")
    assert "instruments" not in trials_of(CALIBRATED, tmp_path).slice_of("2", "own")


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        (
            {"observations": {"points": [CELL]}},
            "calibration.terms: instruments: no instrument in observations has readings",
        ),
        ({"observations": {}}, "calibration.terms: instruments: no instrument in observations has readings"),
        ({"calibration.terms": ["instruments", "number"]}, "record: missing; a calibration needs a record"),
    ],
)
def test_terms_without_their_data_are_refused_in_one_line(values, problem, tmp_path):
    with pytest.raises(SystemExit, match=problem) as refused:
        _ = instrument_trials(tmp_path, **values).all_names
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"calibration.terms": ["instrument"]}, "calibration.terms"),
        (
            {"steps.1": {"name": "2019-08", "start": "2021-08-01", "end": "2021-09-01"}},
            "no reading is within the dates",
        ),
    ],
)
def test_unknown_terms_and_readings_outside_of_all_steps_are_refused_with_the_mine(values, problem, tmp_path):
    with pytest.raises(InputErrors, match=problem) as refused:
        instrument_trials(tmp_path, **values)
    assert len(refused.value.lines) == 1


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"calibration": None}, "calibration: missing section"),
        ({"record": None}, "record: missing"),
        ({"calibration.cells": "doubled", "grid.levels": 1}, "calibration.cells"),
    ],
)
def test_mines_that_cannot_be_calibrated_are_refused(values, problem, tmp_path):
    """In one line, when trials are planned."""
    mine = changed(CALIBRATED, **{key: value for key, value in values.items() if value is not None})
    mine = {key: value for key, value in mine.items() if values.get(key, "") is not None}
    with pytest.raises(SystemExit, match=problem) as refused:
        _ = trials_of(mine, tmp_path).all_names
    assert "\n" not in str(refused.value)


def test_values_that_make_no_mine_are_refused_with_their_trial(tmp_path):
    """A range that leaves what the law allows."""
    wide = [{**QUANTITIES[1], "range": ["15 deg", "60 deg"]}]
    trials = trials_of(changed(CALIBRATED, **{"calibration.quantities": wide}), tmp_path)
    widest = 1 + int(trials.points[1:].argmax())
    with pytest.raises(SystemExit, match=f"calibration, trial {widest + 1}"):
        trials.slice_of(str(widest + 1), "own")


@pytest.mark.parametrize(
    ("key", "ends"),
    [
        ("record.location_error", ["1 m", "9 m"]),
        ("materials.spare.youngs_modulus", ["45 GPa", "70 GPa"]),
        ("frame.latitude", [-42.0, -41.0]),
    ],
)
def test_a_quantity_that_changes_no_trial_is_refused_when_trials_are_planned(key, ends, tmp_path):
    """Of the record, of a material that no rock has, a label of events: in one line with its key,
    beside a quantity that changes trials."""
    spare = {"spare": dict(CALIBRATED["materials"]["host"])}
    idle = {"key": key, "range": ends, "source": "test"}
    values = {"materials": CALIBRATED["materials"] | spare, "calibration.quantities": [QUANTITIES[0], idle]}
    with pytest.raises(SystemExit, match=rf"calibration.quantities\[1\].key: {key} changes no trial") as refused:
        _ = trials_of(changed(CALIBRATED, **values), tmp_path).all_names
    assert "\n" not in str(refused.value)


def test_a_posterior_is_known_by_all_that_it_depends_on(tmp_path):
    """Another range, other trials, rock, stress, record or dates make another posterior. Values of the calibrated
    quantities themselves, plans, hazard and the name of a folder do not."""
    same = trials_of(CALIBRATED, tmp_path).posterior_hash
    narrower = [QUANTITIES[0], {**QUANTITIES[1], "range": ["16 deg", "25 deg"]}]
    for key, value in (
        ("calibration.quantities", narrower),
        ("calibration.quantities", QUANTITIES[:1]),
        ("calibration.trials", 7),
        ("calibration.terms", ["number"]),
        ("insitu_stress.gradient.yy", "-0.05 MPa/m"),
        ("materials.host.youngs_modulus", "50 GPa"),
        ("record.location_error", "6 m"),
        ("steps", [{"name": "history"}, {"name": "2019-08", "start": "2019-08-01", "end": "2019-08-20"}]),
    ):
        assert trials_of(changed(CALIBRATED, **{key: value}), tmp_path).posterior_hash != same, key
    for key, value in (
        ("materials.host.cohesion.residual", "0.7 MPa"),
        ("hazard", {"rock": "posterior"}),
        ("comparison.resamplings", 199),
    ):
        assert trials_of(changed(CALIBRATED, **{key: value}), tmp_path).posterior_hash == same, key
    file = write_mine(CALIBRATED, tmp_path / "mine.yaml")
    record = tmp_path / CALIBRATED["record"]["file"]
    record.write_text(record.read_text() + "2019-08-09,45,45,35,-1\n")
    content_of.cache_clear()
    assert CalibrationTrials(load(merged(CALIBRATED), file), file).posterior_hash != same


def test_a_trial_has_a_row_for_each_setting_of_what_changes_events_only(tmp_path):
    """The rock is computed once; closeness differs between the extractions of a trial, and between trials."""
    closeness = {"key": "seismic.closeness", "range": [0.6, 0.9], "source": "test"}
    trials = trials_of(changed(CALIBRATED, **{"calibration.quantities": [*QUANTITIES, closeness]}), tmp_path)
    rows = [trials.rows(name) for name in ("2", "3")]
    assert all(one.shape == (4, 3) for one in rows)
    np.testing.assert_array_equal(rows[0][:, :2], np.repeat(trials.points[1:2, :2], 4, axis=0))
    assert len({*rows[0][:, 2], *rows[1][:, 2]}) == 8
    events = [step["events"] for step in trials.slice_of("2", "own")["steps"]]
    given = [[one["closeness"] for one in step] for step in events]
    np.testing.assert_allclose(given, np.tile(0.6 + 0.3 * rows[0][:, 2], (len(events), 1)), rtol=1e-5)


def test_a_calibrated_mine_file_names_files_from_its_own_folder(tmp_path):
    """Kept forecasts are lists of paths, which were not moved; a rock may be called as a key that holds a path."""
    (tmp_path / "kept.nc").write_bytes(b"")
    rocks = {"materials.file": TINY["materials"]["host"], "materials.folder": TINY["materials"]["host"]}
    text = trials_of(changed(CALIBRATED, forecasts=["kept.nc"], **rocks), tmp_path).fit_slice()["text"]
    assert "forecasts" not in text
    assert text["materials"]["file"] == text["materials"]["folder"] == TINY["materials"]["host"]
    assert Path("results/tiny/calibration", text["record"]["file"]).resolve() == tmp_path / TINY["record"]["file"]


def test_a_history_that_no_step_lists_is_one_too(tmp_path):
    """The page warns where no rock fails in it on cells of twice the size."""
    listed = [step for step in TINY["steps"] if step["name"] != "history"]
    for steps in (TINY["steps"], listed):
        assert trials_of(changed(CALIBRATED, steps=steps), tmp_path).fit_slice()["has_history"]


def test_further_trials_are_at_the_points_of_their_batch(tmp_path, monkeypatch):
    """By number; their names follow those of the design, and an unknown name is refused in one line."""
    monkeypatch.chdir(tmp_path)
    trials = trials_of(changed(CALIBRATED, **{"calibration.batches": 2, "calibration.batch_trials": 2}), tmp_path)
    assert trials.all_names[7:] == ["batch_1_1", "batch_1_2", "batch_2_1", "batch_2_2"]
    assert trials.names_before(2)[7:] == ["batch_1_1", "batch_1_2"]
    file = tmp_path / trials.batch_file(1)
    file.parent.mkdir(parents=True)
    file.write_text("[[0.25, 0.5], [0.75, 0.125]]")
    np.testing.assert_array_equal(trials.rows("batch_1_2"), [[0.75, 0.125]])
    assert trials.fit_slice(2)["trials"][-1] == {"name": "batch_1_2", "kind": "further", "rows": [[0.75, 0.125]]}
    with pytest.raises(SystemExit, match="no trial batch_3_1"):
        trials.rows("batch_3_1")


@pytest.mark.parametrize(
    ("target", "jobs"),
    [("calibrate", {"trial": 40, "further": 1}), ("calibration_truth", {"trial": 40, "further": 1, "truth_case": 2})],
)
def test_a_dry_run_shows_the_jobs_before_the_points_of_a_batch_are_known(target, jobs, tmp_path):
    """The inputs of the fit are not known then."""
    status, text = snakemake(ROOT / "config/mines/demo.yaml", tmp_path, "--dry-run", target)
    assert status == 0, text
    found = {name: int(count) for name, _, count in (line.partition(" ") for line in text.splitlines()) if name in jobs}
    assert found == jobs


@pytest.mark.slow
def test_calibration_to_instruments_alone(tmp_path):
    """A mine without a record: the page has instruments and none of the record's parts. Other readings run no trial."""
    (tmp_path / "gap.csv").write_text(READINGS)
    mine = changed(
        WITH_INSTRUMENTS, **{"calibration.trials": 5, "calibration.replicates": 0, "calibration.cells": "own"}
    )
    file = write_mine(mine, tmp_path / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "calibrate")
    assert status == 0, text
    folder = tmp_path / "results/tiny/calibration"
    page = (folder / "report.html").read_text()
    assert "calibration to the readings" in page
    assert "Instruments</h2>" in page
    assert "Steps: recorded and predicted" not in page
    assert page.count("<img") == 2
    with open(folder / "trials.csv") as table:
        assert len(list(csv.DictReader(table))) == 5
    (tmp_path / "gap.csv").write_text(READINGS.replace("510", "460"))
    text = snakemake(file, tmp_path, "--dry-run", "calibrate")[1]
    jobs = {line.split()[0] for line in text.splitlines() if len(line.split()) == 2 and line.split()[1].isdigit()}
    assert {"calibration_readings", "calibrate"} <= jobs, text
    assert "trial" not in jobs, text


@pytest.mark.slow
def test_calibration_of_the_tiny_mine(spoiled, base):
    """Beside results that stand: page, table, mine files that load. A second call has nothing to do. A longer design
    keeps the trials that were run."""
    results = spoiled / "results/tiny"
    with edited(base / "files" / "tiny.yaml", BATCHED) as file:
        status, text = snakemake(file, spoiled, "calibrate")
        again = snakemake(file, spoiled, "--dry-run", "calibrate")
    with edited(base / "files" / "tiny.yaml", changed(BATCHED, **{"calibration.trials": 6})) as file:
        longer = snakemake(file, spoiled, "--dry-run", "calibrate")
    assert status == 0, text
    assert "Nothing to be done" in again[1]
    assert sum(line.split() == ["trial", "2"] for line in longer[1].splitlines()) == 1, longer[1]
    folder = results / "calibration"
    page = (folder / "report.html").read_text()
    assert "What the record says of each quantity" in page
    assert "On cells of twice the size no rock fails in history" in page
    assert page.count("<img") == 3
    with open(folder / "trials.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == ["replicate", *["design"] * 4, "further"]
    assert all(float(row["materials.host.cohesion.residual, MPa"]) <= 1.0 for row in rows)
    middle = yaml.safe_load((folder / "middle.yaml").read_text())
    mine = load(middle, folder / "middle.yaml")
    assert mine.name == "tiny_middle"
    assert (folder / middle["record"]["file"]).is_file()
