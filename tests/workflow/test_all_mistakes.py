"""All mistakes of a mine's file at once: a line for each, in the file's order, and none that follows from another."""

import copy

import numpy as np
import pytest
import yaml
from large_mines import large_mine
from tiny_mines import TINY, box, changed, merged, snakemake, write_mine

from common.errors import InputError
from verification.extremes.bad_input import FAULTS
from workflow.configuration import MAX_MISTAKES_SHOWN, load

PAIRS = 150


@pytest.fixture
def lines(tmp_path):
    """The lines that a mine is refused with, without its file's name; none if it is taken."""

    def refused(mine: dict, is_written: bool = True, **overrides) -> list[str]:
        file = tmp_path / "mine.yaml"
        if is_written:
            write_mine(mine, file)
        try:
            load(merged(mine | overrides), file, overrides=overrides)
        except InputError as error:
            return [line.removeprefix(f"{file}: ") for line in error.lines]
        return []

    return refused


def is_near(one: str, other: str) -> bool:
    """Whether a change of one key may undo that of the other."""
    first, second = one.split("."), other.split(".")
    short = min(len(first), len(second), 2)
    return first[:short] == second[:short]


def test_two_mistakes_are_two_lines_and_nothing_follows_from_them(lines):
    """Pairs of the known mistakes: what each says by itself, and no more. One may hide the other only where nothing can
    be said of the second without the first: of an excavation's place in a domain that is upside down."""
    random, alone, both, pairs = np.random.default_rng(1), {}, 0, 0
    assert not lines(TINY)  # writes the record
    while pairs < PAIRS:
        chosen = random.choice(len(FAULTS), 2, replace=False)
        (one, first, *_), (other, second, *_) = (FAULTS[number] for number in chosen)
        if is_near(one, other):
            continue
        for number, key, value in zip(chosen, (one, other), (first, second), strict=True):
            alone.setdefault(number, lines(changed(TINY, **{key: value}), is_written=False))
        found = lines(changed(changed(TINY, **{one: first}), **{other: second}), is_written=False)
        expected = {line for number in chosen for line in alone[number]}
        assert found, (one, other)
        assert set(found) <= expected, (one, other)
        pairs, both = pairs + 1, both + (set(found) == expected)
    assert both > 0.9 * PAIRS


def test_mistakes_of_all_kinds_come_in_the_order_of_the_file(lines):
    """What YAML makes of a value, a type, a unit, a slip of the keyboard, a name that is none, a check of sections."""
    mine = changed(
        TINY,
        **{
            "steps.1.end": "2019-08-01",
            "excavations.2.fill": "paste",
            "excavations.0.radius": "3 m",
            "excavations.1.lower": ["30 m", 40, "25 m"],
            "materials.fill.youngs_modulu": "1 GPa",
            "materials.host.cohesion": {"intact": "1 MPa", "residual": "2 MPa"},
            "materials.host.friction_angle": {"intact": "30 deg", "residual": "40 deg"},
            "grid.levles": 3,
            "solver.damping": 7,
            "solver.tolerance": "1e400",
            "name": "x y",
        },
    )
    del mine["materials"]["fill"]["youngs_modulus"]
    begins = [
        "name: 'x y' does not match",
        "grid.levles: unknown key; did you mean levels?",
        "materials.host.friction_angle: residual 40 is above",
        "materials.host.cohesion: residual 2e+06 is above",
        "materials.fill.youngs_modulu: unknown key; did you mean youngs_modulus?",
        "excavations.drive.radius: not a key of box",
        "excavations[1].lower[1]: 40 has no unit",
        "excavations.stope_2.fill: 'paste' is not one of",
        "steps.2019-08.end: 2019-08-01 is not after",
        "solver.tolerance: inf is not a finite number",
        "solver.damping: 7 is not below the maximum",
    ]
    found = lines(mine)
    assert len(found) == len(begins), found
    for line, begin in zip(found, begins, strict=True):
        assert line.startswith(begin)


def test_hundreds_of_mistakes_are_twenty_lines_and_their_number(tmp_path):
    """Of a large mine: each excavation is looked at once."""
    mine = large_mine(5000, 200)
    for entry in mine["excavations"]:
        entry["fill"] = "paste"
    file, config = write_mine(mine, tmp_path / "mine.yaml"), merged(mine)
    with pytest.raises(InputError) as refused:
        load(config, file)
    found = [line.removeprefix(f"{file}: ") for line in refused.value.lines]
    assert len(found) == MAX_MISTAKES_SHOWN + 1
    assert found[-1] == f"and {5000 - MAX_MISTAKES_SHOWN} more mistakes"
    assert found[0].startswith("excavations.stope_0.fill: 'paste' is not one of")


def test_solids_that_all_lie_outside_are_one_mistake(lines):
    """The domain's, or a shift of all coordinates."""
    mine = copy.deepcopy(TINY)
    del mine["record"]
    far = changed(mine, **{"domain.lower": ["1000 m", "0 m", "0 m"], "domain.upper": ["1080 m", "80 m", "80 m"]})
    (line,) = lines(far)
    assert line.startswith("excavations.drive: lies, as all others do, outside the domain")
    away = [
        box("drive", "history", [200, 30, 40], [210, 40, 50]),
        box("stope_1", "2019-08", [300, 40, 25], [310, 55, 50]),
    ]
    assert len(lines(changed(mine, excavations=[*away, mine["excavations"][2]]))) == 2


def test_what_the_command_line_says_is_told_under_its_name(lines, tmp_path):
    """The file is not to blame."""
    found = lines(changed(TINY, **{"solver.damping": 3}), solver=TINY["solver"] | {"increments": 2.5}, accuracy="fast")
    assert sorted(found) == [
        "--config: accuracy: 'fast' is not one of draft, standard, fine",
        "--config: solver.increments: 2.5 is not of type 'integer'",
    ]
    file = write_mine(changed(TINY, **{"solver.damping": 3}), tmp_path / "mine.yaml")
    status, text = snakemake(file, tmp_path, "--dry-run", "--config", "solver={increments: 2.5}")
    assert status != 0
    said = [line for line in text.splitlines() if "Using workflow specific profile" not in line]
    assert len(said) == 2
    assert said[0].endswith("mine.yaml: solver.damping: 3 is not below the maximum of 1")
    assert said[1] == "--config: solver.increments: 2.5 is not of type 'integer'"


def test_a_list_that_is_replaced_on_the_command_line_is_its_own(lines):
    """Also where a check across sections finds the mistake in it."""
    steps = yaml.safe_load("[{name: history}, {name: '2019-08', start: 2019-08-01, end: '2019-07-01'}]")
    assert lines(TINY, steps=steps) == ["--config: steps.2019-08.end: 2019-07-01 is not after start 2019-08-01"]


def test_a_name_that_is_no_text_is_refused_as_such(lines):
    """A list or a section where the name of an entry stands."""
    for wrong in (["drive"], {"drive": 1}):
        assert lines(changed(TINY, **{"excavations.0.name": wrong})) == [
            f"excavations[0].name: {wrong} is not of type 'string'"
        ]
