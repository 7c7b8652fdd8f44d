"""A twin record is the catalogue itself, less its small events, with the location noise that was asked for."""

import numpy as np
import pytest

from catalogs.records import read_record
from catalogs.sources.twin import write_twin
from common.errors import InputError
from common.event_table import new_catalog
from common.voigt import COMPONENTS

EVENTS, NOISE, CUT = 2000, 10.0, -2.0


@pytest.fixture(scope="module")
def catalog():
    """Events of log P -4 to 0, one in ten unresolved, in an hour each."""
    generator = np.random.default_rng(3)
    tensor = generator.normal(size=(EVENTS, 3, 3))
    tensor += tensor.transpose(0, 2, 1)
    potency = 10.0 ** generator.uniform(-4, 0, EVENTS)
    tensor *= (potency / np.sqrt(2 * np.sum(tensor**2, axis=(1, 2))))[:, None, None]
    return new_catalog(
        EVENTS,
        {"mine": "made", "kind": "synthetic"},
        time=np.datetime64("2019-08-01T00:00:00", "ns") + np.arange(EVENTS) * np.timedelta64(3600, "s"),
        location=generator.uniform(0, 200, (EVENTS, 3)),
        potency_tensor=tensor,
        potency=potency,
        resolved=(np.arange(EVENTS) % 10 > 0).astype(np.int8),
    )


def test_twin_reads_back_as_the_catalogue_with_noise(catalog, tmp_path):
    """Root mean square distance 10 m: 1400 events give it to 10 / sqrt(6 * 700) = 0.15 m; 5 standard errors allowed."""
    path = tmp_path / "twin.csv"
    count = write_twin(catalog, NOISE, CUT, 1, path)
    kept = np.flatnonzero((catalog.resolved.values == 1) & (np.log10(catalog.potency.values) >= CUT))
    assert count == len(kept)
    columns = {name: name for name in ("time", "x", "y", "z", "log_potency")}
    columns |= {f"potency_{name}": f"p_{name}" for name in COMPONENTS}
    moduli = {"lame_lambda": 2e10, "shear_modulus": 2e10}
    settings = {"mine": "made", "reader": "csv", "file": str(path), "twin": True, "columns": columns, **moduli}
    record = read_record({**settings, "location_error": NOISE, "frame": {"surface": 0.0}})
    assert record.attrs["kind"] == "twin"
    np.testing.assert_array_equal(record.time.values, catalog.time.values[kept])
    np.testing.assert_allclose(
        record.potency.values, catalog.potency.values[kept], rtol=2e-3
    )  # three decimals of log P
    np.testing.assert_allclose(record.potency_tensor.values, catalog.potency_tensor.values[kept], rtol=1e-4, atol=1e-12)
    shift = record.location.values - catalog.location.values[kept]
    assert np.sqrt(np.mean(np.sum(shift**2, axis=1))) == pytest.approx(NOISE, abs=0.75)
    assert np.abs(shift.mean(axis=0)).max() < 5 * NOISE / np.sqrt(3 * len(kept))


def test_same_seed_same_bytes(catalog, tmp_path):
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    write_twin(catalog, NOISE, CUT, 7, first)
    write_twin(catalog, NOISE, CUT, 7, second)
    assert first.read_bytes() == second.read_bytes()
    assert "A TWIN" in first.read_text().splitlines()[0]


def test_a_cut_above_all_events_is_refused_and_nothing_is_written(catalog, tmp_path):
    path = tmp_path / "twin.csv"
    with pytest.raises(InputError, match="lower the cut"):
        write_twin(catalog, NOISE, 5.0, 1, path)
    assert not path.exists()
