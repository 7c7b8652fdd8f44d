"""Stress and displacement along lines outward from Kirsch's hole, as an instrument of the model reads them."""

import numpy as np

from verification.answers.kirsch.fields import Rock
from verification.field_rows import field_rows, line_points
from verification.rows import Row

LINES = 24


def line_rows(name: str, rock: Rock) -> list[Row]:
    """Stress and displacement along lines outward from the hole."""
    hole, angle = rock.hole, 2 * np.pi * (np.arange(LINES) + 0.3) / LINES
    off = line_points(np.stack([np.cos(angle), np.sin(angle), np.zeros(LINES)], axis=1), hole.radius)
    place = off[:, 0] + 1j * off[:, 1]
    exact = hole.plate.at(place)
    stress = np.full((len(off), 6), np.nan)
    stress[:, [0, 1, 5]] = np.stack([exact.xx, exact.yy, exact.xy], axis=1)
    moved = np.stack([exact.moved.real, exact.moved.imag, np.zeros(len(off))], axis=1)
    centre = np.array([hole.center.real, hole.center.imag, 0.0])
    return field_rows(name, rock.grid, rock.state, centre, off, stress, moved)
