"""The price before the run: pilots, what is foreseen on cells of other sizes, and cells for a request."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numba
import pytest
import yaml
from tiny_mines import TINY, box, snakemake, write_mine

from catalogs.compare.cell_error import MIN_ERROR, error_at
from catalogs.settings import ReportSlice
from common.errors import InputError
from common.job import config_hash
from mpm_core.stages.grid_stage import cells_at_start, draft_keeps_cells, make_grid
from workflow import command_line, pilot, quote
from workflow.configuration import load_mine
from workflow.mine_settings import AccuracyRequest
from workflow.pilot import Pilot, PilotStep, pilot_slices
from workflow.quote import Quotes, choose, quote_slice, text_of
from workflow.stages.requests import quote_of

FLAT = Path(__file__).parents[1] / "golden/mines/flat.yaml"
STEPS = (PilotStep("history", 1200, 600, 3.0), PilotStep("2019-08", 2000, 1200, 10.0))
FOUND = Pilot(4.0, 1000, 500, 1.0, 2.0, STEPS, 4.0)
SETTINGS = {
    "name": "made_up", "cell": 2.0, "levels": 7, "doubled": False, "max_cells": 10**8, "pilots": [{}], "steps": 2,
    "grids": {"4.0": 1000, "2.0": 3000, "1.0": 10_000}, "scheme": "multigrid", "dimension": 3, "particles_per_cell": 1,
    "across": {"wide": [8.0, 3], "drive": [3.0, 3], "slot": [3.0, 2]}, "follows": True, "companion": False,
    "members": 0, "accuracy": "standard",
}  # fmt: skip


@pytest.fixture
def quotes(monkeypatch):
    """Quotes of a mine that was tried on cells of 4 m; other settings, cores and pilots by name."""
    monkeypatch.setattr(quote, "cells_at_start", lambda grid: grid)
    monkeypatch.setattr(quote, "draft_keeps_cells", lambda grid: False)

    def make(cores=1, found=FOUND, **changes) -> Quotes:
        monkeypatch.setattr(quote, "pilot_of", lambda *_: found)
        return Quotes(SETTINGS | changes, "code", cores)

    return make


def test_on_the_cells_of_the_pilot_a_quote_is_what_it_took(quotes):
    one = quotes().at(4.0)
    assert (one.start, one.end) == (1000, 2000)
    assert one.processor == pytest.approx(FOUND.seconds + quote.REPORT_SECONDS)
    assert one.error == pytest.approx(math.expm1(error_at(1.0)))


def test_smaller_cells_cost_more_and_err_less(quotes):
    made = quotes()
    sizes = [8.0, 4.0, 3.0, 2.0, 1.4, 1.0, 0.5]
    rows = [made.at(cell) for cell in sizes]
    for name in ("start", "end", "memory", "processor", "wall"):
        values = [getattr(row, name) for row in rows]
        assert values == sorted(values), name
        assert values[0] < values[-1], name
    errors = [row.error for row in rows]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(math.expm1(MIN_ERROR))
    assert made.at(8.0).error > made.at(4.0).error
    assert made.cells_at(math.sqrt(8.0)) == pytest.approx(math.sqrt(1000 * 3000))


def test_half_of_an_error_is_that_of_smaller_cells_as_far_as_a_study_vouches_for_it(quotes):
    made = quotes()
    half = made.half(made.at(4.0))
    assert 0.45 < half.error / made.at(4.0).error <= 0.5
    assert half.cell == float(f"{half.cell:.2g}")
    assert quotes(doubled=True).half(made.at(4.0)).cell == 2.0  # the next smaller that the file can have
    assert half.processor > made.at(4.0).processor
    assert made.half(made.at(1.0)) is None
    nothing = quotes(found=replace(FOUND, thickness=math.nan))
    assert nothing.half(nothing.at(2.0)) is None


def test_companion_ensemble_later_steps_and_cores_count(quotes):
    alone = quotes().at(2.0)
    assert quotes(companion=True).at(2.0).processor - alone.processor == pytest.approx(FOUND.seconds)
    more = quotes(members=3).at(2.0).processor - alone.processor
    assert 2.5 * alone.processor < more + 3.0 * quote.REPORT_SECONDS < 3.0 * alone.processor + 3.0
    later = quotes(steps=4).at(2.0)
    assert later.end > alone.end
    assert later.processor > alone.processor * 1.5
    assert alone.wall > quotes(cores=4).at(2.0).wall > alone.wall * quote.SERIAL_SHARE * 0.9


def test_a_companion_that_runs_beside_the_steps_takes_memory_too(quotes):
    own, beside = quotes().at(2.0).memory, quotes().at(4.0).memory
    assert quotes(companion=True).at(2.0).memory == own
    assert quotes(companion=True, cores=2).at(2.0).memory == pytest.approx(own + beside)
    assert quotes(companion=True, cores=2).at(2.0, draft=True).memory == own


def test_the_row_of_a_draft_is_without_companion(quotes):
    both, alone = (text_of(quotes(cores=2, companion=companion)).splitlines()[2:5] for companion in (True, False))
    assert both[0].split() == alone[0].split()
    assert both[1].split() != alone[1].split()


def test_no_more_cells_are_foreseen_than_the_file_allows(quotes):
    """grid.max_cells was not looked at, and memory was refused that no run would take."""
    free, bound = quotes(steps=5).at(1.0), quotes(steps=5, max_cells=12_000).at(1.0)
    assert free.end > 15_000
    assert (bound.start, bound.end) == (10_000, 12_000)
    assert bound.processor < free.processor
    assert "grid.max_cells (5,000) is reached" in text_of(quotes(max_cells=5000))
    assert "max_cells" not in text_of(quotes(max_cells=5000, follows=False))
    assert "max_cells" not in text_of(quotes())
    assert "grid.max_cells (9,000) is reached with cells of 1 m:" in text_of(quotes(max_cells=9000))
    assert quotes(found=replace(FOUND, thickness=3.0), max_cells=9000).half(quotes().at(2.0)) is None
    many, capped = (
        quotes(steps=60).at(1.0),
        quotes(steps=60, max_cells=12_000).at(1.0),
    )  # no growth that does not happen
    assert capped.processor < many.processor


def test_cells_that_are_split_leave_fewer_coarse_ones(quotes):
    """On much larger cells less than none were added, and the time of later steps was no number."""
    steps = (PilotStep("history", 1200, 1100, 3.0), PilotStep("2019-08", 1500, 1500, 10.0))
    made = quotes(steps=9, dimension=2, found=replace(FOUND, start_finest=800, steps=steps))
    for cell in (128.0, 16.0, 4.0, 1.0):
        assert made.at(cell).wall > 0.0
    assert made.at(4.0).end >= 1500


def test_in_plane_strain_fewer_cells_and_cycles_come_with_smaller_ones(quotes):
    solid, flat = quotes(), quotes(dimension=2)
    assert flat.at(4.0).end == solid.at(4.0).end
    assert flat.at(1.0).end < 0.5 * solid.at(1.0).end
    assert flat.at(1.0).processor < 0.2 * solid.at(1.0).processor


def test_what_a_pilot_leaves_open_is_said(quotes):
    assert "the error is above all that of stope_1" in text_of(quotes(found=replace(FOUND, around="stope_1")))
    collapsed = quotes(steps=9, found=replace(FOUND, collapsed="2019-08"))
    assert "collapses in 2019-08: steps after it are not computed, and cost nothing" in text_of(collapsed)
    assert collapsed.at(2.0) == quotes().at(2.0)
    of_one_size = replace(FOUND, start_finest=FOUND.start)
    assert "how many the run splits around failing rock is not foreseen" in text_of(quotes(found=of_one_size))
    assert "not foreseen" not in text_of(quotes(found=of_one_size, follows=False))


def test_a_size_that_is_too_large_to_count_is_left_out(quotes, monkeypatch):
    def count(cells):
        if cells > 5000:
            raise InputError("too little memory")
        return cells

    made = quotes(companion=True)
    monkeypatch.setattr(quote, "cells_at_start", count)
    again = quotes(companion=True)
    assert again.at(2.0) == made.at(2.0)
    assert len(text_of(again).splitlines()) == len(text_of(made).splitlines()) - 1
    with pytest.raises(InputError, match="too little memory"):
        quotes(grids={"4.0": 1000, "2.0": 9000})


def test_a_draft_that_keeps_the_cells_is_quoted_on_them(quotes, monkeypatch):
    monkeypatch.setattr(quote, "draft_keeps_cells", lambda grid: True)
    made = quotes(accuracy="draft", doubled=True, levels=3)
    assert made.own.cell == 1.0
    assert made.sizes[1] == 8.0  # with one level more
    assert "as they are  1 m" in text_of(made)
    assert "(draft)" not in text_of(quotes())
    monkeypatch.setattr(quote, "draft_keeps_cells", lambda grid: False)
    assert quotes(accuracy="draft").own.cell == 2.0


def test_an_error_that_no_pilot_shows_is_not_stated(quotes):
    assert math.isnan(quotes(found=replace(FOUND, thickness=math.nan)).at(2.0).error)
    assert math.isinf(quotes(found=replace(FOUND, thickness=0.5)).at(2.0).error)
    assert "no rock failed in the trial" in text_of(quotes(found=replace(FOUND, thickness=math.nan)))
    assert "too large to say" in text_of(quotes(found=replace(FOUND, thickness=0.5)))


def test_the_text_has_a_line_for_each_size_and_names_narrow_openings(quotes, monkeypatch):
    text = text_of(quotes(cores=2))
    head, columns, *sizes, narrow = text.splitlines()
    assert head.startswith(
        "made_up: what it takes on this machine with 2 cores, by history and 2019-08 on cells of 4 m."
    )
    assert len({len(line) for line in (columns, *sizes)}) == 1
    assert [line.split("(")[1].split(")")[0] for line in sizes] == ["draft", "standard", "fine"]
    assert narrow.endswith("drive (1.5 cells across, of 3), slot (1.5 cells across, of 2)")
    assert "draft" not in text_of(quotes(accuracy="fine"))
    monkeypatch.setattr(quote, "usable", lambda: 0.46e9)
    fits = text_of(quotes()).splitlines()[-2]
    assert fits.startswith("0.5 GB of memory are free: cells of ")
    size = float(fits.split()[-3])
    assert quotes().at(size).memory <= 0.46e9 < quotes().at(0.9 * size).memory
    monkeypatch.setattr(quote, "usable", lambda: 0.1e9)
    assert text_of(quotes()).splitlines()[-2] == "0.1 GB of memory are free: no cells fit"


def test_a_request_is_met_by_cells_that_are_just_small_or_large_enough(quotes, monkeypatch):
    made, doubled = quotes(), quotes(doubled=True)
    by_error = choose(made, AccuracyRequest.of({"error": 10.0}))
    assert made.at(by_error).error <= 0.1 < made.at(1.05 * by_error).error
    by_time = choose(made, AccuracyRequest.of({"time": 2.0}))
    assert made.at(by_time).wall <= 120.0 < made.at(0.9 * by_time).wall
    by_memory = choose(made, AccuracyRequest.of({"memory": 1.0}))
    assert made.at(by_memory).memory <= 1e9 < made.at(0.9 * by_memory).memory
    both = choose(made, AccuracyRequest.of({"memory": 1.0, "time": 2.0}))
    assert both == max(by_time, by_memory)
    assert choose(made, AccuracyRequest.of({"error": 10.0, "time": 600.0})) == by_error
    within = choose(quotes(max_cells=5000), AccuracyRequest.of({"time": 600.0}))  # or no rock would fail any more
    assert made.at(within).end < 5000 <= made.at(0.9 * within).end
    with pytest.raises(
        InputError, match=r"within .* GB of free memory and 5,000 cells \(grid.max_cells\) the error is"
    ):
        choose(quotes(max_cells=5000), AccuracyRequest.of({"error": 6.0}))
    monkeypatch.setattr(quote, "usable", lambda: 1e9)  # what is free counts, too
    assert choose(made, AccuracyRequest.of({"time": 1e6})) == by_memory
    monkeypatch.setattr(quote, "usable", lambda: 1e12)
    for request in ({"error": 10.0}, {"time": 2.0}, {"memory": 1.0}):
        cell = choose(doubled, AccuracyRequest.of(request))
        assert math.log2(cell / 2.0).is_integer()
        other = choose(made, AccuracyRequest.of(request))
        assert 0.5 < (cell / other if "error" in request else other / cell) <= 1.0


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ({"error": 5.0}, "accuracy.error: 5 % is not to be had: study openings vouches for no less than 5.3 %"),
        ({"time": 0.1}, "accuracy: not to be had: on cells of 128 m it still takes"),
        ({"error": 6.0, "time": 0.7}, "accuracy: an error of 6 % needs cells of"),
        ({"error": 6.0, "memory": 0.46}, "; within 0.46 GB the error is "),
    ],
)
def test_what_cannot_be_had_is_refused_with_what_can(quotes, request_, says):
    with pytest.raises(InputError, match=re.escape(says)):
        choose(quotes(), AccuracyRequest.of(request_))


def test_a_refusal_names_cells_that_the_file_can_have_and_their_error(quotes, monkeypatch):
    """It named the error of cells between, which a file with `levels` cannot have, and not the memory that was free."""
    monkeypatch.setattr(quote, "usable", lambda: 1e12)
    made = quotes(doubled=True)
    with pytest.raises(InputError) as told:
        choose(made, AccuracyRequest.of({"error": 6.0, "time": 0.7}))
    said = re.search(
        r"within 0.7 min and 1,000 GB of free memory the error is (.*), on cells of (.*) m", str(told.value)
    )
    assert math.log2(float(said[2]) / 2.0).is_integer()
    assert said[1] == quote.error_text(made.at(float(said[2])).error)


def test_cells_of_a_request_have_no_more_and_no_fewer_sizes_than_there_can_be(quotes):
    """Its levels were 0, or more than the most: a line about a key that nobody had written."""
    thin = replace(FOUND, thickness=2.0)
    few, many = quotes(doubled=True, levels=2), quotes(doubled=True, levels=quote.MAX_LEVELS, found=thin)
    with pytest.raises(InputError, match=r"not to be had: on cells of 4 m it still takes"):
        choose(few, AccuracyRequest.of({"memory": 0.2}))
    with pytest.raises(InputError, match=r"accuracy.error: 6 % .* on cells of 2 m, the smallest .* is still"):
        choose(many, AccuracyRequest.of({"error": 6.0}))


def test_without_failure_in_the_pilot_no_error_can_be_asked_for(quotes):
    with pytest.raises(InputError, match=r"accuracy.error: no rock fails on the cells of 4 m"):
        choose(quotes(found=replace(FOUND, thickness=math.nan)), AccuracyRequest.of({"error": 10.0}))


def test_a_pilot_is_run_on_ever_smaller_cells_until_it_takes_long_and_is_kept(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    ran = []

    def run(slices, failed):
        ran.append(slices["cell"])
        return replace(
            FOUND, cell=slices["cell"], grid=0.0, elastic=0.0, steps=(PilotStep("history", 9, 9, 20.0 / ran[-1]),)
        )

    monkeypatch.setattr(pilot, "_run", run)
    slices = [{"cell": cell, "grid": {"excavations": [], "rock_bodies": []}} for cell in (32.0, 16.0, 8.0, 4.0, 2.0)]
    found = pilot.pilot_of("mine", slices, 100, "code", 1)
    assert ran == [32.0, 32.0, 16.0, 16.0, 8.0, 8.0]  # twice in less than 4 s; 4 m would take 6 times 2.5 s
    assert found.cell == 8.0
    assert pilot.pilot_of("mine", slices, 100, "code", 1) == found
    assert len(ran) == 6
    pilot.pilot_of("mine", slices, 100, "other code", 1)
    assert len(ran) == 12
    assert pilot.pilot_of("mine", slices, 10**6, "third code", 1).cell == 2.0  # a larger mine may take longer


def test_a_mine_is_tried_with_its_history_and_first_month_on_larger_cells(monkeypatch, tmp_path):
    mine = load_mine(FLAT, {"grid": {"levels": 3}})
    assert [one["cell"] for one in pilot_slices(load_mine(FLAT))] == [10.0, 5.0]
    doubled, own = pilot_slices(mine)  # without cells of 10 m, which would all be of one size
    assert (doubled["cell"], own["cell"]) == (5.0, 2.5)
    for tried in (doubled, own):
        assert [step["name"] for step in tried["steps"]] == ["history", "2019-08"]
    assert pilot_slices(load_mine(FLAT, {"grid": {"levels": 1}})) == []
    monkeypatch.chdir(tmp_path)
    settings, threads = quote_slice(mine), numba.get_num_threads()
    assert json.loads(json.dumps(settings)) == settings
    monkeypatch.setattr(pilot, "GROWTH", 1e9)
    made = Quotes(settings, "code", 1)
    assert made.pilot.cell == 5.0
    assert numba.get_num_threads() == threads  # a run that follows in this process takes all of them
    assert made.pilot.start == make_grid(doubled["grid"], {}).sizes["cell"]
    assert [step.name for step in made.pilot.steps] == ["history", "2019-08"]
    assert made.pilot.thickness > 0.0
    assert made.pilot.around == "stope_1"
    assert made.at(2.5).start == make_grid(mine.grid_slice(), {}).sizes["cell"]


def test_before_anything_is_mined_no_cell_is_of_the_finest(monkeypatch, tmp_path):
    """All were taken for such, and it was said that all cells are of one size."""
    text = yaml.safe_load(FLAT.read_text())
    opened = [one | {"step": "2019-08"} for one in text["excavations"]]
    mine = load_mine(FLAT, {"excavations": opened, "grid": {"levels": 3}})
    monkeypatch.chdir(tmp_path)
    found = Quotes(quote_slice(mine), "code", 1)
    assert found.pilot.start_finest == 0
    assert found.pilot.steps[-1].finest > 0
    assert found.pilot.around in {one["name"] for one in opened}
    assert "one size" not in text_of(found)


def test_without_dates_a_mine_is_tried_up_to_the_first_step_that_mines():
    steps = [{"name": name} for name in ("before", "a", "b")]
    text = yaml.safe_load(FLAT.read_text())
    opened = [one | {"step": "a"} for one in text["excavations"]]
    (*_, own) = pilot_slices(load_mine(FLAT, {"steps": steps, "excavations": opened}))
    assert [step["name"] for step in own["steps"]][-1] == "a"


def test_a_draft_of_a_narrow_drive_keeps_its_cells(accept):
    narrow = [box("drive", "history", [20, 20, 40], [60, 25, 45])]
    for values, keeps in (({"excavations": narrow}, True), ({}, False)):
        doubled = accept(TINY, accuracy="draft", **values).grid_slice()
        assert draft_keeps_cells(doubled) is keeps
        assert draft_keeps_cells(doubled | {"grid": doubled["grid"] | {"resized_by": None}}) is keeps


def test_cells_are_counted_as_the_grid_makes_them(accept):
    old, new = (
        box(name, step, [x, 30, 40], [x + 10, 40, 50]) for name, step, x in (("a", "history", 20), ("b", "2019-08", 50))
    )
    dyke = {
        "name": "dyke",
        "material": "host",
        "refine": True,
        "shape": "box",
        "lower": ["10 m", "0 m", "0 m"],
        "upper": ["15 m", "80 m", "80 m"],
    }
    bodies, later = [dyke], [old, new]
    for changes in ({}, {"excavations": later}, {"rock_bodies": bodies}, {"accuracy": "fine"}):
        values = accept(TINY, **changes).grid_slice()
        assert cells_at_start(values) == make_grid(values, {}).sizes["cell"]


def test_a_file_with_a_request_is_as_one_with_those_cells(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(quote, "pilot_of", lambda *_: FOUND)
    asked = load_mine(FLAT, {"grid": {"levels": 3}, "accuracy": {"error": "15 %"}})
    assert asked.settings.accuracy == "standard"
    assert asked.requested.startswith("accuracy: cells of 2.5 m; foreseen: ")
    assert asked.grid_slice() == load_mine(FLAT, {"grid": {"levels": 3}}).grid_slice()
    text = yaml.safe_load(FLAT.read_text())
    del text["domain"]
    file = tmp_path / "derived.yaml"
    file.write_text(yaml.safe_dump(text | {"grid": {"finest_cell": "5 m"}, "accuracy": {"error": "15 %"}}))
    derived = load_mine(file)
    assert derived.finest_cell == pytest.approx(4.4)
    assert derived.text["grid"]["finest_cell"] == "4.4 m"
    shown = derived.report_slice()
    assert shown["config"]["accuracy"] == {"error": "15 %"}
    assert ReportSlice.of(json.loads(json.dumps(shown))).foreseen["own"]["cell"] == pytest.approx(4.4)
    file.write_text(yaml.safe_dump(text | {"grid": {"finest_cell": "5 m", "levels": 4}, "accuracy": {"error": "15 %"}}))
    assert load_mine(file).finest_cell == 2.5  # by halves, and its largest cells with it


def test_a_mistake_on_the_cells_that_follow_says_so(monkeypatch, tmp_path):
    """Its line named cells that stand in no file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(quote, "pilot_of", lambda *_: FOUND)
    text = yaml.safe_load(FLAT.read_text())
    del text["domain"]
    asked = {"grid": {"finest_cell": "5 m"}, "accuracy": {"memory": "0.452 GB"}, "seismic": {"link_length": "11 m"}}
    file = tmp_path / "derived.yaml"
    file.write_text(yaml.safe_dump(text | asked))
    with pytest.raises(InputError, match=r"link_length.*\(on the cells of .* m that follow from accuracy\)"):
        load_mine(file)


def test_the_cells_of_a_request_stay_whatever_is_free_at_a_later_start(monkeypatch, tmp_path):
    """They changed with the free memory and the cores of a node, and all stages ran again, or a dry run was refused."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(quote, "pilot_of", lambda *_: FOUND)
    cores = []

    class Noted(quote.Quotes):
        def __init__(self, settings, code, given):
            cores.append(given)
            super().__init__(settings, code, given)

    monkeypatch.setattr(quote, "Quotes", Noted)
    monkeypatch.setattr(command_line, "cores", 3)
    asked = {"grid": {"levels": 3}, "accuracy": {"error": "15 %"}}
    first = load_mine(FLAT, asked)
    monkeypatch.setattr(quote, "usable", lambda: 1.0)
    monkeypatch.setattr(command_line, "cores", 1)
    again = load_mine(FLAT, asked)
    assert cores == [3]
    assert (again.finest_cell, again.requested) == (first.finest_cell, first.requested)
    for other in ({"accuracy": {"error": "14 %"}}, {"materials": {"host": {"youngs_modulus": "30 GPa"}}}):
        with pytest.raises(InputError, match=r"accuracy: (an error|not to be had)"):
            load_mine(FLAT, asked | other)
    (kept,) = Path(".snakemake/requests").iterdir()
    kept.write_text("{")
    with pytest.raises(InputError, match=r"accuracy: (an error|not to be had)"):
        load_mine(FLAT, asked)


def test_a_draft_of_two_sizes_of_cell_has_no_pilot(accept):
    """It was tried on a grid of no size at all."""
    assert pilot.pilot_slices(accept(TINY, **{"grid.levels": 2, "accuracy": "draft"})) == []


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ({}, "accuracy: asks for nothing; give error, time or memory"),
        ({"error": 10}, "accuracy.error: 10 has no unit; write it as text with one, for example '10 %'"),
        ({"error": "0.5 %"}, "accuracy.error: 0.5 % is out of range"),
        ({"time": "20 m"}, "accuracy.time: '20 m' is not convertible to min"),
        ({"errors": "5 %"}, "accuracy.errors: unknown key; did you mean error?"),
        ("grand", "accuracy: 'grand' is not one of draft, standard, fine"),
    ],
)
def test_a_wrong_request_is_refused_in_one_line(refuse, value, says):
    assert says in refuse(TINY, accuracy=value)


def test_the_target_prints_the_table_and_a_request_says_which_cells_follow(tmp_path):
    file = write_mine(TINY, tmp_path / "files" / "tiny.yaml")
    status, text = snakemake(file, tmp_path, "quote")
    assert status == 0, text
    folder = tmp_path / "results" / "tiny"
    assert (folder / "quote.txt").read_text() in text
    values = json.loads((tmp_path / "logs" / "tiny" / "quote.json").read_text())
    assert values["own"]["start"] == cells_at_start(load_mine(file).grid_slice())
    made_of = values["made_of"]
    mine = load_mine(file)
    assert made_of == [config_hash(mine.slice_of(name)) for name in ("grid", "elastic")]
    (said,) = quote_of(tmp_path / "logs" / "tiny", made_of[0], 2)
    assert said.startswith("On cells of 5 m with ")
    assert " GB, error of potency and failed volume " in said
    assert quote_of(tmp_path / "logs" / "tiny", "of other cells", 2) == []
    assert quote_of(tmp_path / "logs" / "tiny", made_of[0], 3) == []
    assert quote_of(None, made_of[0], 2) == []
    status, text = snakemake(file, tmp_path, "--dry-run", "--config", "accuracy={memory: 0.1 GB}")
    assert status
    assert "accuracy: not to be had" in text
    status, text = snakemake(file, tmp_path, "--dry-run", "--config", "accuracy={memory: 1 GB}")
    assert status == 0, text
    assert "tiny: accuracy: cells of " in text
    assert not (folder / "grid.nc").exists()
