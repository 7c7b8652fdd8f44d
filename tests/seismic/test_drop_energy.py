"""Energy of the drop of strength by event, as the stage of the catalogue sums it."""

import numpy as np
import pytest

from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from seismic.event_settings import EventSettings
from seismic.events import extract_events, failed_rock
from workflow.stages.catalogue import _energies_of


@pytest.mark.parametrize("fraction", [1.0, 0.25])
def test_events_have_the_energy_of_their_particles(make_scattered_step, make_settings, fraction):
    """In the order of the events; the sum is that of all failed particles, and the seismic fraction a factor."""
    step = make_scattered_step(0)
    chosen = make_settings(method="simultaneous", link_length="2.5 m", seismic_fraction=fraction)
    del chosen["cluster"]
    settings = EventSettings.of(chosen, "seismic")
    energy = _energies_of(step, settings)
    events, _ = extract_events(step, chosen)
    assert len(energy) == events.sizes["event"]
    rock = failed_rock(step, settings)
    strain = tensor_from_voigt(step["seismic_strain"].values[rock.source])
    volume = step["volume"].values[rock.source]
    lame, shear = float(step.attrs["lame_lambda"]), float(step.attrs["shear_modulus"])
    drop = lame * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 2 * shear * strain
    expected = 0.5 * fraction * np.einsum("kij,kij->k", drop, strain) * volume
    assert energy.sum() == pytest.approx(expected.sum(), rel=1e-9)
    event, _ = rock.events(settings)
    potency = scalar_potency(tensor_from_voigt(rock.potency))
    for number in range(len(energy)):
        assert energy[number] == pytest.approx(expected[event == number].sum(), rel=1e-9)
        assert potency[event == number].sum() >= events["potency"].values[number] * (1 - 1e-9)
