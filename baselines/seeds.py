"""Seeded flaws: penny-shaped cracks at random places, with radii of a power law and planes of any direction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baselines.elastic_rock import ElasticRock

# Standard deviation of the natural logarithm of the cohesion of flaws in one rock; its mean is the rock's cohesion.
COHESION_SCATTER = 0.3


@dataclass(frozen=True)
class Seeds:
    """Flaws in rock: part of the rock (seed,), place (seed, 3) m, radius (seed,) m, unit normal (seed, 3).

    rank (seed,), 0 to 1: a flaw is in the rock while its rank is below the share of its cube that is rock. cohesion
    (seed,): over that of the rock before slip.
    """

    part: NDArray
    place: NDArray
    radius: NDArray
    normal: NDArray
    rank: NDArray
    cohesion: NDArray

    def __len__(self) -> int:
        return len(self.part)


@dataclass(frozen=True)
class RadiusLaw:
    """Radii a from `smallest` to `largest`, m; the number of those above a falls as a^-exponent."""

    smallest: float
    largest: float
    exponent: float

    def share_above(self, radius: NDArray) -> NDArray:
        """Share of flaws with at least these radii."""
        ends = (self.largest / self.smallest) ** -self.exponent
        inside = np.clip(radius, self.smallest, self.largest)
        return ((inside / self.smallest) ** -self.exponent - ends) / (1.0 - ends)

    def mean_cube(self) -> float:
        """Mean of a^3, m3."""
        power, ratio = 3.0 - self.exponent, self.largest / self.smallest
        integral = np.log(ratio) if abs(power) < 1e-9 else (ratio**power - 1.0) / power
        return float(self.smallest**3 * self.exponent * integral / (1.0 - ratio**-self.exponent))

    def radius_of(self, share: NDArray) -> NDArray:
        """Radius, m, that such a share of flaws exceeds: the inverse of share_above."""
        ends = (self.largest / self.smallest) ** -self.exponent
        return self.smallest * (ends + share * (1.0 - ends)) ** (-1.0 / self.exponent)


def sow(rock: ElasticRock, numbers: NDArray, law: RadiusLaw, generator: np.random.Generator) -> Seeds:
    """So many flaws in each part of the rock (part,), some of them in what is no rock of its cube."""
    part = np.repeat(np.arange(len(numbers)), numbers)
    count = len(part)
    place = rock.centre[part] + (generator.uniform(size=(count, 3)) - 0.5) * rock.edge[part, None]
    normal = generator.normal(size=(count, 3))
    cohesion = np.exp(COHESION_SCATTER * generator.normal(size=count) - 0.5 * COHESION_SCATTER**2)
    return Seeds(
        part,
        place,
        law.radius_of(generator.uniform(size=count)),
        normal / np.linalg.norm(normal, axis=1)[:, None],
        generator.uniform(size=count),
        cohesion,
    )


def sow_poisson(rock: ElasticRock, density: float, law: RadiusLaw, generator: np.random.Generator) -> Seeds:
    """Flaws at random, `density` per m3 of rock."""
    return sow(rock, generator.poisson(density * rock.edge**3), law, generator)
