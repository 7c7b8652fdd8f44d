"""The numerics at their limits: some of each knob, judges, balances, the table; all: ``snakemake stability``."""

import itertools
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from verification.extremes.outcomes import ENDED as RUN_ENDED
from verification.extremes.outcomes import RESTS, run
from verification.extremes.relations import RELATIONS
from verification.frame import give_verdict
from verification.rows import KnownMiss
from verification.scenes import coulomb, elastic, failing, hole, mirrored, section
from verification.stability import KEYS, SEVERAL_SEEDS
from verification.stability.balances import broken, lacking
from verification.stability.cases import Case, Knob
from verification.stability.judges import closure_error, front, same_motion
from verification.stability.knobs import BY_KEY, knob_of
from verification.stability.points import (
    ENDED,
    FAULT,
    REFUSED,
    RIGHT,
    SOUND,
    WRONG,
    Point,
    measure,
)
from verification.stability.shapes import courant
from verification.stability.study import figures, ranges, tables
from verification.studies import merge

CHOSEN = {  # knob: series and values of it that run in the tests; the quick ones at the ends
    "stiffness": [("filled tunnel", 1e-8), ("filled tunnel", 1e8), ("two layers", 1e8)],
    "poisson": [("tunnel", 0.0), ("tunnel", 0.4999), ("tunnel, 4 particles", 0.4999), ("tunnel", 0.5)],
    "friction": [("plastic tunnel", 0.0), ("plastic tunnel", 60.0)],
    "cohesion": [("plastic tunnel", 1e8)],
    "dilation": [("above friction", 40.0), ("above friction, allowed", 40.0)],
    "stress": [("tunnel", 1e3), ("tunnel", 1e10)],
    "size": [("tunnel", 1e-3), ("tunnel", 1e5)],
    "offset": [("tunnel, cells exact in binary", 1e6)],
    "levels": [("tunnel, 3 rings", 1), ("tunnel, 3 rings", 9)],
    "length": [("column of 2 cells", 512)],
    "tolerance": [("tunnel, multigrid", 1e-15)],
    "walls": [("box moved along x, mean", 0.5)],
    "time_step": [("tunnel", 0.75), ("tunnel", 1.5)],
    "damping": [("tunnel", 0.0), ("tunnel", 1.0)],
    "float32": [("tunnel, multigrid", 1e-3), ("tunnel, multigrid", 1e-10)],
    "shapes": [("explicit, beside multigrid", "touching at an edge"), ("beside its mirror image", "a floating block")],
}


@pytest.mark.parametrize("key", CHOSEN)
def test_a_knob_at_its_ends_is_right_or_says_why_not(key):
    """As the target does, a few cases of each."""
    knob = BY_KEY[key]
    cases = [case for case in knob.cases() if (case.series, case.value) in CHOSEN[key]]
    assert len(cases) == len(CHOSEN[key])
    points = measure(Knob(key, knob.title, knob.scale, knob.about, lambda: cases))
    assert [(point.series, point.value, point.message) for point in points if point.passed == "no"] == []


def test_every_knob_has_cases_and_a_key():
    assert set(BY_KEY) < set(KEYS)
    for knob in map(knob_of, KEYS):
        cases = list(itertools.islice(knob.cases(), 400))
        assert len({(case.series, case.value) for case in cases}) == len(cases), knob.key


def test_scenes_are_drawn_by_the_seeds_that_a_key_names():
    """A fifth of them beside itself; the target `extremes` runs each of its seeds once."""
    cases = list(knob_of("seeds_104_107").cases())
    assert [(case.series, case.value) for case in cases] == [
        ("by itself", 104),
        *((f"beside itself, {name}", 105) for name in RELATIONS),
        ("by itself", 106),
    ]
    seeds = [case.value for key in SEVERAL_SEEDS for case in knob_of(key).cases()]
    assert list(dict.fromkeys(seeds)) == list(range(400))
    with pytest.raises(KeyError, match="seeds_1"):
        knob_of("seeds_1")


def points_of(*cases: Case) -> list[Point]:
    return measure(Knob("length", "made up", "linear", "", lambda: cases))


def test_a_wrong_answer_fails_unless_it_is_known_and_no_worse_than_that():
    """The same run, judged as wrong by 0.3."""

    def judge(values, outcome, run):
        return 0.3

    cases = [Case("s", number, hole(), judge, 0.1, known) for number, known in
             enumerate((None, KnownMiss("so it is", 0.4), KnownMiss("so it was", 0.2)))]  # fmt: skip
    points = points_of(*cases)
    assert [point.kind for point in points] == [WRONG] * 3
    assert [point.passed for point in points] == ["no", "known miss", "no"]
    assert points[1].known == "so it is"


def test_energy_that_is_lacking_is_known_to_its_size():
    """Explicit steps in single precision: right to the last digits, with an energy balance that is not."""
    case = next(case for case in BY_KEY["float32"].cases() if (case.series, case.value) == ("tunnel, explicit", 1e-9))
    assert case.known is not None
    points = points_of(case, replace(case, known=replace(case.known, at_most=1e-6)), replace(case, known=None))
    assert [point.kind for point in points] == [WRONG] * 3
    assert [point.passed for point in points] == ["known miss", "no", "no"]
    assert points[0].error < 1e-5
    assert "the energy balance lacks" in points[0].message


def test_a_solution_that_ends_is_told_from_a_refusal():
    """Both are one line: rock that runs away, and a key out of range."""
    away, refused = points_of(
        Case("s", 1, hole(pressure=1e12), None, 0.0), Case("s", 2, hole(solver={"damping": 1.0}), None, 0.0)
    )
    assert (away.kind, refused.kind) == (ENDED, REFUSED)
    assert "runs away" in away.message
    assert refused.message.startswith("solver.damping: ")


def test_a_mistake_that_is_let_through_is_wrong_and_other_words_are_a_fault():
    scene = hole(solver={"damping": 1.0})
    told, other, through = points_of(
        Case("s", 1, scene, None, 0.0, refused=("solver.damping: ", "1")),
        Case("s", 2, scene, None, 0.0, refused=("solver.scheme: ", "1")),
        Case("s", 3, hole(), None, 0.0, refused=("solver.damping: ", "1")),
    )
    assert (told.kind, other.kind, through.kind) == (REFUSED, FAULT, WRONG)
    assert (told.passed, other.passed, through.passed) == ("yes", "no", "no")


def test_several_particles_are_refused_in_rock_that_hardly_changes_its_volume(tmp_path):
    """They lock: a hole at 0.4999 closed by a quarter of what it should. One particle to a cell does not."""
    host = {"materials": {"host": elastic(poisson=0.495)}}
    outcome = run(hole(**host, grid={"particles_per_cell": 4}), tmp_path)
    assert "materials.host.poisson_ratio: 0.495 locks cells of 4 particles" in outcome.message
    assert "\n" not in outcome.message
    assert run(hole(**host), tmp_path).kind == RESTS


def test_hourglass_stiffness_lets_rock_of_constant_volume_bend(tmp_path):
    """With all of lambda in it, a hole at 0.4999 closed by 41 % too little; 5 %: cells an eighth of its radius."""
    scene = hole(materials={"host": elastic(poisson=0.4999)}, domain={"boundary": "traction"})
    assert closure_error(scene, run(scene, tmp_path)) < 0.05


@pytest.fixture(scope="module")
def tunnel(tmp_path_factory):
    """A plastic tunnel at rest, with its configuration."""
    scene = failing(coulomb())
    return scene, run(scene, tmp_path_factory.mktemp("tunnel"))


SPOILED = {
    "mass": lambda state: state.attrs.update(mass=1.001 * state.attrs["mass"]),
    "negative volume": lambda state: state.volume.values.__setitem__(0, -1e-3),
    "momentum_error": lambda state: state.attrs.update(momentum_error=1e-6),
    "gained": lambda state: state.attrs.update(energy_gained=1e-3 * state.attrs["energy_motion"]),
    "dissipated": lambda state: state.attrs.update(energy_dissipated=-1.0),
}


def test_a_plastic_tunnel_is_balanced(tunnel):
    scene, outcome = tunnel
    assert broken(scene, outcome) == []
    for name in ("elastic", "history"):
        attributes = outcome.stored[name].attrs
        assert attributes["mass"] == pytest.approx(2700.0 * (96.0**2 - 16.0 * np.pi), rel=1e-4)
        assert attributes["momentum_error"] < 1e-12
        assert attributes["net_force"] < 1e-3 * 20e6 * 96.0


@pytest.mark.parametrize("what", SPOILED)
def test_what_is_not_balanced_is_seen(what, tunnel):
    """Each balance by itself."""
    scene, outcome = tunnel
    name = "elastic" if what == "mass" else "history"
    kept = outcome.stored[name]
    outcome.stored[name] = kept.copy(deep=True)
    try:
        SPOILED[what](outcome.stored[name])
        assert broken(scene, outcome)
    finally:
        outcome.stored[name] = kept


def test_energy_that_is_lacking_is_told(tunnel):
    """10 % of the work set free, where only round-off may be missing."""
    _, outcome = tunnel
    assert lacking(outcome)[1] == ""
    kept = outcome.stored["elastic"].attrs["energy_left"]
    outcome.stored["elastic"].attrs["energy_left"] = 0.1 * outcome.stored["elastic"].attrs["energy_released"]
    share, line = lacking(outcome)
    outcome.stored["elastic"].attrs["energy_left"] = kept
    assert share == pytest.approx(0.1, rel=0.01)
    assert line.startswith("elastic: the energy balance lacks 0.1")


def test_the_front_without_friction_is_the_limit_of_the_one_with_hardly_any():
    scenes = [failing(coulomb(angle, 8e6, 0.0)) for angle in (0.0, 1e-4)]
    assert front(scenes[0]) == pytest.approx(front(scenes[1]), rel=1e-4)


def test_a_mirrored_section_moves_as_the_mirror_says_and_a_moved_one_does_not(tmp_path):
    scene = section([(-6, 10, -2, 14)])
    outcome = run(scene, tmp_path)
    assert same_motion(mirrored, turn=-1)(scene, outcome, lambda values: run(values, tmp_path)) < 1e-4
    moved = section([(-5, 10, -1, 14)])
    assert same_motion(lambda values: moved)(scene, outcome, lambda values: run(values, tmp_path)) > 0.1


def test_a_driven_time_step_is_the_body_s_own_again_afterwards(tmp_path):
    scene = hole(solver={"scheme": "explicit"})
    with courant(1.5, 0.7):
        assert run(scene, tmp_path).kind != RESTS
    outcome = run(scene, tmp_path)
    assert outcome.kind == RESTS
    assert outcome.kind != RUN_ENDED


def made_up(knob: str, kinds: str) -> list[Point]:
    """Points of a knob by the first letters of their kinds; the error of the wrong ones grows."""
    letters = {"r": RIGHT, "s": SOUND, "w": WRONG, "e": ENDED, "x": REFUSED, "f": FAULT}
    return [
        Point(knob, "series", float(number), letters[letter], 0.01 * number if letter in "rw" else np.nan, 0.1,
              "" if letter in "rsw" else "a < b", "", "no" if letter == "f" else "yes", 1.0, 1.0, 1e-16, 0.0, 0.0)
        for number, letter in enumerate(kinds)
    ]  # fmt: skip


def results_of(**kinds: str) -> dict[str, list[dict]]:
    """Results of cases as their files hold them, from the kinds of the runs of each knob."""
    return {key: [asdict(point) for point in made_up(key, letters)] for key, letters in kinds.items()}


def test_stretches_of_a_series_are_told_with_their_largest_error():
    found = ranges(pd.DataFrame(made_up("stress", "rrwwe")))
    told = list(found[["from", "to", "ends", "largest_error"]].itertuples(index=False, name=None))
    assert told[:2] == [(0.0, 1.0, RIGHT, 0.01), (2.0, 3.0, WRONG, 0.03)]
    assert told[2][:3] == (4.0, 4.0, ENDED)
    assert np.isnan(told[2][3])


def test_the_table_has_every_run_and_the_verdict_names_the_first_fault(tmp_path):
    results = results_of(**{key: "rswexf" if key == "size" else "rr" for key in KEYS})
    table = tmp_path / "table.csv"
    made = tables(results)
    assert {"knob", "series", "from", "to"} < set(made["ranges"])
    made["table"].to_csv(table, index=False)
    with pytest.raises(InputError, match=r"^1 of 44 rows fail \(size: series: 5.0: fault\); see .*table\.csv"):
        give_verdict("stability", table)
    sound = {key: [point for point in points if point["passed"] != "no"] for key, points in results.items()}
    tables(sound)["table"].to_csv(table, index=False)
    give_verdict("stability", table)
    assert len(figures(results)["figure"].axes) == 18  # a panel for each knob with an axis, in rows of three


def test_random_scenes_alone_have_tables_and_no_figure():
    results = results_of(**dict.fromkeys(SEVERAL_SEEDS, "rx"))
    assert len(tables(results)["table"]) == 2 * len(SEVERAL_SEEDS)
    assert tables(results)["ranges"].empty
    assert figures(results) == {}


def test_merge_keeps_what_a_scene_does_not_change():
    """Scenes are data: a change to one must not reach the next."""
    assert hole(solver={"tolerance": 1.0})["solver"]["increments"] == 4
    assert merge(hole(), {}) == hole()
