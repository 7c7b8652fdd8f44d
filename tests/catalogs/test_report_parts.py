"""Parts of the report by themselves: sums of many, sentences, tables, numbers."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from catalog_fixtures import made_up_catalog

from catalogs.compare.comparison import compare
from catalogs.report import verdict
from catalogs.report.evidence import Excavation
from catalogs.report.sections import events, sizes
from catalogs.report.sections.axes import iso_share
from catalogs.report.sections.convergence import running_iteration
from catalogs.report.sections.record import _account
from catalogs.report.sections.resources import read_resources
from catalogs.report.sections.scene import above_cap, by_step, far_field
from catalogs.report.sections.steps import events_by_step
from catalogs.report.text import number
from common.costs import Costs


def excavation(name: str, step: str, solid: float, drawn: float) -> Excavation:
    return Excavation(name, step, "none", step, solid, drawn, step == "planned", False)


def test_many_excavations_are_summed_by_step_with_the_worst_of_them():
    """In the order of the list; a solid without volume has no error, and loses nothing of the sums."""
    rows = by_step(
        [
            excavation("a", "history", 10.0, 9.0),
            excavation("b", "2019-08", 4.0, 5.0),
            excavation("c", "history", 20.0, 20.2),
            excavation("d", "planned", 0.0, 0.0),
        ]
    )
    assert [(row["step"], row["count"], row["solid"], row["drawn"]) for row in rows] == [
        ("history", 2, 30.0, 29.2),
        ("2019-08", 1, 4.0, 5.0),
        ("planned", 1, 0.0, 0.0),
    ]
    assert [row["worst"] for row in rows] == ["a", "b", "d"]
    assert [row["error"] for row in rows] == pytest.approx([-0.1, 0.25, np.nan], nan_ok=True)
    assert [row["planned"] for row in rows] == [False, False, True]


def test_a_derived_domain_is_told_with_what_is_expected_of_it():
    """In one sentence, another where it could not be as large as it should; of a given domain nothing is said."""
    assert far_field(xr.Dataset()) == ""
    attributes = {"far_field_distance": 209.86, "far_field_error": 0.3585, "far_field_limited": ""}
    told = far_field(xr.Dataset(attrs=attributes))
    assert "210 m from the nearest of them" in told
    assert "0.36 % of the largest" in told
    assert "memory" not in told
    assert "memory" in far_field(xr.Dataset(attrs=attributes | {"far_field_limited": "memory"}))
    assert "above its strength" in far_field(xr.Dataset(attrs=attributes | {"far_field_limited": "strength"}))


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.0, "0"),
        (np.nan, "–"),
        (-1234.5, "−1\u202f234"),
        (0.01234, "0.0123"),
        (1.5e-7, "1.50·10⁻⁷"),
        (-3.2e9, "−3.20·10⁹"),
    ],
)
def test_numbers_read_as_a_person_writes_them(value, expected):
    assert number(value) == expected


def test_iterations_run_on_where_the_counter_starts_anew():
    restarting = [0, 1, 2, 0, 1, 0, 5]
    assert list(running_iteration(np.array(restarting))) == [0, 1, 2, 3, 4, 5, 10]
    assert list(running_iteration(np.array([1, 2, 3, 1, 2]))) == [1, 2, 3, 4, 5]


def evidence_of(count: int, **attributes) -> SimpleNamespace:
    """What the report tells of a record by its attributes alone."""
    return SimpleNamespace(
        is_twin=False, comparison=None, record=xr.Dataset({"x": ("event", np.zeros(count))}, attrs=attributes)
    )


def test_result_says_so_when_all_of_the_record_lies_inside():
    """And nothing of an outside that there is not; none at all is said, too. Compared are those from the cut on."""
    domain = {
        "filter": "domain",
        "before": 60,
        "after": 60,
        "potency_before": 1.0,
        "potency_after": 1.0,
        "farthest": None,
    }
    record = evidence_of(60, rows=60, dropped="{}", filter=json.dumps([domain]))
    assert _account(record) == (
        "The record holds 60 events. All 60 events in the modelled months lie inside the model's domain."
    )
    counts = {"events_above_cut": ("catalogue", [12, 31])}
    record.comparison = xr.Dataset(counts, attrs={"cut_text": "log P >= -1.50, the record's completeness"})
    assert _account(record).endswith(
        "domain. Events of log P ≥ −1.50 are compared: 31 of the record and 12 of the model."
    )
    none = evidence_of(0, rows=60, filter=json.dumps([domain | {"before": 0, "after": 0}]))
    assert _account(none).endswith("No event lies in the modelled months.")


def test_companion_and_members_are_one_row_each_of_the_resources(tmp_path):
    """Times add up, the largest peak counts; members in order of their numbers, after the mine's own stages. A stage
    that is under way has no row."""
    runs = [("ensemble/10", "a", 1, 5), ("ensemble/2", "steps/a", 3, 7), ("ensemble/2", "events/a", 4, 6)]
    runs += [("coarse", "grid", 1, 2), ("coarse", "steps/a", 2, 1), ("", "spread", 1, 1)]
    for run, stage, seconds, peak in runs:
        path = tmp_path / run / f"{stage}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{Costs(seconds, 1.0, 0.5, peak).closing_line(stage)}\n")
    (tmp_path / "report.log").write_text("at work\n")
    rows = read_resources(tmp_path, {"a"}, set(), 10)
    parts = [f"{run}, all stages" for run in ("coarse", "ensemble/2", "ensemble/10")]
    assert [row["stage"] for row in rows] == ["spread", *parts]
    found = [tuple(row[name] for name in ("seconds", "processor", "compiling", "memory")) for row in rows[1:3]]
    assert found == [(3, 2, 1, 2), (7, 2, 1, 7)]


def test_resources_are_of_the_stages_of_this_plan(tmp_path):
    """A plan that once had another step, a record, a companion and more members has left their logs; other
    plans and a calibration have a page of their own."""
    for stage in ("grid", "steps/a", "steps/old", "vtk/steps/old", "compare", "coarse/grid", "ensemble/1/steps/a",
                  "ensemble/1/events/old", "ensemble/2/steps/a", "plans/b/steps/a", "calibration/own/1"):  # fmt: skip
        path = tmp_path / f"{stage}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{Costs(2, 1.0, 0.5, 3).closing_line(stage)}\n")
    rows = read_resources(tmp_path, {"a"}, {"compare", "coarse"}, 1)
    assert [(row["stage"], row["seconds"]) for row in rows] == [
        ("grid", 2), ("steps/a", 2), ("ensemble/1, all stages", 2)
    ]  # fmt: skip


def test_more_cells_than_the_cap_are_told():
    """On an adaptive grid."""
    grid = {"refinement": "adaptive", "max_cells": 300}
    evidence = SimpleNamespace(stages=[SimpleNamespace(attrs={"cells": 1234})], config={"grid": grid})
    assert above_cap(evidence).startswith("The last step has 1\u202f234 cells, more than grid.max_cells (300)")
    for other in ({"max_cells": 1234}, {"refinement": "static"}):
        evidence.config = {"grid": grid | other}
        assert above_cap(evidence) == ""


def test_events_of_many_steps_are_told_by_those_with_most():
    """In order of time; of few steps each is told."""
    counts = [(number % 7 * 10, f"m{number}") for number in range(30)]
    told = events_by_step(counts)
    assert told.startswith("most in these, ")
    entries = told.removeprefix("most in these, ").split(", ")
    assert len(entries) <= 5
    assert {entry.split(" in ")[0] for entry in entries} <= {"60", "50"}
    assert "60 in m6" in entries
    assert events_by_step(counts[:3]) == "0 in m0, 10 in m1, 20 in m2"


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


def evidence_of_face(**counts) -> SimpleNamespace:
    """A comparison of a mine whose face advances east over the synthetic mine, or of one without a face."""
    catalog, record = made_up_catalog(200), made_up_catalog(200, 1, "twin")
    for one in (catalog, record):
        one.attrs["location_error"] = 5.0
    face = [
        {"date": "2019-08-01", "ends": [[-100.0, -50.0], [-100.0, 50.0]]},
        {"date": counts.get("until", "2019-10-01"), "ends": [[10.0, -50.0], [10.0, 50.0]]},
    ]
    steps = [{"name": "2019-08", "start": "2019-08-01", "end": "2019-10-01"}]
    asked = {"resamplings": 99, "steps": steps, **({"face": face} if counts.get("face", True) else {})}
    comparison = compare(catalog, record, asked)
    return SimpleNamespace(comparison=comparison, record_label="Recorded (twin)", is_twin=True)


def test_places_against_the_face_are_a_figure_and_a_table_and_say_what_is_out_of_reach():
    """A value in its row; a model that ran once has no interval, and it is said why."""
    evidence, figures = evidence_of_face(), []
    shown = events._against_face(evidence, SimpleNamespace(add=lambda name, figure: figures.append((name, figure))))
    assert [name for name, _ in figures] == ["face"]
    assert len(figures[0][1].axes) == 4
    rows = {(row["name"], row["weight"]): row["cells"] for row in shown["rows"]}
    value = evidence.comparison["face_measure"].sel(catalogue="record", weight="potency", measure="median ahead")
    assert rows["median distance ahead of the face (m)", "potency"][1].startswith(number(float(value)))
    assert all("(" in recorded and "(" not in modelled for modelled, recorded in rows.values())
    assert "fewer than three of its runs" in shown["text"]
    assert "5 % of them lie anywhere" in shown["text"].replace("5.0 %", "5 %")
    assert "drifts along a panel" in shown["text"]


def test_without_a_face_there_is_nothing_and_with_one_that_ends_early_it_is_said():
    """No figure is made."""
    assert events._against_face(evidence_of_face(face=False), None) is None
    shown = events._against_face(evidence_of_face(until="2019-09-30"), None)
    assert shown["figure"] is None
    assert "no event of the model that counts" in shown["text"]


def test_the_first_page_says_how_far_events_are_from_the_face():
    """Behind and ahead in words, and whether the difference is more than the record leaves open."""
    evidence = evidence_of_face()
    (sentence,) = verdict._against_face(evidence)
    measure = evidence.comparison["face_measure"].sel(weight="number", measure="median ahead").values
    side = ["behind" if ahead < 0 else "ahead of" for ahead in measure]
    assert f"{number(abs(measure[0]), 2)} m {side[0]} the face, that of recorded events " in sentence
    assert f"{number(abs(measure[1]), 2)} m {side[1]} the face (95 %: " in sentence
    assert sentence.endswith("no difference that the record shows.")
    moved = evidence.comparison.copy(deep=True)
    moved["face_measure"].loc[{"catalogue": "model"}] += 500.0
    (sentence,) = verdict._against_face(SimpleNamespace(comparison=moved))
    assert "m ahead of the face, that of" in sentence
    assert sentence.endswith("a difference that the record shows.")
    assert verdict._against_face(evidence_of_face(face=False)) == []
    assert verdict._against_face(evidence_of_face(until="2019-09-30")) == []
