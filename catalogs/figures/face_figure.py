"""How events of both catalogues are distributed against the face: ahead and across, by number and by potency."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style

BINS = 40
SHARE_OUTSIDE = 0.01  # Of the events of a catalogue that may lie beyond either end of an axis.
AXIS_LABELS = {"ahead": "ahead of the face (m); behind it below 0", "across": "across, from the middle of the face (m)"}
WEIGHT_LABELS = {"number": "share of events", "potency": "share of potency"}


def against_face(comparison: xr.Dataset, labels: dict[str, str]) -> Figure:
    """Histograms, a column for each axis and a row for each weight; labels of `model` and `record`."""
    colours = {"model": style.MODELLED, "record": style.RECORDED}
    figure = style.new_figure(height=5.2)
    array = figure.subplots(2, 2, sharex="col", squeeze=False)
    for column, axis in enumerate(AXIS_LABELS):
        places = {name: comparison[f"{name}_face"].sel(face_axis=axis).values for name in labels}
        ends = [np.quantile(one, [SHARE_OUTSIDE, 1.0 - SHARE_OUTSIDE]) for one in places.values() if len(one)]
        edges = np.linspace(min(low for low, _ in ends), max(high for _, high in ends), BINS + 1)
        for row, weight in enumerate(WEIGHT_LABELS):
            axes = array[row, column]
            for name, label in labels.items():
                shares = comparison[f"{name}_face_weight"].sel(weight=weight).values
                counted = np.histogram(places[name], edges, weights=shares)[0]
                axes.stairs(100.0 * counted, edges, color=colours[name], linewidth=1.5, label=label)
            if axis == "ahead":
                axes.axvline(0.0, color=style.OUTLINE, linewidth=0.9, linestyle="--", label="the face")
            axes.set_xlim(edges[0], edges[-1])
            axes.set_ylim(0, None)
            axes.set_ylabel(f"{WEIGHT_LABELS[weight]}\nper {np.diff(edges)[0]:.2g} m (%)")
        array[1, column].set_xlabel(AXIS_LABELS[axis])
    array[0, 1].legend(*array[0, 0].get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
