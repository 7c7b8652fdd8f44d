"""Depth of the rock that is thrown, and the demands and classes of support that follow, by opening, step and side."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from common.opening_table import SIDES, read_openings
from shaking.demand import GRAVITY_SHARE, energy_demand, weakest_class
from shaking.settings import ShakingSlice

FAILED_DEPTHS = {  # words for the columns of the table of openings
    "depth_largest": "the largest depth of the failed rock",
    "depth_p90": "the depth of failed rock that nine tenths of the side do not exceed",
}


def read_depths(path: Path, settings: ShakingSlice) -> NDArray:
    """Depths of failed rock (step, opening, side) m from openings.nc; NaN where an opening has no such side.

    In a step without rows nothing stands open. Raises InputError as common.opening_table.read_openings, and for a file
    of other steps.
    """
    table = read_openings(path)
    steps = {step.name: number for number, step in enumerate(settings.steps)}
    openings = {opening.name: number for number, opening in enumerate(settings.openings)}
    sides = {side: number for number, side in enumerate(SIDES)}
    names = [table[name].values.astype(str) for name in ("step", "excavation", "side")]
    if len(names[0]) and not set(steps) & set(names[0]):
        raise InputError(f"{path}: has none of the steps {', '.join(steps)}; delete it and run again")
    places = [
        np.array([known.get(name, -1) for name in column], np.int64)
        for known, column in zip((steps, openings, sides), names, strict=True)
    ]
    whole = np.isnan(table["chainage_from"].values) & (np.array(places) >= 0).all(axis=0)
    found = np.full((len(steps), len(openings), len(sides)), np.nan)
    found[tuple(place[whole] for place in places)] = table[settings.ground_motion.failed_depth].values[whole]
    return found


def demands(
    settings: ShakingSlice, values: Mapping[str, NDArray], names: Sequence[str], depths: NDArray | None
) -> dict[str, NDArray]:
    """Depths, demands and classes of support, as variables of shaking.layout; NaN and empty if none is asked for.

    values: filled, velocity and velocity_interval of shaking.layout; names: of its openings; depths: as of
    `read_depths`, None where there are none.
    """
    motion = settings.ground_motion
    shape = (*values["filled"].shape, len(SIDES))
    depth = np.full(shape, np.nan)
    if motion.displacement is not None:
        stated = np.array([motion.depths.get(side, np.nan) for side in SIDES])
        depth = np.broadcast_to(stated, shape).copy()
        if depths is not None:
            of_rock = depths[:, [_index(settings, name) for name in names]]
            depth = np.where(np.isnan(depth), of_rock, depth)
        depth[values["filled"] < 0] = np.nan
    displacement = (motion.displacement or np.nan) / 1e3
    gravity = np.array([GRAVITY_SHARE[side] for side in SIDES])

    def demand(velocity: NDArray) -> NDArray:
        return energy_demand(velocity[..., None], depth[:, :, None], settings.density, displacement, gravity)

    at = demand(values["velocity"])
    ends = [demand(values["velocity_interval"][..., end]) for end in range(2)]
    carried = np.array([weakest_class(one, settings.support) for one in at.ravel()], object)
    return {
        "depth": depth,
        "demand": at,
        "demand_interval": np.stack(ends, axis=-1),
        "carried_by": carried.reshape(at.shape),
    }


def depth_source(settings: ShakingSlice, depths: NDArray | None) -> str:
    """Where the depths of the rock that is thrown are from, as the end of a sentence; empty without any."""
    motion = settings.ground_motion
    if motion.displacement is None:
        return ""
    failed = FAILED_DEPTHS.get(motion.failed_depth)
    parts = ["the mine file"] * bool(motion.depths) + ([failed] if failed and depths is not None else [])
    return " and ".join(parts)


def _index(settings: ShakingSlice, name: str) -> int:
    """Place of an opening in the slice."""
    return [opening.name for opening in settings.openings].index(name)
