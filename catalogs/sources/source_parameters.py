"""Source parameters that seismologists use: radius, static stress drop, energy of the drop, apparent stress, energy
index. docs/explanation/source-parameters.md says what a model can and cannot say by them.

A model in equilibrium has no waves. What it has is the drop of strength: rock that fails loses the stress C : e at
fixed strain, where e is its seismic strain. Of the elastic energy that it loses, friction at the residual strength
takes s_residual : e V. The rest, e : C : e V / 2, is the most that the drop can radiate if friction stays at the
residual strength while it slips (Orowan 1960); fracture and damping take an unknown part of it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from common.fields import Field
from common.voigt import tensor_from_voigt

MIN_EVENTS_FITTED = 10  # Events that the mean energy by moment is fitted to.
EVENTS = ("event",)
FIELDS = (
    Field("source_radius", EVENTS, "f8", "m", "radius of the crack that is as spread out as the source"),
    Field("static_stress_drop", EVENTS, "f8", "Pa", "stress drop of that crack with the event's potency"),
    Field("drop_energy", EVENTS, "f8", "J", "most energy that the drop of strength can radiate, e : C : e V / 2"),
    Field("apparent_stress", EVENTS, "f8", "Pa", "energy over potency"),
    Field("energy_index", EVENTS, "f8", "1", "energy over the mean energy of events of its moment in the catalogue"),
)


def crack_radius(source_size: ArrayLike, dimension: int) -> NDArray:
    """Radius (event,) m of the circular crack whose mean square distance of slip from its centre is the source's.

    source_size (event,) m: diameter of the uniform ball (2-D: disc) of that mean square distance. Slip in a crack of
    radius a under uniform stress drop goes as sqrt(a^2 - x^2) (Eshelby 1957): its mean square distance is 2/5 a^2, and
    that of a ball of radius R is 3/5 R^2. In plane strain the crack is a strip of half-width a: a^2 / 4, and R^2 / 2 of
    a disc.
    """
    ratio = np.sqrt(1.5) if dimension == 3 else np.sqrt(2.0)
    return ratio * 0.5 * np.asarray(source_size, float)


def stress_drop(
    potency: ArrayLike, radius: ArrayLike, lame: ArrayLike, shear: ArrayLike, thickness: float | None = None
) -> NDArray:
    """Uniform drop (event,) Pa of shear stress in a crack of potency (event,) m3 and radius (event,) m.

    Circular crack (Eshelby 1957): 3 (2 - n) / (16 (1 - n)) mu P / a^3 with Poisson's ratio n, which is 7/16 M0 / a^3
    for n = 1/4. thickness m, of a scene in plane strain: the strip slips along its width, mu P / (pi (1 - n) a^2 t)
    (Starr 1928). lame, shear: moduli Pa.
    """
    lame, shear = np.asarray(lame, float), np.asarray(shear, float)
    poisson = lame / (2.0 * (lame + shear))
    potency, radius = np.asarray(potency, float), np.asarray(radius, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        if thickness is None:
            drop = 3.0 * (2.0 - poisson) / (16.0 * (1.0 - poisson)) * shear * potency / radius**3
        else:
            drop = shear * potency / (np.pi * (1.0 - poisson) * radius**2 * thickness)
    return np.where(np.isfinite(drop), drop, np.nan)


def drop_energies(strain: NDArray, volume: NDArray, lame: NDArray, shear: NDArray) -> NDArray:
    """Energy e : C : e V / 2 (k,) J of the drop of particles.

    strain (k, 6): seismic strain e, tensor shear; volume (k,) m3; lame, shear (k,) Pa.
    """
    tensor = tensor_from_voigt(strain)
    trace, square = np.trace(tensor, axis1=1, axis2=2), np.einsum("kij,kij->k", tensor, tensor)
    return (0.5 * lame * trace**2 + shear * square) * volume


@dataclass(frozen=True)
class EnergyFit:
    """Mean log10 energy (J) of a catalogue by log10 moment (N m): slope log10 M0 + offset; NaN where it is not known.
    scatter: root mean square of the residuals; count: events."""

    slope: float
    offset: float
    scatter: float
    count: int

    def index(self, energy: ArrayLike, moment: ArrayLike) -> NDArray:
        """Energy index (event,): energy over the mean energy of events of the moment (van Aswegen and Butler 1993)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.slope * np.log10(np.asarray(moment, float)) + self.offset
            return np.asarray(energy, float) / 10.0**mean


def fit_energy(energy: ArrayLike, moment: ArrayLike, counted: NDArray) -> EnergyFit:
    """Least squares of log10 energy by log10 moment over the events that are counted (event,) bool and have both."""
    energy, moment = np.asarray(energy, float), np.asarray(moment, float)
    used = counted & (energy > 0) & (moment > 0)
    x, y = np.log10(moment[used]), np.log10(energy[used])
    if len(x) < MIN_EVENTS_FITTED or np.ptp(x) < 1e-6:
        return EnergyFit(np.nan, np.nan, np.nan, len(x))
    slope, offset = np.polyfit(x, y, 1)
    return EnergyFit(float(slope), float(offset), float(np.sqrt(np.mean((y - slope * x - offset) ** 2))), len(x))


def parameters(
    catalog: xr.Dataset, energy: NDArray, dimension: int, thickness: float | None, attributes: Mapping | None = None
) -> xr.Dataset:
    """The variables FIELDS of a catalogue, in its order.

    energy (event,) J: of the drop of strength, or radiated, as a record has it; NaN where it is not known. Moduli are
    those of the host, attributes lame_lambda and shear_modulus. The energy index is fitted to the resolved events.
    """
    potency, moment = catalog["potency"].values, catalog["moment"].values
    radius = crack_radius(catalog["source_size"].values, dimension)
    lame, shear = float(catalog.attrs["lame_lambda"]), float(catalog.attrs["shear_modulus"])
    fit = fit_energy(energy, moment, catalog["resolved"].values == 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        apparent = np.where(potency > 0, energy / potency, np.nan)
    values = (radius, stress_drop(potency, radius, lame, shear, thickness), energy, apparent, fit.index(energy, moment))
    found = {
        field.name: (field.dims, np.asarray(column, float), field.attributes)
        for field, column in zip(FIELDS, values, strict=True)
    }
    about = {"mine": catalog.attrs["mine"], **{f"energy_{name}": value for name, value in asdict(fit).items()}}
    return xr.Dataset(found, attrs=about | dict(attributes or {}))


def table_columns(values: xr.Dataset) -> dict[str, list[str]]:
    """Columns of FIELDS for catalog.csv: name and unit, and the numbers as text, empty where they are not known."""
    units = {"m": "_m", "Pa": "_pa", "J": "_j", "1": ""}
    return {
        f"{field.name}{units[field.unit]}": [
            f"{value:.5g}" if np.isfinite(value) else "" for value in values[field.name].values
        ]
        for field in FIELDS
    }
