"""What closeness makes of the same rock: sizes of events at several of them, since it sets their number and b."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from seismic.events import extract_events
from seismic.settings import EventSettings

CLOSENESS = (0.6, 0.7, 0.8, 0.9, 0.95)


def sizes_by_closeness(steps: Iterable[xr.Dataset], settings: EventSettings) -> xr.Dataset:
    """Resolved events of all steps, extracted at each CLOSENESS and at the mine's own.

    steps: datasets of mining steps, one after the other; settings: EventSettings, or their values. Gives potency
    (event,) m3 and, beside it, the closeness at which the event was extracted (event,); attribute own: the mine's.
    """
    chosen = EventSettings.of(settings, "seismic")
    values = sorted({*CLOSENESS, chosen.closeness})
    potency: dict[float, list] = {value: [np.empty(0)] for value in values}
    for step in steps:
        for value in values:
            events, _ = extract_events(step, chosen.model_copy(update={"closeness": value}))
            potency[value].append(events["potency"].values[events["resolved"].values == 1])
    joined = {value: np.concatenate(parts) for value, parts in potency.items()}
    return xr.Dataset(
        {
            "potency": ("event", np.concatenate(list(joined.values())), {"units": "m3", "long_name": "scalar potency"}),
            "closeness": (
                "event",
                np.repeat(values, [len(part) for part in joined.values()]),
                {"units": "1", "long_name": "closeness at which the event was extracted"},
            ),
        },
        attrs={"mine": chosen.mine, "own": chosen.closeness, "tried": values},
    )
