"""A stope beside a fault of weak-plane rock: places of events, and whether their potency is slip along the planes."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from catalogs.figures import style
from common.voigt import voigt_from_tensor
from verification.comparisons import VOIGT_MULTIPLICITY, closing_row, vanishing
from verification.results import Results, Variant
from verification.rows import Row


def normal_of(material: dict) -> np.ndarray:
    """Upward unit normal (3,) of a material's planes. x east, y north, z up; dip direction clockwise from north."""
    dip, direction = (np.radians(material["planes"][key]) for key in ("dip", "dip_direction"))
    return np.array([np.sin(dip) * np.sin(direction), np.sin(dip) * np.cos(direction), np.cos(dip)])


def share_within(tensor: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Share (2-norm) of tensors (..., 3, 3) that is no slip along planes with normal n.

    It is 0 for n g + g n with g in the planes. The rest deforms the planes within themselves, or opens or closes them.
    """
    across = np.outer(normal, normal)
    within = np.eye(3) - across
    slip = within @ tensor @ across
    rest = tensor - slip - np.swapaxes(slip, -1, -2)
    size = np.linalg.norm(tensor, axis=(-2, -1))
    return np.linalg.norm(rest, axis=(-2, -1)) / np.where(size > 0.0, size, 1.0)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    rows = []
    for name, variant in results.variants.items():
        rows += variant_rows(name, variant, results.allowed["within"])
    states = (variant.step(step) for variant in results.variants.values() for step in variant.step_names)
    rows.append(closing_row("all", states))
    return rows, draw(results)


def band(variant: Variant) -> tuple[np.ndarray, np.ndarray, float]:
    """Middle of the fault (3,) m, its normal (3,), half its thickness m."""
    outline = np.array(variant.values["rock_bodies"][0]["points"])
    corners = np.insert(outline, 1, 0.0, axis=1)
    normal = normal_of(variant.values["materials"]["fault"])
    middle = corners.mean(axis=0)
    return middle, normal, float(np.abs((corners - middle) @ normal).max())


def variant_rows(name: str, variant: Variant, allowed: float) -> list[Row]:
    """Rows of one variant, over the events of all its steps."""
    middle, normal, half = band(variant)
    events = [variant.events(step) for step in variant.step_names]
    tensors = np.concatenate([event["potency_tensor"].values for event in events])
    places = np.concatenate([event["location"].values for event in events])
    count = len(tensors)
    rows = [Row.at_least(f"{name}: events of all steps", float(count), 1.0)]
    if not count:
        return rows
    share = float(share_within(tensors, normal).max())
    quantity = f"{name}: largest share of an event's potency that is not slip along the planes"
    rows.append(vanishing(quantity, share, allowed))
    on_planes = float(np.concatenate([event["on_planes"].values for event in events]).min())
    quantity = f"{name}: least share of an event that its table puts on planes"
    rows.append(Row.absolute(quantity, 1.0, on_planes, 0.0))
    cell = float(variant.grid.attrs["fine_cell"])
    off = float(np.maximum(np.abs((places - middle) @ normal) - half, 0.0).max() / cell)
    rows.append(vanishing(f"{name}: farthest event outside the fault, cells", off, 1.0))
    work = sense(variant)
    against = float(np.sum(work < 0.0) / len(work))
    quantity = f"{name}: share of particles that slipped against the virgin shear stress"
    rows.append(vanishing(quantity, against, remark="mining turns the shear stress round beside the stope"))
    return rows


def sense(variant: Variant) -> np.ndarray:
    """Work per volume of the virgin shear stress on the seismic strain of each particle that slipped, J/m3."""
    given = variant.values["insitu_stress"]["constant"]
    virgin = np.diag([given["xx"], given["yy"], given["zz"]])
    normal = normal_of(variant.values["materials"]["fault"])
    shear = (np.eye(3) - np.outer(normal, normal)) @ virgin @ normal
    shear = np.outer(shear, normal) + np.outer(normal, shear)
    voigt = VOIGT_MULTIPLICITY * voigt_from_tensor(shear)
    strains = [variant.step(step)["seismic_strain"].values for step in variant.step_names]
    return np.concatenate([strain[(strain != 0.0).any(axis=1)] @ voigt for strain in strains])


def draw(results: Results) -> Figure:
    """Events by step in the section, with fault and stopes."""
    figure = style.new_figure(height=5.0)
    panels = figure.subplots(1, len(results.variants), squeeze=False)[0]
    for axes, (name, variant) in zip(panels, results.variants.items(), strict=True):
        axes.add_patch(Polygon(variant.values["rock_bodies"][0]["points"], facecolor=style.FILL))
        for entry in variant.values["excavations"]:
            size = np.subtract(entry["upper"], entry["lower"])
            axes.add_patch(Rectangle(entry["lower"], *size, facecolor=style.EXCAVATION, edgecolor=style.OUTLINE))
        colours = style.step_colours([True] * len(variant.step_names))
        for step, colour in zip(variant.step_names, colours, strict=True):
            events = variant.events(step)
            x, _, z = events["location"].values.T
            size = 4.0 + 40.0 * np.sqrt(
                events["potency"].values / max(events["potency"].values.max(initial=0.0), 1e-30)
            )
            axes.scatter(x, z, s=size, color=colour, label=step, alpha=0.8)
        axes.set(title=name, xlabel="x (m)", ylabel="z (m)", aspect="equal", xlim=(30, 100), ylim=(20, 100))
        axes.legend()
    return figure
