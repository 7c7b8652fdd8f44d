"""Closure of a panel on elastic gob against a slit on springs, by height, stiffness, cells and dip.

A slit in elastic rock in plane strain, held open by springs.

The slit |x| < a has no height. The far stress p presses on it, and springs of stiffness k (Pa/m) push back, so that its
walls close by c(x), with E' = E / (1 - nu^2):

    E' / (4 pi) f.p. integral c(s) / (x - s)^2 ds  =  k c(x) - p      on |x| < a, c(+-a) = 0.

With c = sqrt(1 - t^2) sum_n b_n U_n(t), t = x / a and Chebyshev polynomials U_n, the left side is
-E' / (4 a) sum_n (n + 1) b_n U_n (Sneddon and Lowengrub 1969, Crack Problems in the Classical Theory of Elasticity;
Kaya and Erdogan 1987, Q. Appl. Math. 45, 105). Multiplied by sqrt(1 - t^2) U_m and integrated, it is a linear system,
whose matrix converges faster than any power of the number of terms. Without springs c = 4 p sqrt(a^2 - x^2) / E', a
mined seam without fill (Salamon 1968); with stiff ones c = p / k but at the ends.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.page_tables import Pivot
from verification.plots import plot_series
from verification.results import Results, Variant
from verification.rows import Row

TERMS = 60


@dataclass(frozen=True)
class Slit:
    """half_width m; pressure Pa, positive in compression; modulus E' Pa; spring Pa/m."""

    half_width: float
    pressure: float
    modulus: float
    spring: float

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """b_n (TERMS,) m."""
        number = np.arange(TERMS)
        rock = np.diag(self.modulus / (4.0 * self.half_width) * (number + 1) * np.pi / 2.0)
        # integral (1 - t^2) U_n U_m dt = integral sin((n + 1) q) sin((m + 1) q) sin(q) dq, 0 to pi
        total, apart = number[:, None] + number + 2, number[:, None] - number
        with np.errstate(divide="ignore"):
            springs = np.where(total % 2 == 0, 1.0 / (1.0 - apart**2.0) - 1.0 / (1.0 - total**2.0), 0.0)
        load = np.zeros(TERMS)
        load[0] = self.pressure * np.pi / 2.0
        return np.linalg.solve(rock + self.spring * springs, load)

    def closure(self, x: np.ndarray) -> np.ndarray:
        """Closure of the walls (k,) m at x (k,) m from the middle; 0 beyond the ends."""
        angle = np.arccos(np.clip(np.asarray(x, float) / self.half_width, -1.0, 1.0))
        return np.sin(np.outer(angle, np.arange(TERMS) + 1)) @ self._coefficients

    @property
    def closed_area(self) -> float:
        """Integral of the closure over the width, m2."""
        return float(self.half_width * np.pi / 2.0 * self._coefficients[0])


TABLES = (
    Pivot("Error against the slit (%)", r"(?P<row>(?:level|stiff|thin)_\w+): (?P<column>[^,]+), (?:m2|mm)", "error, %"),
    Pivot(
        "Error of a dipping opening against a level one (%)",
        r"(?P<row>dip_\w+): (?P<column>closed area)[^,]*, m2",
        "error, %",
    ),
)

MILLI = 1e3


def exact_slit(variant: Variant) -> Slit:
    """The slit of a variant: as wide as its opening, on springs as stiff as its gob in uniaxial strain."""
    values = variant.values
    opening, rock = values["excavations"][0], values["materials"]["host"]
    gob = variant.mine.settings.materials[opening["fill"]]
    corners = np.array(opening["points"] if "points" in opening else [opening["lower"], opening["upper"]])
    height = corners[-1, 1] - corners[0, 1]
    return Slit(
        half_width=0.5 * float(np.ptp(corners[:, 0])),
        pressure=-values["insitu_stress"]["constant"]["zz"],
        modulus=rock["youngs_modulus"] / (1.0 - rock["poisson_ratio"] ** 2),
        spring=(gob.lame_lambda + 2.0 * gob.shear_modulus) / height,
    )


def closed_area(variant: Variant) -> float:
    """Area by which the opening closes, m2: twice the energy that mining at once sets in motion, over the pressure."""
    return 2.0 * float(variant.elastic.attrs["energy_motion"]) / exact_slit(variant).pressure


def closure(variant: Variant) -> tuple[np.ndarray, np.ndarray]:
    """Places x (k,) m of the nodes of a level opening's roof and floor, and how much the two approach there (k,) m."""
    opening = variant.values["excavations"][0]
    place, moved = variant.elastic.node_position.values, variant.elastic.node_displacement.values
    (left, floor), (right, roof) = opening["lower"], opening["upper"]
    at = {}
    for name, height in (("floor", floor), ("roof", roof)):
        nodes = np.flatnonzero((place[:, 2] == height) & (place[:, 0] >= left) & (place[:, 0] <= right))
        at[name] = nodes[np.argsort(place[nodes, 0])]
    return place[at["roof"], 0], moved[at["floor"], 2] - moved[at["roof"], 2]


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    allowed, rows = results.allowed, []
    level = {name: variant for name, variant in results.variants.items() if not name.startswith("dip")}
    for name, variant in level.items():
        exact, (place, found) = exact_slit(variant), closure(variant)
        bounds = [allowed["thin"]] * 2 if name.startswith("thin") else [allowed["area"], allowed["middle"]]
        middle = float(found[np.argmin(np.abs(place))])
        expected = float(exact.closure(np.zeros(1))[0])
        rows += [
            Row.relative(f"{name}: closed area, m2", exact.closed_area, closed_area(variant), bounds[0]),
            Row.relative(f"{name}: closure at the middle, mm", MILLI * expected, MILLI * middle, bounds[1]),
        ]
    for name, variant in results.variants.items():
        if name in level:
            continue
        cell = name.split("_")[1]
        bound = None if name.endswith("mean") else allowed["dip"]
        of_level = closed_area(results[f"level_{cell}"])
        rows.append(
            Row.relative(f"{name}: closed area against the level one's, m2", of_level, closed_area(variant), bound)
        )
    return rows, draw(level)


def draw(level: dict[str, Variant]) -> Figure:
    """Closure along soft and stiff gob, for each size of cell, with the closed form."""
    figure = style.new_figure(height=3.6)
    for axes, kind in zip(figure.subplots(1, 2), ("level", "stiff"), strict=True):
        shown = {name: variant for name, variant in level.items() if name.startswith(kind)}
        first = next(iter(shown.values()))
        exact = exact_slit(first)
        x = np.linspace(-exact.half_width, exact.half_width, 400)
        found = {}
        for name, variant in shown.items():
            place, closed = closure(variant)
            found[f"{name.split('_')[1]} m cells"] = place, MILLI * closed
        modulus = first.values["materials"]["gob"]["youngs_modulus"]
        labels: dict = {"title": f"gob of {modulus / 1e6:g} MPa", "xlabel": "x (m)", "ylabel": "closure (mm)"}
        plot_series(axes, found, {"slit, exact": (x, MILLI * exact.closure(x))}, marks=("o", "s", "^"), **labels)
    return figure
