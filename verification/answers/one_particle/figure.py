"""Figure of the single cell: stress and volume over axial strain, as in the paper's Fig. 13.

Stress is axial less lateral, since the drop at constant strain changes the lateral stress as well.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures.style import MODELLED, OUTLINE, RECORDED, applied, new_figure
from verification.answers.one_particle.closed_form import Axial
from verification.answers.one_particle.path import Path

PER_THOUSAND = 1e3


def draw(paths: dict[str, Path]) -> Figure:
    """Axial less lateral stress over axial strain, one panel per path, compression or tension up; volume below."""
    with applied():
        figure = new_figure(height=5.6)
        panels = figure.subplots(2, len(paths), squeeze=False, height_ratios=[2, 1], sharex="col")
        for (upper, lower), (name, path) in zip(panels.T, paths.items(), strict=True):
            _stress(upper, name, path)
            _volume(lower, path)
        panels[0, 0].set_ylabel("axial less lateral stress (MPa)")
        panels[1, 0].set_ylabel("expansion (‰ of volume)")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
        figure.supxlabel("axial shortening, pulled: stretching (‰)", fontsize=9.5)
    return figure


def _stress(axes: Axes, name: str, path: Path) -> None:
    sign = 1.0 if path.pulled else -1.0
    failed = next(point for point in path.exact if point.failed)
    assert failed.peak is not None  # a calculated point that fails has both stresses
    assert failed.dropped is not None
    peak_strain = path.specimen.peak_strain(path.pulled)
    # The lines are elastic loading, the drop at constant strain, and equilibrium with residual flow.
    rising = [(0.0, 0.0), (sign * peak_strain, sign * path.specimen.youngs_modulus * peak_strain)]
    at = sign * failed.strain.axial
    drop = [(at, sign * difference(failed.peak)), (at, sign * difference(failed.dropped))]
    after = [drop[-1], *((sign * point.strain.axial, sign * difference(point.stress)) for point in path.exact[1:])]
    _line(axes, rising + drop[:1], color=OUTLINE, label="hand calculation")
    _line(axes, after, color=OUTLINE)
    _line(axes, drop, color=RECORDED, linewidth=3.5, label="brittle drop, seismic")
    strain = [sign * point.strain.axial * PER_THOUSAND for point in path.found]
    stress = [sign * difference(point.stress) / 1e6 for point in path.found]
    axes.plot(strain, stress, "o", color=MODELLED, markersize=5, label="cell at rest, by step")
    pressure = path.specimen.pressure / 1e6
    axes.set_title(name + (f", {pressure:g} MPa around" if pressure else ""))
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)


def difference(stress: Axial) -> float:
    """Axial less lateral stress, Pa."""
    return stress.axial - stress.lateral


def _line(axes: Axes, points: list[tuple[float, float]], **style) -> None:
    strain, stress = np.array(points).T
    axes.plot(strain * PER_THOUSAND, stress / 1e6, **{"linewidth": 1.2, "solid_capstyle": "butt"} | style)


def _volume(axes: Axes, path: Path) -> None:
    sign = 1.0 if path.pulled else -1.0
    for points, style in ((path.exact, {"color": OUTLINE, "linewidth": 1.2}), (path.found, {"color": MODELLED})):
        strain = [0.0, *(sign * point.strain.axial * PER_THOUSAND for point in points)]
        volume = [0.0, *(point.strain.volumetric * PER_THOUSAND for point in points)]
        if points is path.found:
            axes.plot(strain[1:], volume[1:], "o", markersize=5, **style)
        else:
            axes.plot(strain, volume, **style)
    axes.axhline(0.0, color=OUTLINE, linewidth=0.5)
