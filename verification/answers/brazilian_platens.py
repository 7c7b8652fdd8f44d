"""The Brazilian disc between closing platens (paper section 3.4, Figs 14 to 16), in three dimensions."""

from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from catalogs.figures import style
from common.errors import InputError
from verification.answers.brazilian_disc import NOTHING, event_rows, potency_rows
from verification.answers.brazilian_disc.closed_form import Disc, PeakStrength, first_failure
from verification.answers.brazilian_disc.crack import Crack, Moment, read_crack
from verification.answers.brazilian_disc.elastic_rock import means_by
from verification.answers.brazilian_disc.figure import draw_growth, draw_stages, draw_stress
from verification.comparisons import reported
from verification.plots import COLOURS
from verification.results import Results, Variant
from verification.rows import Row

KILO, MILLI, GIGA = 1e-3, 1e3, 1e9


class PlatenDisc:
    """A variant: its disc, the approach of its platens, and the elastic state before the step in which rock fails."""

    flat = False  # The scene has three dimensions.

    def __init__(self, name: str, variant: Variant):
        self.name, self.variant = name, variant
        values = variant.values
        rock, platen = values["materials"]["host"], values["rock_bodies"][0]
        outline = np.array(values["excavations"][0]["polygon"])
        self.center = np.zeros(2)
        thickness = values["domain"]["upper"][2] - values["domain"]["lower"][2]
        radius = float(np.abs(outline[:, 0]).max())
        width = float(outline[np.argmax(outline[:, 1]), 0])
        self.disc = Disc(radius, thickness, float(np.arcsin(abs(width) / radius)))
        self.height = values["domain"]["upper"][1] - values["domain"]["lower"][1]
        self.platen = platen["lower"][1]
        self.cell_size = values["grid"]["coarse_cell"]
        self.poisson_ratio = rock["poisson_ratio"]
        self.strength = PeakStrength.of(rock)
        self.strain = {entry["step"]: -entry["strain"]["yy"] for entry in values["strains"]}
        self.before = self.strain.pop(variant.mine.steps[0].name)

    def closing(self, step: str, share: float) -> float:
        """Approach of the platens, m, after this share of a step's strain.

        Raises InputError for the first step, in which no rock may fail.
        """
        if step not in self.strain:
            raise InputError(f"variants.{self.name}: rock fails in step {step} already; strain it less there")
        return (self.before + self.strain[step] * share) * self.height

    def text_of(self, step: str, share: float) -> str:
        """Approach of the platens as text."""
        return f"{MILLI * self.closing(step, share):.4f} mm"

    def force(self, state) -> float:
        """Force of the platens, N: stress along y integrated over the two layers of cells at the mid-plane."""
        beside = np.abs(state.position.values[:, 1]) < self.cell_size
        return -float(np.sum(state.stress.values[beside, 1] * state.volume.values[beside]) / (2.0 * self.cell_size))

    @cached_property
    def stiffness(self) -> float:
        """Force over approach of the platens, N/m, while rock is elastic."""
        return self.force(self.variant.elastic) / (self.before * self.height)

    def centre(self) -> float:
        """Stress across the load at the centre, Pa per newton: the mean of the cells around the axis."""
        state = self.variant.elastic
        near = (np.abs(state.position.values[:, :2]) < self.cell_size).all(axis=1)
        return float(state.stress.values[near, 0].mean()) / self.force(state)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study, of the variants that were run."""
    settings = results.settings
    discs = {name: PlatenDisc(name, variant) for name, variant in results.variants.items()}
    cracks = {name: read_crack(disc) for name, disc in discs.items()}
    rows = []
    for name in settings["compared"]:
        if name in discs:
            rows += elastic_rows(discs[name], cracks[name])
            rows += crack_rows(discs[name], cracks[name], results)
    shown = cracks.get(settings["shown"])
    rows += event_rows(shown, settings) if shown else []
    printed = cracks.get(settings["as_printed"])
    rows += printed_rows(printed, settings) if printed else []
    return rows, draw(discs, {name: crack for name, crack in cracks.items() if crack}, settings)


def elastic_rows(disc: PlatenDisc, crack: Crack | None) -> list[Row]:
    """Stress at the centre and force of first failure, compared with Hondros' even pressure over the same arcs.

    The rows have no bounds. Platens press hardest at their corners, and the free end faces of a thick disc bear more
    tension.
    """
    exact = disc.disc.stress(np.zeros(2), disc.disc.pressure(1.0))[0]
    quantity = f"{disc.name}: stress across the load at the centre, Pa per newton"
    rows = [Row.relative(quantity, exact, disc.centre(), None)]
    expected = first_failure(disc.disc, disc.poisson_ratio, disc.strength).resultant
    quantity = f"{disc.name}: force at which rock first fails, kN"
    if crack is None:
        return [*rows, Row(quantity, KILO * expected, NOTHING, NOTHING, remark="no rock fails")]
    closing = disc.closing(crack.step, crack.first_part / crack.parts)
    row = Row.relative(quantity, KILO * expected, KILO * disc.stiffness * closing, None)
    return [*rows, row]


def through_moment(crack: Crack, span: float) -> Moment | None:
    """The first moment at which the crack spans that share of the diameter in every layer; None if it never does."""
    late = (moment for moment in crack.moments if moment.span >= span)
    return next((moment for moment in late if crack.layer_spans(moment.generation).min() >= span), None)


def crack_rows(disc: PlatenDisc, crack: Crack[PlatenDisc] | None, results: Results) -> list[Row]:
    """Place of the potency and axis of opening at the moment when the crack spans every layer."""
    allowed, settings = results.allowed, results.settings
    moment = through_moment(crack, settings["span"]) if crack else None
    if crack is None or moment is None:
        last = f"least span {crack.layer_spans(crack.moments[-1].generation).min():.2f}" if crack else "no rock fails"
        return potency_rows(disc.name, None, None, settings, allowed, f"it never runs through: {last}")
    spans = crack.layer_spans(moment.generation)
    remark = (
        f"{spans.min():.2f} to {spans.max():.2f} of it spanned in {len(spans)} layers after "
        f"{moment.generation + 1} generations, {moment.failed_cells} cells, platens "
        f"{crack.text_of(moment.part)} closer (first failure: {crack.text_of(crack.first_part)})"
    )
    return potency_rows(disc.name, crack, moment, settings, allowed, remark)


def printed_rows(crack: Crack, settings: dict) -> list[Row]:
    """Crack of the variant with Table 1 as printed, reported without bounds."""
    name, first = crack.disc.name, crack.place[crack.rank == 0]
    last = crack.moments[-1]
    moment = through_moment(crack, settings["span"]) or last
    spans = crack.layer_spans(moment.generation)
    height = float(np.abs(first[:, 1]).mean() / crack.disc.disc.radius)
    near = crack.near_share(settings["near"], moment)
    dissipated = float(crack.state.attrs["energy_dissipated"])
    remark = f"{MILLI * np.abs(first[:, 0]).mean():.1f} mm beside the diameter, at {crack.text_of(crack.first_part)}"
    rest = "no rest" if crack.state.attrs["collapsed"] else "at rest"
    near_remark = f"{dissipated:.3g} J dissipated in the step"
    return [
        reported(f"{name}: height of the first failure, R", height, remark),
        reported(f"{name}: least span of any layer", float(spans.min()), f"{moment.failed_cells} cells; then {rest}"),
        reported(f"{name}: share of potency near the loaded diameter then", near, near_remark),
    ]


def stages_of(crack: Crack, span: float) -> list[Moment]:
    """Six moments: three until the crack spans every layer, the end of that part, half of the rest, and the end."""
    moments = crack.moments
    through = through_moment(crack, span) or moments[-1]
    rest = [moment.generation for moment in moments if moment.part == through.part][-1]
    half = 0.5 * (through.part + moments[-1].part)
    middle = max(rest, [moment.generation for moment in moments if moment.part <= half][-1])
    wanted = (through.generation // 3, 2 * through.generation // 3, through.generation, rest, middle)
    return [moments[generation] for generation in (*wanted, moments[-1].generation)]


def draw(discs: dict[str, PlatenDisc], cracks: dict[str, Crack[PlatenDisc]], settings: dict) -> Figure:
    """Growth of every variant's crack, potency by approach of the platens, and six stages of the shown crack."""
    shown = cracks.get(settings["shown"])
    figure = style.new_figure(height=3.9 + (8.2 if shown else 0.0))
    upper: FigureBase = figure
    if shown:
        upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=[3.9, 8.2])[:, 0]
        draw_stages(lower, shown, stages_of(shown, settings["span"]))
    stress, growth, potency = upper.subplots(1, 3)
    draw_diameter(stress, next(iter(discs.values())))
    draw_growth(growth, cracks)
    draw_potency(potency, cracks)
    return figure


def draw_diameter(axes: Axes, disc: PlatenDisc) -> None:
    """Stress on the loaded diameter, mean through the thickness, with Hondros' lines."""
    state = disc.variant.elastic
    near = np.flatnonzero((np.abs(state.position.values[:, 0]) < disc.cell_size) & (state.volume.values > 0.0))
    height, found = means_by(np.round(state.position.values[near, 1], 9), state.stress.values[near, :2])
    inside = np.abs(height) < disc.platen
    line = np.linspace(-0.999, 0.999, 401) * disc.disc.radius
    exact = disc.disc.stress(np.stack([0.0 * line, line], axis=1), disc.disc.pressure(disc.force(state)))
    title = f"Loaded diameter at {KILO * disc.force(state):.2f} kN"
    draw_stress(axes, title, height[inside], found[inside].T, (line, exact.T[:2]))


def draw_potency(axes: Axes, cracks: dict[str, Crack[PlatenDisc]]) -> None:
    """Potency so far by approach of the platens. A step is a crack that runs while the platens do not move."""
    for (name, crack), colour in zip(cracks.items(), COLOURS, strict=False):
        parts = np.arange(crack.parts + 1)
        fresh = np.diff([moment.potency for moment in crack.moments], prepend=0.0)
        by_part = np.bincount(crack.part_of, fresh, crack.parts + 1)
        closing = [MILLI * crack.disc.closing(crack.step, part / crack.parts) for part in parts]
        axes.step(closing, GIGA * np.cumsum(by_part), where="post", color=colour, linewidth=1.2, label=name)
    labels = {"xlabel": "approach of the platens (mm)", "ylabel": "potency so far (mm³)"}
    axes.set(title="Potency by platen displacement", **labels)
    axes.legend(loc="upper left")
