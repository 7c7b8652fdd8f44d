"""A specimen of Coulomb rock pressed or pulled along one axis under constant lateral pressure, calculated by hand.

Axial strain e is given and lateral stress stays -p. Stress is tension positive; strain counts from the rock under p all
round. With s_l lateral and s_a axial stress, N = tan^2(45 + phi/2) and sigma_c = 2 c cos(phi) / (1 - sin(phi)):

Elastic         s_a = -p + E e; lateral strain -nu e.
Pressed         first yield at N s_l - s_a = sigma_c: compression sigma_c + N p. Both faces that meet at equal lateral
                stresses are active, so plastic strain is m (N_psi / 2, N_psi / 2, -1) (edge of the pyramid; N_psi of
                the dilation angle), which at constant total strain takes from lateral and axial stress
                m A_l = m (lambda (N_psi - 1) + G N_psi)  and  m A_a = m (lambda (N_psi - 1) - 2 G):
                m = (N s_l - s_a - sigma_c) / (N A_l - A_a).
Pulled          first yield at s_a = T, the cut-off (associated, Rankine): plastic strain k (0, 0, 1) takes
                k lambda and k (lambda + 2 G): k = (s_a - T) / (lambda + 2 G).
First failure   trial stress to the intact surface (overshoot strain), that point to the residual surface (seismic
                strain), both at constant total strain. Lateral stress is then above p in size, and the rock expands:
                axial stress follows the residual surface to sigma_c + N p (or T) of residual rock while plastic strain
                keeps the direction of residual flow. Total axial strain has not changed, which gives its amount.
Residual flow   stress stays, each further axial strain is plastic; lateral plastic strain -N_psi / 2 times it, or 0
                when pulled. Volume over axial strain is 1 - N_psi = -2 sin(psi) / (1 - sin(psi)).
Energy          per volume: what a drop at constant strain takes from the elastic energy s : C^-1 : s / 2; in flow the
                mean stress of both ends (the way is straight) times plastic strain.

Fall from peak to residual follows Coulomb with brittle loss of strength; the split into overshoot, seismic and later
strain is that of the paper's Fig. 13.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from verification.cavities.inclusion import Elastic


@dataclass(frozen=True)
class Axial:
    """A lateral (twice) and an axial component, of stress (Pa) or strain."""

    lateral: float
    axial: float

    def __add__(self, other: "Axial") -> "Axial":
        return Axial(self.lateral + other.lateral, self.axial + other.axial)

    def __sub__(self, other: "Axial") -> "Axial":
        return Axial(self.lateral - other.lateral, self.axial - other.axial)

    def times(self, factor: float) -> "Axial":
        """Both components times a factor."""
        return Axial(factor * self.lateral, factor * self.axial)

    def work(self, strain: "Axial") -> float:
        """Stress : strain, J/m3."""
        return 2.0 * self.lateral * strain.lateral + self.axial * strain.axial

    @property
    def volumetric(self) -> float:
        """Sum of all three normal components."""
        return 2.0 * self.lateral + self.axial

    @property
    def scalar(self) -> float:
        """sqrt(2 e : e), the scalar potency per volume of a strain."""
        return float(np.sqrt(2.0 * self.work(self)))


NOTHING = Axial(0.0, 0.0)


@dataclass(frozen=True)
class Surface:
    """A strength: N (friction), N_psi (dilation), unconfined strength Pa, tension cut-off Pa (inf without)."""

    friction: float
    dilation: float
    unconfined: float
    tensile: float

    @classmethod
    def of(cls, material: dict, state: str) -> Self:
        """From a material of a configuration (degrees, Pa); state: intact or residual."""
        friction, dilation = (np.radians(material[key][state]) for key in ("friction_angle", "dilation_angle"))
        cutoff = material["tension_cutoff"]
        return cls(
            float(np.tan(np.pi / 4 + friction / 2) ** 2),
            float(np.tan(np.pi / 4 + dilation / 2) ** 2),
            float(2 * material["cohesion"][state] * np.cos(friction) / (1 - np.sin(friction))),
            np.inf if cutoff == "none" else float(cutoff[state]),
        )

    def compression(self, pressure: float) -> float:
        """Axial compression that this strength bears under a pressure, Pa."""
        return self.unconfined + self.friction * pressure


@dataclass(frozen=True)
class Point:
    """The specimen after a step: total strain, stress, and the plastic strains that the step added.

    energy: dissipated per volume in the step, J/m3. peak, dropped: stress on the intact and on the residual surface,
    where the specimen failed in the step.
    """

    strain: Axial
    stress: Axial
    overshoot: Axial = NOTHING
    seismic: Axial = NOTHING
    later: Axial = NOTHING
    energy: float = 0.0
    failed: bool = False
    peak: Axial | None = None
    dropped: Axial | None = None


@dataclass(frozen=True)
class Specimen(Elastic):
    """Rock under a pressure (Pa, positive in compression)."""

    intact: Surface
    residual: Surface
    pressure: float

    @classmethod
    def of(cls, material: dict, pressure: float) -> Self:
        """From a material of a configuration."""
        intact, residual = (Surface.of(material, state) for state in ("intact", "residual"))
        return cls(material["youngs_modulus"], material["poisson_ratio"], intact, residual, pressure)

    def elastic_strain(self, stress: Axial) -> Axial:
        """Hooke's law for a change of stress."""
        nu = self.poisson_ratio
        return Axial(
            ((1 - nu) * stress.lateral - nu * stress.axial) / self.youngs_modulus,
            (stress.axial - 2 * nu * stress.lateral) / self.youngs_modulus,
        )

    def peak_strain(self, pulled: bool) -> float:
        """Axial strain at first yield."""
        strength = self.intact.tensile if pulled else -self.intact.compression(self.pressure)
        return (strength + self.pressure) / self.youngs_modulus

    def project(self, stress: Axial, surface: Surface, pulled: bool) -> tuple[Axial, Axial]:
        """Stress returned to a surface at constant total strain, and the plastic strain of the return."""
        lame, shear = self.lame
        if pulled:
            amount = (stress.axial - surface.tensile) / (lame + 2 * shear)
            flow, taken = Axial(0.0, amount), Axial(lame, lame + 2 * shear).times(amount)
        else:
            expansion = lame * (surface.dilation - 1)
            taken = Axial(expansion + shear * surface.dilation, expansion - 2 * shear)
            excess = surface.friction * stress.lateral - stress.axial - surface.unconfined
            amount = excess / (surface.friction * taken.lateral - taken.axial)
            flow, taken = self.direction(surface, pulled).times(amount), taken.times(amount)
        return stress - taken, flow

    @staticmethod
    def direction(surface: Surface, pulled: bool) -> Axial:
        """Plastic strain per unit of axial shortening (pressed) or stretching (pulled)."""
        return Axial(0.0, 1.0) if pulled else Axial(surface.dilation / 2, -1.0)

    def rest(self, surface: Surface, pulled: bool) -> Axial:
        """Stress of rock at this strength under the lateral pressure."""
        return Axial(-self.pressure, surface.tensile if pulled else -surface.compression(self.pressure))

    def walk(self, axial_strains: list[float]) -> list[Point]:
        """The specimen after each of these axial strains, which grow in size. It fails at the first above the peak."""
        start = Axial(-self.pressure, -self.pressure)
        points = [Point(NOTHING, start)]
        pulled = axial_strains[0] > 0
        for before, now in pairwise([0.0, *axial_strains]):
            last = points[-1]
            if any(point.failed for point in points):
                flow = self.direction(self.residual, pulled).times(abs(now - before))
                points.append(Point(last.strain + flow, last.stress, later=flow, energy=last.stress.work(flow)))
            elif abs(now) > abs(self.peak_strain(pulled)):
                points.append(self._fail(now, pulled))
            else:
                strain = Axial(-self.poisson_ratio * now, now)
                points.append(Point(strain, start + Axial(0.0, self.youngs_modulus * now)))
        return points[1:]

    def _fail(self, axial_strain: float, pulled: bool) -> Point:
        """First failure at this constant axial strain."""
        start = Axial(-self.pressure, -self.pressure)
        trial = start + Axial(0.0, self.youngs_modulus * axial_strain)
        peak, overshoot = self.project(trial, self.intact, pulled)
        dropped, seismic = self.project(peak, self.residual, pulled)
        stress = self.rest(self.residual, pulled)
        elastic = self.elastic_strain(stress - start)
        way = self.direction(self.residual, pulled)
        plastic = overshoot + seismic
        later = way.times((axial_strain - elastic.axial - plastic.axial) / way.axial)
        energy = (trial + dropped).times(0.5).work(plastic) + (dropped + stress).times(0.5).work(later)
        return Point(elastic + plastic + later, stress, overshoot, seismic, later, energy, True, peak, dropped)
