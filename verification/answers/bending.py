"""Skins and plates that bend, against beam and plate theory, by the cells across them and the place of their walls.

Pure bending of an elastic plate of thickness t with traction-free faces is exact in three dimensions (Timoshenko and
Goodier 1970, Theory of Elasticity, article 98). With curvatures k_x, k_y, k_xy, and z from the middle plane,

    u = -z (k_x x + k_xy y)    v = -z (k_y y + k_xy x)
    w = k_x x^2 / 2 + k_y y^2 / 2 + k_xy x y + nu / (2 (1 - nu)) (k_x + k_y) z^2

holds, per area, the energy D / 2 (k_x^2 + k_y^2 + 2 nu k_x k_y + 2 (1 - nu) k_xy^2), with D = E t^3 / (12 (1 - nu^2)).
The sides of the domain are moved so; the rock between them comes to rest. In its middle half, energy over the
squares of the curvatures is the stiffness. In plane strain k_x alone counts.

A skin clamped at both ends sags by its own weight q by q L^4 / (384 D) + q L^2 / (8 k G t), with the shear coefficient
k = 5 / 6 (Timoshenko 1921).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from mpm_core.equilibrium.convergence import History
from mpm_core.model.model import Model
from mpm_core.scene.scene import InsituStress
from mpm_core.stages.step_cells import stored
from verification.answers.invariants.operator import model_of, scheme_of
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results, Variant
from verification.rows import Row

MILLI = 1e3
SHEAR_COEFFICIENT = 5.0 / 6.0
CURVATURE = 1e-6  # 1/m
WEIGHTLESS = InsituStress(np.zeros(6), np.zeros(6), 0.0)  # of rock that bends because its sides are moved
FINEST_PLATE = "plate_4"
TOLERANCE = 1e-9  # Unbalanced force over a moment per width times the curved width over the thickness.
CURVATURES: Mapping[int, Mapping[str, tuple[float, float, float]]] = {
    2: {"bending": (1.0, 0.0, 0.0)},
    3: {"bending": (1.0, 0.0, 0.0), "dome": (1.0, 1.0, 0.0), "saddle": (1.0, -1.0, 0.0), "twist": (0.0, 0.0, 1.0)},
}  # (k_x, k_y, k_xy) over CURVATURE by name, by dimension.

TABLES = (
    Pivot("Change of a skin against theory (%)", r"(?P<row>(?!plate)\w+): (?P<column>stiffness|sag).*", "change, %"),
    Pivot(
        "Change of a plate's stiffness against theory (%)",
        r"(?P<row>plate\w+): stiffness in (?P<column>\w+).*",
        "change, %",
    ),
    Pivot("Change of a plate's sag against four cells (%)", r"(?P<row>plate\w+): (?P<column>sag).*", "change, %"),
)


@dataclass(frozen=True)
class Plate:
    """A skin or plate: thickness, span, middle (elevation of its middle plane) m; modulus E Pa; weight Pa."""

    thickness: float
    span: float
    middle: float
    modulus: float
    poisson_ratio: float
    weight: float

    @property
    def rigidity(self) -> float:
        """D, N m."""
        return self.modulus * self.thickness**3 / (12.0 * (1.0 - self.poisson_ratio**2))

    def motion(self, place: np.ndarray, curvature: np.ndarray) -> np.ndarray:
        """Displacement (k, d) m at places (k, d) m under curvatures (3,) 1/m."""
        x, y = place[:, 0], place[:, 1] if place.shape[1] == 3 else np.zeros(len(place))
        z = place[:, -1] - self.middle
        along_x, along_y, twist = curvature
        bulge = self.poisson_ratio / (2.0 * (1.0 - self.poisson_ratio)) * (along_x + along_y) * z**2
        u, v = -z * (along_x * x + twist * y), -z * (along_y * y + twist * x)
        w = 0.5 * (along_x * x**2 + along_y * y**2) + twist * x * y + bulge
        return np.stack([u, w] if place.shape[1] == 2 else [u, v, w], axis=1)

    def energy(self, curvature: np.ndarray) -> float:
        """Energy per area, J/m2, under curvatures (3,) 1/m."""
        along_x, along_y, twist = curvature
        nu = self.poisson_ratio
        form = along_x**2 + along_y**2 + 2.0 * nu * along_x * along_y + 2.0 * (1.0 - nu) * twist**2
        return 0.5 * self.rigidity * float(form)

    @property
    def sag(self) -> float:
        """Sag of a skin that is clamped at both ends, in its middle, m."""
        shear = SHEAR_COEFFICIENT * self.modulus / (2.0 * (1.0 + self.poisson_ratio)) * self.thickness
        return self.weight * self.span**2 * (self.span**2 / (384.0 * self.rigidity) + 1.0 / (8.0 * shear))


def plate_of(variant: Variant) -> Plate:
    """The rock between the upper and the lower excavation of a variant, as far as the domain reaches."""
    values = variant.values
    rock, (above, below) = values["materials"]["host"], values["excavations"]
    top, bottom = above["lower"][-1], below["upper"][-1]
    return Plate(
        thickness=top - bottom,
        span=values["domain"]["upper"][0] - values["domain"]["lower"][0],
        middle=0.5 * (top + bottom),
        modulus=rock["youngs_modulus"],
        poisson_ratio=rock["poisson_ratio"],
        weight=-values["insitu_stress"]["gradient"]["zz"] * (top - bottom),
    )


def stiffness(model: Model, plate: Plate, curvature: np.ndarray) -> float:
    """Stiffness over that of theory, of a plate whose sides are bent to these curvatures (3,) 1/m."""
    scheme, d = scheme_of(model), model.dimension
    body, place = scheme.body, model.node_position
    body.displace(plate.motion(place, curvature))
    reference = plate.rigidity * float(np.abs(curvature).max()) * plate.span ** (d - 2) / plate.thickness
    scheme.reach_equilibrium(np.zeros_like(place), TOLERANCE, reference, History(TOLERANCE))

    def in_the_middle(model: Model) -> np.ndarray:
        return (np.abs(model.grid.cell_center[:, : d - 1]) < 0.25 * plate.span).all(axis=1)

    area = (0.5 * plate.span) ** (d - 1)
    return stored(body, in_the_middle) / (plate.energy(middle_curvature(body, plate)) * area)


def middle_curvature(body, plate: Plate) -> np.ndarray:
    """Curvatures (3,) 1/m of a body in the middle half of a plate: least squares over one layer of nodes."""
    place = body.model.node_position
    inside = body.attached & (np.abs(place[:, :-1]) <= 0.25 * plate.span).all(axis=1)
    height = np.abs(place[:, -1] - plate.middle)
    layer = np.flatnonzero(inside)
    layer = layer[place[layer, -1] == place[layer[np.argmin(height[layer])], -1]]
    x, y = place[layer, 0], place[layer, 1] if place.shape[1] == 3 else np.zeros(len(layer))
    terms = np.stack([0.5 * x**2, 0.5 * y**2, x * y, x, y, np.ones(len(layer))], axis=1)
    return np.linalg.lstsq(terms, body.state.displacement[layer, -1], rcond=None)[0][:3]


def sag(variant: Variant, plate: Plate) -> float:
    """Displacement down of the middle of a plate, m: of its node, or two, next to the middle plane."""
    place, moved = variant.elastic.node_position.values, variant.elastic.node_displacement.values
    height = np.abs(place[:, 2] - plate.middle)
    axis = (place[:, :2] == 0.0).all(axis=1)
    middle = axis & (height == height[axis].min())
    return -float(moved[middle, 2].mean())


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    rows, ratios = [], {}
    plates = {name: plate_of(variant) for name, variant in results.variants.items()}
    finest = results.present([FINEST_PLATE])
    for name, variant in results.variants.items():
        plate, model = plates[name], model_of(variant, insitu=WEIGHTLESS)
        bound, found = results.allowed["cells_" + name.rsplit("_", 1)[1]], MILLI * sag(variant, plate)
        for case, curvature in CURVATURES[model.dimension].items():
            ratio = ratios[name, case] = stiffness(model, plate, CURVATURE * np.array(curvature))
            allowed = bound if case == "bending" else None
            rows.append(Row.relative(f"{name}: stiffness in {case} over theory's", 1.0, ratio, allowed))
        if model.dimension == 2:
            expected = MILLI * plate.sag
            rows.append(Row.relative(f"{name}: sag in the middle, mm", expected, found, bound))
            ratios[name, "sag"] = expected / found
        elif finest and name != FINEST_PLATE:
            scale = (plate.thickness / plates[FINEST_PLATE].thickness) ** 2
            expected = MILLI * sag(results[FINEST_PLATE], plates[FINEST_PLATE]) * scale
            rows.append(Row.relative(f"{name}: sag in the middle, mm", expected, found, bound))
    return rows, draw(ratios)


def draw(ratios: dict[tuple[str, str], float]) -> Figure:
    """Stiffness over that of theory, of skins by their names and of plates by the way they bend."""
    figure = style.new_figure(height=4.2)
    plates = [name for name, case in ratios if case == "twist"]
    skins = [name for name, case in ratios if case == "sag"]
    columns = figure.subplots(1, 2)
    for axes, names, labels in (
        (columns[0], skins, {"bending": "bent by the ends", "sag": "own weight"}),
        (columns[1], plates, {case: case for case in CURVATURES[3]}),
    ):
        series = {label: [ratios[name, case] for name in names] for case, label in labels.items()}
        reach: dict = {"xlim": (0.7, 1.5), "xlabel": "stiffness over theory's"}
        plot_errors(axes, names, series, truth=1.0, marks="os^D", **reach)
    columns[0].set_title("Skins")
    columns[1].set_title("Plates")
    return figure
