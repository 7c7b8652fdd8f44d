"""Measures of a run by kind of scene, and their values in closed form."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.spatial.distance import cdist

from catalogs.sources.sizes import estimate_b, log_potency
from mpm_core.equilibrium.increments import potency
from verification.answers.kirsch.closed_form import InfinitePlate
from verification.answers.kirsch.fields import ANGLES, Rock, measure
from verification.cavities.cavity import Cavity, inclusion_of, plastic_ring, read_pressure
from verification.comparisons import mean_square_root, released_potency, tensor_error
from verification.results import Results, Variant

Measures = dict[str, float]
FIT_CELLS = (1.0, 6.0)  # Distances from the wall, cells, between which its stress is fitted.


def hole(results: Results, variant: Variant) -> tuple[Measures, Measures]:
    """Kirsch's hole against infinite rock: r.m.s. errors of stress at the wall and at a distance, and mean closure."""
    rock, values = Rock(variant), variant.values
    host, constant = values["materials"]["host"], values["insitu_stress"]["constant"]
    virgin = tuple(constant.get(component, 0.0) for component in ("xx", "yy", "xy"))
    shear_modulus = host["youngs_modulus"] / (2 * (1 + host["poisson_ratio"]))
    plate = InfinitePlate(rock.hole.radius, virgin, shear_modulus, host["poisson_ratio"])
    rock.hole = replace(rock.hole, plate=plate)
    point = measure(rock, results.settings["distance"])
    exact = -1e3 * float(plate.polar(np.full(len(ANGLES), plate.radius), ANGLES)[3].mean())
    found = {"wall_stress": point.extrapolated, "stress": point.stress, "closure": exact * (1 + point.mean_closure)}
    return found, {"closure": exact}


def cavity(results: Results, variant: Variant) -> tuple[Measures, Measures]:
    """Elastic sphere under all-round stress: errors of the hoop stress at the wall and of stress around it, closure."""
    rock, exact = Cavity(variant, variant.elastic), inclusion_of(variant)
    pressure = read_pressure(variant)
    ring = rock.ring(results.settings["outer_radii"])
    error = tensor_error(rock.stress[ring] - exact.stress(rock.place[ring]), rock.volume[ring])
    found = {
        "wall_stress": abs(wall_hoop(rock) / (-1.5 * pressure) - 1.0),  # Goodier's, all round
        "stress": error / pressure,
        "closure": 1e3 * rock.closure,
    }
    return found, {"closure": -1e3 * float(exact.wall_displacement(rock.wall_directions()).mean())}


def wall_hoop(rock: Cavity) -> float:
    """Hoop stress (Pa) at the wall: a quadratic in the distance, fitted to the particles within FIT_CELLS."""
    off = (rock.distance - rock.radius) / rock.cell
    near = (off >= FIT_CELLS[0]) & (off <= FIT_CELLS[1])
    hoop = rock.radial_hoop_third[1, near]
    return float(np.polynomial.Polynomial.fit(off[near], hoop, 2, w=np.sqrt(rock.volume[near]))(0.0))


def brittle_cavity(results: Results, variant: Variant) -> tuple[Measures, Measures]:
    """Sphere in brittle rock against its smooth ring: failed volume, closure, stress. Potency has no closed form."""
    state, theory = variant.last, plastic_ring(variant)
    rock = Cavity(variant, state)
    ring = rock.ring(3.0)
    error = rock.radial_hoop_third[0, ring] - theory.stress(rock.distance[ring])[0]
    found = {
        "potency": float(potency(state.seismic_strain.values, state.volume.values).sum()),
        "failed_volume": float(rock.volume[rock.failed].sum()),
        "closure": 1e3 * rock.closure,
        "stress": float(mean_square_root(error, rock.volume[ring]) / theory.pressure),
    }
    exact = {
        "failed_volume": np.pi / 6 * (theory.plastic_radius**3 - theory.radius**3),
        "closure": -1e3 * float(theory.displacement(theory.radius)),
    }
    return found, exact


def mine(results: Results, variant: Variant) -> tuple[Measures, Measures]:
    """The last step of a mine and its events, and closure between two walls where settings.walls gives their places."""
    step = variant.step_names[-1]
    state, events = variant.step(step), variant.events(step)
    found = {
        "potency": released_potency(state),
        "failed_volume": float(state.attrs["failed_volume"]),
    }
    sizes = log_potency(resolved(events).potency.values)
    found["events"] = float(len(sizes))
    found["largest"] = float(sizes.max()) if len(sizes) else np.nan
    found["b"] = estimate_b(sizes, float(log_potency(events.attrs["potency_floor"]))).b
    reference = results[results.settings["limit"][-1]]
    found["apart"] = apart(events, reference.events(step))
    if "walls" in results.settings:
        found["closure"] = closure_between(state, variant.grid, np.array(results.settings["walls"], float))
    return found, {}


def resolved(events: xr.Dataset) -> xr.Dataset:
    """Resolved events, which count in statistics."""
    return events.isel(event=np.flatnonzero(events.resolved.values == 1))


def apart(one: xr.Dataset, other: xr.Dataset) -> float:
    """Energy distance of the places of the resolved events of two catalogues of one step, m (Szekely and Rizzo 2013).

    2 E|X - Y| - E|X - X'| - E|Y - Y'| over all pairs of events, so 0 for equal catalogues. That of
    catalogs.compare.energy_distance leaves out pairs of one block, and moves steps onto each other.
    """
    places = [resolved(events).location.values for events in (one, other)]
    if min(map(len, places)) == 0:
        return np.nan
    across, first, second = (cdist(a, b).mean() for a, b in ((places[0], places[1]), *((p, p) for p in places)))
    return float(2 * across - first - second)


def closure_between(state: xr.Dataset, grid: xr.Dataset, walls: np.ndarray) -> float:
    """Closure between two places (2, 3) m on opposite walls, mm, from the nodes nearest to them."""
    place = (state if "node_position" in state else grid).node_position.values
    moved = state.node_displacement.values
    nearest = [int(np.square(place - wall).sum(axis=1).argmin()) for wall in walls]
    across = (walls[1] - walls[0]) / np.linalg.norm(walls[1] - walls[0])
    return 1e3 * float((moved[nearest[0]] - moved[nearest[1]]) @ across)


SCENES: dict[str, Callable[[Results, Variant], tuple[Measures, Measures]]] = {
    "hole": hole,
    "cavity": cavity,
    "brittle_cavity": brittle_cavity,
    "mine": mine,
}
