"""The section on source parameters: what model and record have, and what it says where something is missing."""

import numpy as np
import pytest
import report_fixtures as fixtures
from catalog_fixtures import made_up_catalog
from csv_fixtures import read, refused

from catalogs.report.sections import parameters as page
from catalogs.sources.largest_possible import largest_possible
from catalogs.sources.source_parameters import parameters
from common.event_table import RADIATED_ENERGY

CSV = "time,x,y,z,mw,E\n" + "".join(
    f"2019-08-{1 + number % 28:02d}T0{number % 10}:00:00,{100 + 7 * number},{200 + 3 * number},300,{-1 + 0.1 * number},"
    f"{'' if number == 5 else 10 ** (0.15 * number)}\n"
    for number in range(20)
)
COLUMNS = {"time": "time", "x": "x", "y": "y", "z": "z", "mw": "mw", "energy": "E"}


class Gallery:
    def __init__(self):
        self.figures = {}

    def add(self, name, figure):
        figure.canvas.draw()
        self.figures[name] = figure
        return {"name": name}


@pytest.fixture
def evidence(mine):
    found = fixtures.evidence_of(**mine.arguments())
    catalog = found.catalog
    energy = 1e6 * catalog["potency"].values ** 1.1
    found.source_parameters = parameters(catalog, energy, 3, None)
    return found


def test_energy_of_a_record_is_kept_beside_its_sizes(tmp_path):
    """A column of energies needs no conversion where there is another size; the event without one has NaN."""
    record = read(tmp_path, CSV, COLUMNS)
    energy = record[RADIATED_ENERGY.name].values
    assert np.isnan(energy[5])
    expected = [10 ** (0.15 * number) for number in range(20) if number != 5]
    np.testing.assert_allclose(np.sort(energy[np.isfinite(energy)]), expected)
    without = {key: column for key, column in COLUMNS.items() if key != "mw"}
    assert "energy is no moment" in refused(tmp_path, CSV, without)
    text = CSV.replace(",E\n", ",E (kJ)\n", 1)
    in_kilojoules = read(tmp_path, text, COLUMNS | {"energy": "E (kJ)"})[RADIATED_ENERGY.name].values
    np.testing.assert_allclose(in_kilojoules, 1e3 * energy)


def test_radius_and_stress_drop_of_a_record(evidence, tmp_path):
    """As its columns state them, in their units; 0 stands for what was never computed."""
    text = "time,x,y,z,mw,r (ft),drop (MPa)\n2019-08-02T00:00:00,100,200,300,0.5,10,2\n"
    text += "2019-08-03T00:00:00,100,210,300,0.4,0,3\n"
    columns = {**COLUMNS, "source_radius": "r (ft)", "static_stress_drop": "drop (MPa)"}
    del columns["energy"]
    evidence.record = read(tmp_path, text, columns)
    np.testing.assert_allclose(evidence.record["source_radius"], [3.048, np.nan])
    np.testing.assert_allclose(evidence.record["static_stress_drop"], [2e6, 3e6])
    rows = {row["name"]: row["values"] for row in page.section(evidence, Gallery())["rows"]}
    assert rows["source radius (m)"][1].startswith("3.05")
    assert rows["static stress drop (MPa)"][1].startswith("2.50")


def test_model_and_record_side_by_side(evidence, tmp_path):
    evidence.record = read(tmp_path, CSV, COLUMNS)
    gallery = Gallery()
    shown = page.section(evidence, gallery)
    assert shown["labels"] == ["Modelled", "Recorded"]
    rows = {row["name"]: row["values"] for row in shown["rows"]}
    assert rows["source radius (m)"][1] == page.DASH
    assert rows["apparent stress (MPa)"][1] != page.DASH
    assert all(values[0] != page.DASH for values in rows.values())
    assert len(shown["fits"]) == 2
    assert "log E = 1.10 log M0" in shown["fits"][0]
    axes = gallery.figures["source_parameters"].axes
    assert [one.get_xlabel() for one in axes] == ["moment (N m)"] * 2
    assert [one.get_ylabel() for one in axes] == ["energy (J)", "static stress drop (MPa)"]
    assert "too few to tell clusters" in shown["declustered"][0]


def test_the_median_is_that_of_resolved_events(evidence):
    catalog, values = evidence.catalog, evidence.source_parameters
    catalog["resolved"].values[::2] = 0
    shown = page.section(evidence, Gallery())
    middle = np.median(values["source_radius"].values[catalog["resolved"].values == 1])
    assert shown["rows"][0]["values"][0].startswith(page.number(middle, 3))


def test_a_twin_has_no_declustered_number(evidence):
    assert evidence.is_twin
    (sentence,) = page.section(evidence, Gallery())["declustered"]
    assert "a twin has the times of a model" in sentence


def test_results_of_an_earlier_version_leave_the_record(evidence):
    evidence.source_parameters = None
    shown = page.section(evidence, Gallery())
    assert shown["labels"] == ["Recorded (twin)"]
    assert shown["figure"] is None
    evidence.record = None
    assert page.section(evidence, Gallery()) is None


def test_an_unbounded_law_is_said_so(evidence):
    """And a bounded one has an upper end."""
    sentences = page.section(evidence, Gallery())["largest"]
    assert len(sentences) == 2
    assert all("above the cut has log P" in sentence or "too few" in sentence for sentence in sentences)
    count = evidence.catalog.sizes["event"]
    full = evidence.catalog
    full["potency"].values[:] = np.linspace(1.0, 2.0, count)
    full.attrs["potency_floor"] = 1.0
    full["resolved"].values[:] = 1
    assert "With 95 % confidence it is not above" in page.possible("Modelled", full, page.cut_of("Modelled", full))


def test_a_recorded_event_beyond_the_modelled_law_is_said(evidence):
    """Sizes of a law that ends: a record within it is no contradiction, one event beyond its bound is."""
    model, record = evidence.catalog.copy(deep=True), evidence.record.copy(deep=True)
    count = model.sizes["event"]
    model["potency"].values[:] = np.linspace(1.0, 2.0, count)
    model["resolved"].values[:] = 1
    model.attrs["potency_floor"] = 1.0
    bound = largest_possible(np.log10(model["potency"].values), 0.0).upper
    for beyond, size in ((False, bound - 0.01), (True, bound + 0.01)):
        record["potency"].values[0] = 10.0**size
        record["potency"].values[1:] = 1.0
        found = page.contradicted({"Modelled": model, "Recorded (twin)": record})
        assert len(found) == beyond
        assert all(sentence.startswith("Recorded (twin): its largest event, log P ") for sentence in found)
    assert page.contradicted({"Recorded (twin)": record}) == []
    model.attrs["potency_floor"] = np.nan
    assert page.contradicted({"Modelled": model, "Recorded (twin)": record}) == []


@pytest.mark.parametrize("width", [0.15, 0.3])
def test_of_rounded_sizes_those_of_bins_above_the_cut_count(width):
    """A record's cut is a bin's lower edge: the bin below it, in which events are missing, was taken in."""
    generator = np.random.default_rng(2)
    sizes = generator.exponential(1 / (0.6 * np.log(10)), 3000) - 1.0
    sizes = width * np.round(sizes[generator.random(3000) < np.clip(2.0 * (sizes + 1.0), 0.0, 1.0)] / width)
    record = made_up_catalog(len(sizes), kind="recorded")
    record["potency"].values[:] = 10.0**sizes
    edge, found = page.cut_of("Recorded", record)
    assert found == pytest.approx(width)
    assert round(edge / width - 0.5, 6) == round(edge / width - 0.5)
    above = np.count_nonzero(sizes > edge)
    assert f"the largest of {above:,} events above the cut" in page.possible("Recorded", record, (edge, found))
    (sentence,) = page.declustered(record, "Recorded")
    assert f"{above:,} events" in sentence
    assert f"from log P {page.fixed(edge, 2)} on" in sentence


def test_only_the_largest_of_many_events_are_declustered(evidence, tmp_path, monkeypatch):
    """The sentence names the size from which on they are taken."""
    evidence.record = read(tmp_path, CSV, COLUMNS)
    monkeypatch.setattr(page, "MAX_DECLUSTERED", 7)
    (sentence,) = page.section(evidence, Gallery())["declustered"]
    assert "7 events from log P" in sentence
