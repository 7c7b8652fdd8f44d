"""Sizes of events by several rules, and what the report tells of them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catalogs.report.sections import section_number
from catalogs.report.sections.sizes import intervals_contain, rule_rows, unlike
from catalogs.sources.sizes import estimate_b, log_potency
from common.errors import InputError
from seismic.catalog import merge
from seismic.event_settings import EventSettings
from seismic.events import CLOSENESS_TRIED, extract_events, failed_rock, sizes_by_rule


def test_each_rule_has_the_events_that_an_extraction_with_it_has(make_scattered_step, make_settings):
    """Two steps, one after the other; the mine's own rule first, each once."""
    steps = [make_scattered_step(seed) for seed in (0, 1)]
    chosen = make_settings(method="simultaneous", closeness=0.85, least_particles=2, link_length="2.5 m")
    del chosen["cluster"]
    found = sizes_by_rule(iter(steps), chosen)
    rules = list(zip(found.closeness.values, found.link_length.values, found.parts.values, strict=True))
    others = [(value, 2.5, 4) for value in CLOSENESS_TRIED]
    assert rules == [(0.85, 2.5, 4), *others, (0.85, 3.75, 4), (0.85, 5.0, 4), (0.85, 2.5, 2), (0.85, 2.5, 1)]
    numbers = []
    for index, (value, length, parts) in enumerate(rules):
        expected = []
        for step in steps:
            rule = chosen | {"closeness": value, "link_length": f"{length} m"}
            events, _ = extract_events(step.assign_attrs(parts=parts), rule)
            expected += events.potency.values[events.resolved.values == 1].tolist()
        assert expected
        assert_array_equal(found.potency.values[found.rule.values == index], expected)
        numbers.append(len(expected))
    assert len(set(numbers)) >= len(rules) / 2


def test_families_have_neither_links_nor_parts(make_scattered_step, make_settings):
    found = sizes_by_rule([make_scattered_step(0)], make_settings())
    assert_array_equal(np.sort(found.closeness), CLOSENESS_TRIED)
    assert_array_equal(found.link_length, 0.0)
    rows = rule_rows(SimpleNamespace(event_rules=found), -10.0)
    assert {row["link_length"] for row in rows} == {""}
    assert sizes_by_rule([], make_settings()).sizes == {"event": 0, "rules": 0}


def test_rows_and_sentence_say_what_the_sizes_are(make_scattered_step, make_settings):
    chosen = make_settings(method="simultaneous", least_particles=1)
    del chosen["cluster"]
    found = sizes_by_rule([make_scattered_step(0, 900)], chosen)
    evidence = SimpleNamespace(event_rules=found)
    cut = float(np.median(log_potency(found.potency.values)))
    rows = rule_rows(evidence, cut)
    assert [row["closeness"] for row in rows] == ["0.8", "0.6", "0.7", "0.9", "0.95", *["0.8"] * 4]
    assert [row["link_length"] for row in rows] == [*["4"] * 5, "6", "8", "4", "4"]
    assert [row["parts"] for row in rows] == [*["4"] * 7, "2", "1"]
    assert [row["own"] for row in rows] == [True, *[False] * 8]
    for index in (3, 6):
        own = log_potency(found.potency.values[found.rule.values == index])
        assert_array_equal(rows[index]["b"], estimate_b(own, cut).b)
        assert rows[index]["events"] == str(len(own))
        assert rows[index]["largest"].replace("−", "-") == f"{own.max():.2f}"
    (sentence,) = intervals_contain(SimpleNamespace(comparison=None), rows)
    b = [row["b"] for row in rows if np.isfinite(row["b"])]
    assert f"by the rules tried, b is {min(b):.2f} to {max(b):.2f} (section {section_number('sizes')})" in sentence
    assert intervals_contain(SimpleNamespace(comparison=None), []) == []
    assert rule_rows(SimpleNamespace(event_rules=None), cut) == []


def test_a_rule_that_another_rock_has_is_refused(make_scattered_step):
    """An earlier version's step has no loads."""
    step = make_scattered_step().drop_vars("convergence_load")
    with pytest.raises(InputError, match="not a mining step, it lacks convergence_load"):
        failed_rock(step, EventSettings(mine="testmine", frame={"surface": "0 m"}))


def test_share_of_unlike_rock(make_scattered_step, make_settings):
    """Of a catalogue: the shares of its steps, weighted by what their particles released."""
    chosen = make_settings(method="simultaneous", closeness=0.8)
    del chosen["cluster"]
    steps = [extract_events(make_scattered_step(seed, step=f"s{seed}", step_index=2), chosen)[0] for seed in (0, 1)]
    catalog = merge([step.assign_attrs(unlike_share=share) for step, share in zip(steps, (0.1, 0.5), strict=True)])
    weights = [json.loads(step.attrs["budget"])["particle_scalars"] for step in steps]
    assert weights[0] != weights[1]
    assert catalog.attrs["unlike_share"] == pytest.approx(np.average([0.1, 0.5], weights=weights))
    assert unlike(SimpleNamespace(catalog=catalog)).startswith(f"{100 * catalog.attrs['unlike_share']:.2g} % of")
    assert unlike(SimpleNamespace(catalog=catalog.isel(event=[]))) == ""
