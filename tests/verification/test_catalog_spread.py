"""What a catalogue's spread consists of: variances of made-up catalogues, and a tiny study to its page."""

import json
from dataclasses import asdict
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from running import run_study, same_costs

from catalogs.figures import style
from catalogs.settings import ComparisonSettings
from catalogs.sources.size_law import FEW, NONE, POWER, TRUNCATED
from common.costs import Costs
from common.errors import InputError
from verification.catalog_spread.figure import draw
from verification.catalog_spread.runs import (
    CELLS,
    CLOSENESS,
    LOADING,
    MEMBERS,
    QUANTITIES,
    Catalogue,
    catalogue,
    read_sources,
)
from verification.catalog_spread.study import STUDY, Scene
from verification.catalog_spread.variances import values_of, variances


def made_up(potency: float, b: float = 1.0, law: str = POWER, seconds: float = 10.0) -> Catalogue:
    """A catalogue of ten events of one size."""
    return Catalogue("one", potency, [-2.0] * 10, -3.0, law, b, seconds)


def sources(**exponents: list[float]) -> dict[str, list[Catalogue]]:
    """Catalogues by source, from log10 of their potency."""
    return {name: [made_up(10.0**x) for x in values] for name, values in exponents.items()}


def of(found: pd.DataFrame, quantity: str, source: str):
    """Row of the variance of a quantity, by its key, by a source."""
    (title,) = (one.title for one in QUANTITIES if one.key == quantity)
    return found[(found["quantity"] == title) & (found["source"] == source)].iloc[0]


def test_runs_that_differ_by_chance_too_have_less_variance_of_their_own():
    """Variances by hand: members 1, loading 3, cells 1/4, closeness 4. Own: 1, 2, 0, 4."""
    runs = sources(
        members=[-1.0, 0.0, 1.0], loading=[0.0, 0.0, 3.0], cells=[-0.5, 0.0, 0.5], closeness=[-2.0, 0.0, 2.0]
    )
    found = variances(values_of(runs))
    potency = [of(found, "potency", source) for source in (MEMBERS, LOADING, CELLS, CLOSENESS)]
    assert [v.variance for v in potency] == pytest.approx([1.0, 3.0, 0.25, 4.0])
    assert [v.variance_of_its_own for v in potency] == pytest.approx([1.0, 2.0, 0.0, 4.0])
    assert [v.share for v in potency] == pytest.approx([1 / 7, 2 / 7, 0.0, 4 / 7])
    assert [potency[0].lower_95, potency[0].upper_95] == pytest.approx(
        [0.5207, 6.285], rel=1e-3
    )  # chi-square, 2 degrees of freedom
    assert np.isnan([potency[1].lower_95, potency[1].upper_95]).all()  # not drawn at random
    assert np.isnan(of(found, "largest", MEMBERS).share)  # all are one size: there is no variance to share


def test_where_b_is_not_defined_there_is_no_variance_but_a_reason():
    runs = sources(members=[0.0, 1.0, 2.0], loading=[0.0, 1.0, 2.0], cells=[0.0, 1.0, 2.0], closeness=[0.0, 1.0, 2.0])
    runs[CELLS] = [made_up(1.0), made_up(1.0, np.nan, FEW), made_up(1.0, np.nan, NONE)]
    found = variances(values_of(runs))
    cells = of(found, "b", CELLS)
    assert np.isnan([cells.variance, cells.standard_deviation, cells.variance_of_its_own, cells.share]).all()
    assert cells.defined_in == 1
    assert cells.not_defined == "too few events in 1, no power law in 1 of 3"
    assert np.isnan(of(found, "b", MEMBERS).share)  # the sum is not known
    assert of(found, "b", MEMBERS).not_defined == ""


def events_of(sizes: np.ndarray) -> xr.Dataset:
    """A dataset of resolved events, of these log10 potencies from 1e-3 m3 on."""
    potency = 10.0**sizes
    attributes = {"potency_floor": 1e-3, "budget": json.dumps({"particle_scalars": float(potency.sum())})}
    return xr.Dataset(
        {"potency": ("event", potency), "resolved": ("event", np.ones(len(sizes), int))}, attrs=attributes
    )


def test_b_is_that_of_a_power_law_or_none():
    """b 1 of 400 drawn events within four standard errors, 5 % each; two sizes a decade apart follow no law."""
    rng, settings = np.random.default_rng(1), ComparisonSettings()
    drawn = -3.0 + rng.exponential(1 / np.log(10.0), 400)
    found = catalogue("drawn", events_of(drawn), settings)
    assert found.law == POWER
    assert found.b == pytest.approx(1.0, abs=0.2)
    assert found.potency == pytest.approx((10.0**drawn).sum())
    heaps = np.concatenate([-2.0 + 0.1 * rng.random(100), -1.0 + 0.1 * rng.random(100)])
    for sizes, law in ((heaps, NONE), (drawn[:5], FEW)):
        found = catalogue("other", events_of(sizes), settings)
        assert (found.law, np.isnan(found.b)) == (law, True)


def test_the_table_says_what_an_ensemble_costs_and_buys():
    runs = sources(
        members=[-1.0, 0.0, 1.0], loading=[0.0, 0.0, 3.0], cells=[-0.5, 0.0, 0.5], closeness=[-2.0, 0.0, 2.0]
    )
    written = json.loads(json.dumps(asdict(Scene(made_up(1.0, 1, POWER, 8.0), runs))))
    table = STUDY.tables({"made_up": written})["table"]
    assert len(table) == 20
    members = table[table.source == "perturbed members"].set_index("quantity")
    assert set(members.member_cost) == {1.25}
    assert members.loc["log10 seismic potency", "share"] == pytest.approx(1 / 7)
    assert table.member_cost.notna().sum() == len(members)
    assert list(STUDY.figures({"made_up": written})) == ["made_up"]
    # A title and the head of each table stand above its lines.
    assert [len(shown.lines(table)) for shown in STUDY.shown] == [24, 5]


def named(labels: list[str], values: list[float], undefined: list[str]) -> list[Catalogue]:
    """Runs whose potency and b are `values`, and as many more without b as there are laws in `undefined`."""
    runs = [(value, value, POWER) for value in values] + [(1.0, np.nan, law) for law in undefined]
    return [
        Catalogue(label, 10.0**potency, np.linspace(-2.0, potency, 9).tolist(), -3.0, law, b)
        for label, (potency, b, law) in zip(labels, runs, strict=True)
    ]


def test_no_text_of_the_figure_lies_on_another():
    """Long names close to each other, and runs without b for every reason."""
    runs = {
        MEMBERS: named(list("1234567"), [1.0, 1.1, 1.2, 1.3], [NONE, FEW, TRUNCATED]),
        LOADING: named(["1", "4", "16", "by their error"], [1.3, 1.14, 1.12], [NONE]),
        CELLS: named(["2.5 m", "by their error", "1.25 m"], [1.1, 1.0, 1.19], []),
        CLOSENESS: named(["0.7", "0.8", "0.9"], [1.1], [TRUNCATED, FEW]),
    }
    with style.applied():
        figure = draw(runs[CELLS][0], runs)
        figure.draw_without_rendering()
    for panel in figure.axes:
        texts = [text for text in (*panel.texts, *panel.get_yticklabels(), panel.title) if text.get_text()]
        boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
        assert [(one, other) for (one, a), (other, b) in combinations(boxes, 2) if a.overlaps(b)] == []
    ticks = [label.get_text() for label in figure.axes[2].get_yticklabels()]
    assert ticks == ["perturbed members\nin 4 of 7 runs", "way of loading\nin 3 of 4 runs", "finest cell",
                     "closeness\nin 1 of 3 runs"]  # fmt: skip


def test_a_study_runs_to_its_table(tmp_path):
    """The stope on cells of 5 and 2.5 m: two of them have no variance, and closeness changes no potency."""
    variants = {
        "base": {"grid": {"levels": 2}, "ensemble": 3},
        "once": {"grid": {"levels": 2}, "solver": {"increments": 1}},
        "four": {"grid": {"levels": 2}, "solver": {"increments": 4}},
        "fine": {"grid": {"levels": 3}},
    }
    rock = {"materials": {"host": {"variability": {"length": "10 m"}}}}
    results = run_study("spread_stope", tmp_path, {name: changes | rock for name, changes in variants.items()})
    results.study.settings.update(loading=["once", "four", "base"], cells=["base", "fine"])
    results["base"].costs = same_costs(Costs(90.0, 5.0, 1.0, 300.0), members=Costs(90.0, 7.0, 1.0, 300.0))
    scene = Scene.of(results)
    assert scene.base.seconds == 12.0  # of two steps and the events of both, compiling left out
    assert scene.member_cost == 1.5
    assert [[run.label for run in runs] for runs in scene.sources.values()] == [
        ["1", "2", "3"],
        ["1", "4", "by their error"],
        ["5 m", "2.5 m"],
        ["0.7", "0.8", "0.9"],
    ]
    potency = {source: of(scene.table, "potency", source).variance for source in scene.sources}
    assert potency[MEMBERS] > 0.0
    assert potency[LOADING] > 0.0
    assert np.isnan(potency[CELLS])
    assert potency[CLOSENESS] == pytest.approx(0.0, abs=1e-20)
    assert scene.sources[CLOSENESS][1].sizes == scene.base.sizes  # 0.8 is the mine's own
    written = {"spread_stope": asdict(scene)}
    table = STUDY.tables(written)["table"]
    assert len(table.drop_duplicates(["quantity", "source"])) == len(table) == 20
    assert set(table.member_cost.dropna()) == {1.5}
    assert len(STUDY.figures(written)["spread_stope"].axes) == 6


@pytest.mark.parametrize(
    ("change", "ensemble", "message"),
    [({"cells": ["tiny"]}, 2, "settings: no variant 'tiny'"), ({}, 1, "variants.base.ensemble: a variance takes two")],
)
def test_a_study_that_lacks_runs_is_refused_in_one_line(tmp_path, change, ensemble, message):
    results = run_study("spread_stope", tmp_path, {"base": {"ensemble": ensemble}})
    results.study.settings.update({"loading": ["base"], "cells": ["base"]} | change)
    with pytest.raises(InputError, match=message):
        read_sources(results)
