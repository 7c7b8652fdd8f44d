"""The report's section on shaking: what it says, and what it says where there is little to say."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from shaking_fixtures import catalogue, scattered
from test_shaking_stage import SUPPORT, shake

from catalogs.report.gallery import Gallery
from catalogs.report.sections.shaking import MAX_DEMANDS, brief, section, worst_steps

MOTION = {"displacement": 200.0, "depth": {"roof": 1.0, "walls": 0.5}}


@pytest.fixture
def gallery(tmp_path) -> Gallery:
    return Gallery(tmp_path)


def test_the_opening_that_is_shaken_most_comes_first(gallery):
    """By the chance in the middle; each opening in the step in which its velocity is largest."""
    shaking = shake(catalogue(*scattered(80)), ground_motion=MOTION, support=SUPPORT)
    shown = section(SimpleNamespace(shaking=shaking), gallery)
    velocity = shaking["velocity"].sel(chance=0.1)
    step, opening = np.unravel_index(np.nanargmax(velocity.values), velocity.shape)
    first = f"{shaking['opening'].values[opening]} in {shaking['step'].values[step]}"
    assert shown["headline"].startswith(f"Most is felt by {first}: with a chance of 10 %")
    assert len(shown["rows"]) == 3
    assert shown["rows"][0]["opening"] == shaking["opening"].values[opening]
    assert (gallery.folder / "shaking.svg").stat().st_size > 10_000
    assert first in shown["caption"]
    assert len(shown["demands"]) == 3 * 2 <= MAX_DEMANDS
    demands = [float(row["demand"]) for row in shown["demands"]]
    assert demands == sorted(demands, reverse=True)
    assert {row["carried_by"] for row in shown["demands"]} <= {"mesh", "yielding", "none: the demand is above all"}


def test_the_sentences_say_what_the_chances_rest_on(gallery):
    runs = [catalogue(*scattered(40, seed)) for seed in range(5)]
    shaking = shake(runs[0], members=runs[1:])
    shown = section(SimpleNamespace(shaking=shaking.assign_attrs(dispersion=3.0, event_ratio=0.25)), gallery)
    assert (
        shown["runs"] == ", as the mean of 5 runs; events cluster, with a variance of their number 3.0 times its mean"
    )
    assert shown["ratio"].startswith("The record has 4.0 events for each modelled one")
    assert shown["demands"] == []


def test_little_to_say_is_said(gallery):
    """No section without the key; no event; too few events for the chance; nothing mined."""
    assert section(SimpleNamespace(shaking=None), gallery) == {}
    silent = section(SimpleNamespace(shaking=shake(catalogue([], np.empty((0, 3)), []))), gallery)
    assert silent["headline"].startswith("The model has no resolved event")
    assert silent["figure"] is None
    members = [catalogue([], np.empty((0, 3)), [])] * 19
    few = shake(catalogue([0.0], [[10.0, 10.0, 2.0]], [1]), members=members)  # 0.05 events in a step
    shown = section(SimpleNamespace(shaking=few), gallery)
    assert shown["headline"].startswith("No opening has enough modelled events")
    assert shown["figure"] is None
    unmined = shake(catalogue(*scattered(10)), openings=[])
    assert section(SimpleNamespace(shaking=unmined), gallery)["headline"] == "No opening is mined in these steps."
    assert worst_steps(unmined, 1) == []


def test_the_first_page_names_the_largest_demand_beside_the_support():
    """That of the table's first row, with the weakest class that is stated to bear it."""
    events = catalogue(*scattered(80))
    assert brief(SimpleNamespace(shaking=None)) == ""
    assert brief(SimpleNamespace(shaking=shake(events))).endswith("m/s.")
    without = brief(SimpleNamespace(shaking=shake(events, ground_motion=MOTION)))
    assert without.endswith(" kJ/m² in 2019-08.")
    strong = [{"name": "mesh", "energy": 1e4, "displacement": 200.0}]
    assert brief(SimpleNamespace(shaking=shake(events, ground_motion=MOTION, support=strong))) == (
        f"{without[:-1]}, below the capacity of mesh."
    )
    later = shake(events, ground_motion=MOTION)  # failed rock is deeper in a step with less shaking
    first = later["velocity"].sel(chance=0.1).max("opening").argmax().item()
    other = (first + 1) % later.sizes["step"]
    later["demand"][{"step": other}] *= 50.0
    assert brief(SimpleNamespace(shaking=later)).endswith(f"kJ/m² in {later['step'].values[other]}.")
    weak = [{"name": "mesh", "energy": 1e-9, "displacement": 200.0}]
    assert brief(SimpleNamespace(shaking=shake(events, ground_motion=MOTION, support=weak))) == (
        f"{without[:-1]}, above every stated capacity."
    )


def test_the_page_promises_nothing():
    """No word of safety, and the limits stand there."""
    text = (Path(__file__).parents[2] / "catalogs/report/sections/shaking.html.j2").read_text()
    assert "safe" not in text.lower()
    for said in ("No waveforms are computed", "no response of the site", "when people may return", "stated"):
        assert said in text
