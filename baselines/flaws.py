"""Seeded flaws: their places, the slips of each state (Salamon 1993, Linkov 2005), and how many slips are expected.

A flaw is a penny-shaped crack at a random place, with a plane of any direction, a radius of a power law and a Coulomb
strength of its own. It slips where the shear traction on its plane is above its strength, and then supports its
residual strength. Each slip changes the stress on this flaw and on those around it for good.

Equations: docs/explanation/baselines.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from baselines.elastic_rock import ElasticRock
from baselines.point_source import crack_factor, reach, slip_tensor, smearing, source_stress, traction
from baselines.settings import FlawStrength
from common.errors import InputError

# Standard deviation of the natural logarithm of the cohesion of flaws in one rock; its mean is the rock's cohesion.
COHESION_SCATTER = 0.3
PILOTS = 400_000  # Flaws at random that the expected number is a mean over.
# A flaw that has slipped slips again once it would lose this share of its largest stress drop so far.
MIN_DROP_SHARE = 0.02
MAX_SLIPS_PER_FLAW = 3  # More slips of a state than this, for each flaw on average, count as endless.


class NotPossible(InputError):
    """A baseline that this rock and record do not allow with these settings; the others may be made without it."""


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


def draw_flaws(rock: ElasticRock, numbers: NDArray, law: RadiusLaw, generator: np.random.Generator) -> Seeds:
    """Flaws at random, given their number in each part of the rock (part,).

    Places are drawn from the whole cube of a part, also where it is not rock: the rank of a flaw decides that.
    """
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


def draw_poisson_flaws(rock: ElasticRock, density: float, law: RadiusLaw, generator: np.random.Generator) -> Seeds:
    """Flaws at random, `density` per m3 of rock."""
    return draw_flaws(rock, generator.poisson(density * rock.edge**3), law, generator)


@dataclass(frozen=True)
class Slips:
    """Slips in the order in which they happen: state (slip,), seed (slip,), stress drop (slip,) Pa, and the unit
    direction (slip, 3) in which the side that the normal points to moves."""

    state: NDArray
    seed: NDArray
    drop: NDArray
    direction: NDArray


class FlawStrengths:
    """Shear strength of flaws, Pa, before they slip and after slip has taken their cohesion."""

    def __init__(self, rock: ElasticRock, seeds: Seeds, strength: Mapping[str, FlawStrength]):
        friction = rock.by_material({name: one.friction_angle for name, one in strength.items()})
        cohesion = rock.by_material({name: one.cohesion for name, one in strength.items()})
        self.friction = np.tan(np.radians(friction))[seeds.part]
        self.cohesion = cohesion[seeds.part] * seeds.cohesion

    def before(self, normal_stress: NDArray, seeds: NDArray) -> NDArray:
        """Strength before slip, at a normal stress (tension positive) of these seeds."""
        return np.maximum(0.0, self.cohesion[seeds] - normal_stress * self.friction[seeds])

    def residual(self, normal_stress: NDArray, seeds: NDArray) -> NDArray:
        """Strength after slip, without cohesion."""
        return np.maximum(0.0, -normal_stress * self.friction[seeds])


class FlawedRock:
    """Flaws in rock, and the stress on each of them, which changes with every slip."""

    def __init__(self, rock: ElasticRock, seeds: Seeds, strength: Mapping[str, FlawStrength]):
        self.rock, self.seeds = rock, seeds
        self.strengths = FlawStrengths(rock, seeds, strength)
        self.added = np.zeros((len(seeds), 6))  # stress by other flaws
        self.relieved = np.zeros((len(seeds), 3))  # shear traction that own slip has taken off
        self.largest_drop = np.zeros(len(seeds))
        self.shear_modulus, self.poisson_ratio = rock.shear_modulus[seeds.part], rock.poisson_ratio[seeds.part]

    def _tractions(self, state: int, seeds: NDArray) -> tuple[NDArray, NDArray]:
        """Normal stress (k,) and shear traction (k, 3), Pa, on these seeds."""
        normal = self.seeds.normal[seeds]
        stress = self.rock.stress[state, self.seeds.part[seeds]] + self.added[seeds]
        on_plane = traction(stress, normal)
        across = np.sum(on_plane * normal, axis=1)
        return across, on_plane - across[:, None] * normal - self.relieved[seeds]

    def excess(self, state: int, seeds: NDArray) -> NDArray:
        """Shear traction above strength, Pa, of these seeds."""
        across, shear = self._tractions(state, seeds)
        largest = self.largest_drop[seeds]
        again = self.strengths.residual(across, seeds) + MIN_DROP_SHARE * largest
        supported_shear = np.where(largest > 0.0, again, self.strengths.before(across, seeds))
        return np.linalg.norm(shear, axis=1) - supported_shear

    def drop(self, state: int, seeds: NDArray) -> tuple[NDArray, NDArray]:
        """Stress drop (k,), Pa, and direction of slip (k, 3) of seeds that slip now."""
        across, shear = self._tractions(state, seeds)
        size = np.linalg.norm(shear, axis=1)
        return size - self.strengths.residual(across, seeds), shear / size[:, None]

    def slip(self, seeds: NDArray, drop: NDArray, direction: NDArray) -> None:
        """Take the stress drop off the planes of these seeds."""
        self.relieved[seeds] += drop[:, None] * direction
        self.largest_drop[seeds] = np.maximum(self.largest_drop[seeds], drop)


class Neighbours:
    """Flaws within reach of each flaw, and the stress that its slip adds to them.

    All flaws are smeared, those that slip as those that are loaded. So the energy of any slips is that of one field of
    stress and cannot be negative: slip releases some of it, and flaws come to rest however close they lie.
    """

    def __init__(self, flawed: FlawedRock):
        self.flawed, self.seeds = flawed, flawed.seeds
        self.tree = cKDTree(self.seeds.place)
        self.reach = reach(self.seeds.radius, flawed.poisson_ratio)
        self.width = smearing(flawed.poisson_ratio) * self.seeds.radius

    def add_stress(self, seed: int, drop: float, direction: NDArray) -> NDArray:
        """Add the stress of a slip to the flaws within its reach, and return the indices of these flaws."""

        near = np.array(self.tree.query_ball_point(self.seeds.place[seed], self.reach[seed]))
        near = near[near != seed]
        shear, poisson = self.flawed.shear_modulus[seed], self.flawed.poisson_ratio[seed]
        potency = crack_factor(poisson) * drop / shear * self.seeds.radius[seed] ** 3
        self.flawed.added[near] += source_stress(
            self.seeds.place[near] - self.seeds.place[seed],
            potency * slip_tensor(self.seeds.normal[seed], direction),
            shear,
            poisson,
            np.hypot(self.width[seed], self.width[near]),
        )
        return near


def find_slips(
    rock: ElasticRock, seeds: Seeds, strength: Mapping[str, FlawStrength], interacting: bool = True
) -> Slips:
    """All slips of the flaws, state by state.

    The flaw that is furthest above its strength slips first, then the next one, in the stress that the slips before it
    leave, until none is above its strength. Without interaction flaws add no stress to each other. Raises NotPossible
    if they do not stop slipping.
    """
    flawed = FlawedRock(rock, seeds, strength)
    neighbours = Neighbours(flawed) if interacting else None
    slips: list[tuple[int, int, float, NDArray]] = []
    for state in range(rock.states):
        present = seeds.rank < rock.share[state, seeds.part]
        if neighbours is None:
            above = np.flatnonzero(present)
            above = above[flawed.excess(state, above) > 0.0]
            drop, direction = flawed.drop(state, above)
            flawed.slip(above, drop, direction)
            slips += zip([state] * len(above), above, drop, direction, strict=True)
        else:
            slips += _cascade(flawed, neighbours, state, present)
    states, slipping, drops, directions = zip(*slips, strict=True) if slips else ([], [], [], [])
    return Slips(
        np.array(states, int), np.array(slipping, int), np.array(drops, float), np.reshape(directions, (-1, 3))
    )


def _cascade(
    flawed: FlawedRock, neighbours: Neighbours, state: int, present: NDArray
) -> list[tuple[int, int, float, NDArray]]:
    """Slips of a state one after the other; present (seed,) bool."""
    excess = np.full(len(present), -np.inf)
    excess[present] = flawed.excess(state, np.flatnonzero(present))
    slips: list[tuple[int, int, float, NDArray]] = []
    while len(excess) and excess[seed := int(np.argmax(excess))] > 0.0:
        only = np.array([seed])
        drop, direction = flawed.drop(state, only)
        flawed.slip(only, drop, direction)
        slips.append((state, seed, float(drop[0]), direction[0]))
        if len(slips) > MAX_SLIPS_PER_FLAW * len(present):
            raise NotPossible(
                "baselines: flaws make each other slip without end, as they overlap many times; give a smaller largest "
                "radius in baselines.radii"
            )
        near = neighbours.add_stress(seed, float(drop[0]), direction[0])
        changed = np.append(near[present[near]], seed)
        excess[changed] = flawed.excess(state, changed)
    return slips


def potency_tensors(rock: ElasticRock, seeds: Seeds, slips: Slips) -> NDArray:
    """Potency tensors (slip, 3, 3), m3."""
    part = seeds.part[slips.seed]
    size = (
        crack_factor(rock.poisson_ratio[part]) * slips.drop / rock.shear_modulus[part] * seeds.radius[slips.seed] ** 3
    )
    return size[:, None, None] * slip_tensor(seeds.normal[slips.seed], slips.direction)


def expected_per_density(
    rock: ElasticRock,
    law: RadiusLaw,
    strength: Mapping[str, FlawStrength],
    cut: float,
    weight: NDArray,
    generator: np.random.Generator,
    pilots: int = PILOTS,
) -> float:
    """Expected number of slips of at least the potency `cut`, m3, for one flaw per m3, if flaws do not interact.

    weight (state,): of slips in each state. Without interaction flaws are independent of each other, so the number is
    linear in their density. The stress drop of a flaw does not depend on its radius then, so the share of radii for
    which a slip is large enough is known in closed form. What is left is a mean over places, planes and strengths, of
    `pilots` at random.
    """
    volume = rock.edge**3
    if not volume.sum() > 0.0:
        return 0.0
    seeds = draw_flaws(rock, generator.multinomial(pilots, volume / volume.sum()), law, generator)
    slips = find_slips(rock, seeds, strength, interacting=False)
    part = seeds.part[slips.seed]
    factor = crack_factor(rock.poisson_ratio[part]) / rock.shear_modulus[part]
    shares = law.share_above(np.cbrt(cut / (factor * slips.drop)))
    return float(np.sum(shares * weight[slips.state]) * volume.sum() / pilots)
