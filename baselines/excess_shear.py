"""Excess shear stress (Ryder 1988) of elastic rock, and events at random where mining raises it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.elastic_rock import ElasticRock, principal
from baselines.settings import FlawStrength


def excess_shear_stress(stress: NDArray, friction_angle: ArrayLike) -> NDArray:
    """Largest shear traction above friction of all planes (n,), Pa: max of |tau| + sigma_n tan phi.

    stress (n, 6) Pa, sigma_n tension positive; friction_angle, degrees, of all or (n,). With principal stresses
    s1 >= s3 and N = (1 + sin phi) / (1 - sin phi) it is (N s1 - s3) / (2 sqrt N).

    Compression of 30 and 10 MPa, which a friction angle of 30 degrees just bears:

    >>> stress = np.array([[-30e6, -20e6, -10e6, 0.0, 0.0, 0.0]])
    >>> print((excess_shear_stress(stress, 30.0) / 1e6).round(6), (excess_shear_stress(stress, 20.0) / 1e6).round(2))
    [0.] [3.36]
    """
    sine = np.sin(np.radians(friction_angle))
    factor = (1.0 + sine) / (1.0 - sine)
    largest, smallest = principal(stress)
    return (factor * largest - smallest) / (2.0 * np.sqrt(factor))


def raised_excess(rock: ElasticRock, strength: Mapping[str, FlawStrength]) -> NDArray:
    """By how much each state raises excess shear stress above 0, times volume of rock (state, part), Pa m3.

    The dynamic strength is friction alone. The first state raises nothing: it is what the others start from.
    """
    friction = rock.by_material({name: one.friction_angle for name, one in strength.items()})
    positive = np.array([np.maximum(excess_shear_stress(stress, friction), 0.0) for stress in rock.stress])
    raised = np.zeros_like(positive)
    raised[1:] = np.maximum(np.diff(positive, axis=0), 0.0)
    return raised * rock.share * rock.edge**3


def draw_places(rock: ElasticRock, numbers: NDArray, generator: np.random.Generator) -> tuple[NDArray, NDArray]:
    """State (event,) and place (event, 3), m, of Poisson numbers of events in parts, of means (state, part)."""
    drawn = generator.poisson(numbers)
    state, part = (np.repeat(index, drawn[drawn > 0]) for index in np.nonzero(drawn))
    place = rock.centre[part] + (generator.uniform(size=(len(part), 3)) - 0.5) * rock.edge[part, None]
    order = generator.permutation(len(state))
    return state[order], place[order]
