"""Strength of a specimen with planes of weakness of one orientation (Jaeger 1960, Geol. Mag. 97, 65)."""

import math


def jaeger_strength(
    angle: float, confinement: float, rock: tuple[float, float], plane: tuple[float, float]
) -> tuple[float, bool]:
    """Axial minus lateral compression at failure, Pa, and whether the planes slip then.

    angle: from the axis to the planes' normal, degrees; confinement: lateral compression, Pa; rock, plane: cohesion Pa
    and friction angle, degrees. Planes slip at 2 (c + p tan phi) / ((1 - tan phi cot b) sin 2b) where b > phi. The rock
    fails at (N - 1) p + sigma_c. The smaller value counts.
    """
    cohesion, friction = rock[0], math.sin(math.radians(rock[1]))
    factor = (1 + friction) / (1 - friction)
    of_rock = (factor - 1) * confinement + 2 * cohesion * math.sqrt(factor)
    b, slope = math.radians(angle), math.tan(math.radians(plane[1]))
    if math.sin(b) <= slope * math.cos(b) or angle >= 90:
        return of_rock, False
    of_plane = 2 * (plane[0] + confinement * slope) / ((1 - slope / math.tan(b)) * math.sin(2 * b))
    return min(of_rock, of_plane), of_plane < of_rock
