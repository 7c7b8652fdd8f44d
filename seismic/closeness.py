"""What two choices of the extraction make of the same rock: which mechanisms are alike, and which cells touch."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from common.source_tensors import scalar_potency
from common.voigt import tensor_from_voigt
from seismic.event_settings import EventSettings
from seismic.events import failed_rock, sum_by
from seismic.regions import CORNERS, EDGES, FACES

CLOSENESS_TRIED = (0.6, 0.7, 0.8, 0.9, 0.95)


def sizes_by_closeness(steps: Iterable[xr.Dataset], settings: EventSettings) -> xr.Dataset:
    """Resolved events of all steps at the mine's closeness, at each of CLOSENESS_TRIED, and with fewer links.

    steps: datasets of mining steps, one after the other; settings: EventSettings, or their values. Gives potency
    (event,) m3 and choice (event,): the index of the choice with which the event was extracted; closeness
    and reach (choice,): the cosine, and over what regions are linked (seismic.regions), 0 for families, which have no
    such links;
    attribute own: the index of the catalogue's own choice.
    """
    chosen = EventSettings.of(settings, "seismic")
    has_links = chosen.method == "simultaneous"
    choices = [(value, CORNERS if has_links else 0) for value in sorted({*CLOSENESS_TRIED, chosen.closeness})]
    own = [value for value, _ in choices].index(chosen.closeness)
    if has_links:
        choices += [(chosen.closeness, reach) for reach in (EDGES, FACES)]
    potency: list[list] = [[np.empty(0)] for _ in choices]
    for step in steps:
        rock = failed_rock(step, chosen)
        for (value, reach), parts in zip(choices, potency, strict=True):
            event, resolved = rock.events(chosen.model_copy(update={"closeness": value}), reach)
            parts.append(scalar_potency(tensor_from_voigt(sum_by(event, rock.potency, len(resolved))))[resolved])
    joined = [np.concatenate(parts) for parts in potency]
    closeness, reaches = zip(*choices, strict=True)
    return xr.Dataset(
        {
            "potency": ("event", np.concatenate(joined), {"units": "m3", "long_name": "scalar potency"}),
            "choice": (
                "event",
                np.repeat(np.arange(len(choices)), [len(part) for part in joined]),
                {"units": "1", "long_name": "choice with which the event was extracted"},
            ),
            "closeness": ("choice", list(closeness), {"units": "1", "long_name": "cosine above which rock is alike"}),
            "reach": (
                "choice",
                list(reaches),
                {"units": "1", "long_name": "links go over faces (1), also edges (2), also corners (3)"},
            ),
        },
        attrs={"mine": chosen.mine, "own": own},
    )
