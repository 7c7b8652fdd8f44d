"""Velocities, chances, intervals and fitted coefficients of package shaking against known truth."""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import ndtr, ndtri
from scipy.stats import nbinom

from catalogs.figures import style
from shaking.fit import COEFFICIENTS, Velocities, fit_relation
from shaking.hazard import Shaking
from shaking.relations import GroundMotion, relation_of
from shaking.settings import GroundMotionSettings
from verification.comparisons import monte_carlo_error
from verification.page_tables import Pivot
from verification.plots import plot_errors, plot_series
from verification.results import Results
from verification.rows import Row

NUMERICS = ("shaking",)  # Folders that the results may change with.
TABLES = (
    Pivot(
        "Share of drawn steps that exceed the velocity of a chance",
        r"steps of variance over mean (?P<row>[\d.]+): share above the velocity of a chance of (?P<column>.+)",
        "measured",
    ),
    Pivot(
        "Coverage of the 95 % interval of a velocity",
        r"(?P<row>\d+ events, \d+ runs?): coverage of the interval at a chance of (?P<column>[\d.]+ %)",
        "measured",
    ),
    Pivot(
        "Coverage of the 95 % intervals of fitted coefficients",
        r"(?P<row>between .+): coverage of the interval of (?P<column>[abc])",
        "measured",
    ),
)
STEPS_SHOWN = 40  # velocities of a curve in the figure


@dataclass(frozen=True)
class Coverage:
    """Shares (chance,) of catalogues whose interval holds the true velocity, with and without the further event, and
    the median ratio (chance,) of its ends."""

    name: str
    held: NDArray
    without: NDArray
    width: NDArray


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows on closed forms, drawn steps, intervals and fits; one figure."""
    settings, allowed = results.settings, results.allowed
    generator = np.random.default_rng(settings["seed"])
    coverages = [covered(settings, case, generator) for case in settings["process"]["cases"]]
    drawn = {one: drawn_shares(settings, one, generator) for one in settings["steps"]["dispersions"]}
    rows = [
        *equation_rows(allowed["equation"]),
        *source_rows(settings, allowed["closed_form"]),
        *line_rows(settings, allowed),
        *drawn_rows(settings, drawn, allowed["chance"]),
        *interval_rows(settings, coverages),
        *fit_rows(settings, allowed),
    ]
    return rows, draw(settings, drawn, coverages)


def equation_rows(allowed: float) -> list[Row]:
    """Published relations in their own units, one event each."""
    mcgarr = relation_of(GroundMotionSettings.of({"relation": {"name": "mcgarr_1981", "scatter": 0.3}}))
    own = 10.0 ** (-4.68 + 0.49 * 19.0) / 20_000.0 / 100.0  # M0 = 1e19 dyn cm = 1e12 N m at 200 m; cm/s to m/s
    found = float(10.0 ** mcgarr.log_median(12.0, 200.0))
    rock = {"s_wave_velocity": 3500.0, "strain_drop": 1e-4, "c_l": 12.0, "c_r": 1.4}
    mendecki = relation_of(GroundMotionSettings.of({"relation": {"name": "mendecki_2019", "scatter": 0.3} | rock}))
    length = 12.0 * 0.5 ** (1.0 / 3.0)
    published = 0.63 * 3500.0 * 1e-4 * (length / (80.0 + length)) ** 1.4
    return [
        Row.relative("mcgarr_1981: median velocity of 1e19 dyn cm at 200 m, m/s", own, found, allowed),
        Row.relative(
            "mendecki_2019: median velocity of 0.5 m3 at 80 m, m/s",
            published,
            float(10.0 ** mendecki.log_median(math.log10(0.5), 80.0)),
            allowed,
        ),
    ]


def source_rows(settings: dict, allowed: float) -> list[Row]:
    """One event expected, of a median of 0.2 m/s: the velocity of a chance q is exceeded with p = -ln(1 - q)."""
    scatter, chances = settings["scatter"], np.array(settings["chances"])
    one = Shaking(np.log10([0.2]), np.array([scatter]), 1, 1.0)
    expected = 0.2 * 10.0 ** (-scatter * ndtri(-np.log1p(-chances)))
    return [
        Row.relative(f"one source: velocity of a chance of {100 * chance:g} %, m/s", true, found, allowed)
        for chance, true, found in zip(chances, expected, one.velocity(chances)[:, 0], strict=True)
    ]


def line_of_sources(chosen: dict, relation: GroundMotion, size: float) -> Shaking:
    """Events along a line: each stands for as many as the density has along its spacing."""
    along = np.arange(-chosen["reach"] + 0.5 * chosen["spacing"], chosen["reach"], chosen["spacing"])
    distance = np.hypot(along, chosen["offset"])
    runs = round(1.0 / (chosen["density"] * chosen["spacing"]))
    median, deviation = relation.log_median(size, distance), relation.deviation(size, distance)
    return Shaking(median, deviation, runs, 2.0 * chosen["reach"] * chosen["density"])


def line_rows(settings: dict, allowed: dict) -> list[Row]:
    """A line of sources: number within the radius of a velocity without scatter, an integral with it."""
    chosen, rows = settings["line"], []
    sharp = GroundMotion("site", "mw", -1.0, 0.5, 1.0, 0.0, nearest=1.0)
    many = line_of_sources(chosen, sharp, 2.0)
    decay = -np.log1p(-np.array(settings["chances"]))
    true = 1.0 / np.hypot(decay / (2.0 * chosen["density"]), chosen["offset"])  # log10 v = -log10 R at Mw 2
    for chance, expected, found in zip(
        settings["chances"], true, many.velocity(settings["chances"])[:, 0], strict=True
    ):
        quantity = f"line of sources without scatter: velocity of a chance of {100 * chance:g} %, m/s"
        rows.append(Row.relative(quantity, expected, found, allowed["closed_form"]))
    scatter = settings["scatter"]
    spread = GroundMotion("site", "mw", -0.5, 0.4, 1.3, scatter, length=4.0, exponent=0.5)
    many = line_of_sources(chosen, spread, 1.2)
    for velocity in chosen["velocities"]:

        def density(along: float, at: float = velocity) -> float:
            median = spread.log_median(1.2, np.hypot(along, chosen["offset"]))
            return chosen["density"] * float(ndtr((median - np.log10(at)) / scatter))

        expected = 2.0 * quad(density, 0.0, chosen["reach"], limit=500)[0]
        found = float(many.rates(np.log10([velocity]))[0, 0])
        quantity = f"line of sources with scatter: expected number above {velocity:g} m/s"
        rows.append(Row.relative(quantity, expected, found, allowed["integral"]))
    return rows


def drawn_shares(settings: dict, dispersion: float, generator: np.random.Generator) -> NDArray:
    """Share of drawn steps (chance,) that exceed the velocity of each chance."""
    chosen, scatter = settings["steps"], settings["scatter"]
    median = np.log10(0.05) + chosen["spread"] * generator.standard_normal(chosen["events"])
    deviation = np.full(len(median), scatter)
    step = Shaking(median, deviation, chosen["runs"], len(median) / chosen["runs"], dispersion)
    velocity = np.log10(step.velocity(np.array(settings["chances"]))[:, 0])
    if dispersion > 1.0:
        number = nbinom.rvs(
            step.expected / (dispersion - 1.0), 1.0 / dispersion, size=chosen["drawn"], random_state=generator
        )
    else:
        number = generator.poisson(step.expected, chosen["drawn"])
    of_step = np.repeat(np.arange(chosen["drawn"]), number)
    felt = generator.choice(median, len(of_step)) + scatter * generator.standard_normal(len(of_step))
    largest = np.full(chosen["drawn"], -np.inf)
    np.maximum.at(largest, of_step, felt)
    return (largest[:, None] > velocity).mean(axis=0)


def drawn_rows(settings: dict, drawn: dict[float, NDArray], allowed: float) -> list[Row]:
    """Rows of the shares of drawn steps, against the chances."""
    return [
        Row.absolute(
            f"steps of variance over mean {dispersion:g}: share above the velocity of a chance of {100 * chance:g} %",
            chance,
            float(share),
            allowed,
        )
        for dispersion, shares in drawn.items()
        for chance, share in zip(settings["chances"], shares, strict=True)
    ]


def drawn_events(chosen: dict, number: int, generator: np.random.Generator) -> tuple[NDArray, NDArray]:
    """log10 potency (event,) m3 and distance from the wall (event,) m of events of the process."""
    low, high = chosen["ends"]
    rate = chosen["b"] * math.log(10.0)
    size = low - np.log1p(generator.random(number) * np.expm1(-rate * (high - low))) / rate
    place = np.linalg.norm(generator.normal(size=(number, 3)) * chosen["cloud"], axis=1)
    return size, np.maximum(place - chosen["wall"], 0.0)


def covered(settings: dict, case: dict, generator: np.random.Generator) -> Coverage:
    """How often the interval of a velocity holds that of the process."""
    chosen, chances, scatter = settings["process"], np.array(settings["chances"]), settings["scatter"]
    relation = GroundMotion("site", "log_potency", -0.1, 0.49, 1.0, scatter, nearest=10.0)

    def shaking(size: NDArray, distance: NDArray, runs: int, expected: float, strongest=None) -> Shaking:
        deviation = np.full(len(size), scatter)
        return Shaking(relation.log_median(size, distance), deviation, runs, expected, strongest=strongest)

    many = 200_000
    truth = shaking(*drawn_events(chosen, many, generator), round(many / case["events"]), case["events"])
    true = truth.velocity(chances)[:, 0]
    held, without, width = np.zeros(len(chances)), np.zeros(len(chances)), []
    for _ in range(chosen["catalogues"]):
        steps = [
            drawn_events(chosen, int(generator.poisson(case["events"] * case["runs"])), generator)
            for _ in range(chosen["steps"])
        ]
        size, distance = steps[0]
        largest, nearest = max(one.max() for one, _ in steps), min(one.min() for _, one in steps)
        strongest = float(relation.log_median(largest, nearest)), scatter
        expected = len(size) / case["runs"]
        low, high = shaking(size, distance, case["runs"], expected, strongest).velocity(chances)[:, 1:].T
        held += (low <= true) & (true <= high)
        width.append(high / low)
        low, high = shaking(size, distance, case["runs"], expected).velocity(chances)[:, 1:].T
        without += (low <= true) & (true <= high)
    name = f"{case['events']} events, {case['runs']} run{'s' * (case['runs'] > 1)}"
    return Coverage(name, held / chosen["catalogues"], without / chosen["catalogues"], np.median(width, axis=0))


def interval_rows(settings: dict, coverages: list[Coverage]) -> list[Row]:
    """Rows of the coverage of intervals of velocities: 95 % at least, within three Monte Carlo errors."""
    least = 0.95 - 3.0 * monte_carlo_error(0.95, settings["process"]["catalogues"])
    rows = []
    for one in coverages:
        for number, chance in enumerate(settings["chances"]):
            remark = f"Without the event more {one.without[number]:.3f}; upper over lower end {one.width[number]:.2g}."
            quantity = f"{one.name}: coverage of the interval at a chance of {100 * chance:g} %"
            rows.append(Row.at_least(quantity, float(one.held[number]), round(least, 3), remark))
    return rows


def drawn_velocities(chosen: dict, case: dict, generator: np.random.Generator) -> Velocities:
    """A record of velocities of the true relation."""
    events, most = chosen["events"], case["sensors"]
    count = generator.integers(max(1, most // 2), most + 1, events)
    event = np.repeat(np.arange(events), count)
    size = generator.uniform(-0.5, 2.5, events)[event]
    distance = 10.0 ** generator.uniform(1.3, 2.9, len(event))
    true = GroundMotion("site", "mw", scatter=0.0, **chosen["truth"])
    error = case["between"] * generator.standard_normal(events)[event]
    error += case["within"] * generator.standard_normal(len(event))
    return Velocities(event, size, distance, true.log_median(size, distance) + error)


def fit_rows(settings: dict, allowed: dict) -> list[Row]:
    """Rows of the coverage of fitted coefficients, and of their means."""
    chosen, rows = settings["fit"], []
    truth = np.array([chosen["truth"][name] for name in COEFFICIENTS])
    curve = {name: chosen["truth"][name] for name in ("length", "exponent")}
    for number, case in enumerate(chosen["cases"]):
        generator = np.random.default_rng([settings["seed"], 1, number])
        fits = [fit_relation(drawn_velocities(chosen, case, generator), **curve) for _ in range(chosen["records"])]
        intervals, found = np.array([fit.intervals for fit in fits]), np.array([fit.coefficients for fit in fits])
        held = ((intervals[..., 0] <= truth) & (truth <= intervals[..., 1])).mean(axis=0)
        name = f"between {case['between']:g}, within {case['within']:g}, up to {case['sensors']} sensors"
        for place, coefficient in enumerate(COEFFICIENTS):
            quantity = f"{name}: coverage of the interval of {coefficient}"
            rows.append(Row.absolute(quantity, 0.95, float(held[place]), allowed["coverage"]))
            bias = float((found[:, place].mean() - truth[place]) / found[:, place].std())
            rows.append(
                Row.absolute(f"{name}: bias of {coefficient} over its standard error", 0.0, bias, allowed["bias"])
            )
        scatter = math.sqrt(np.mean([fit.scatter**2 for fit in fits]))
        rows.append(
            Row.relative(f"{name}: scatter", math.hypot(case["between"], case["within"]), scatter, allowed["coverage"])
        )
    return rows


def draw(settings: dict, drawn: dict[float, NDArray], coverages: list[Coverage]) -> Figure:
    """A line of sources, drawn steps, and coverage of intervals."""
    figure = style.new_figure(height=4.0)
    left, middle, right = figure.subplots(1, 3)
    draw_line(left, settings)
    chances = np.array(settings["chances"])
    error = 300.0 * np.sqrt(chances * (1.0 - chances) / settings["steps"]["drawn"])
    names = [f"{100 * chance:g} %" for chance in chances]
    shares = {f"variance over mean {one:g}": 100.0 * (share - chances) for one, share in drawn.items()}
    what = "share of drawn steps less the chance (points of %)\n(bars: 3 Monte Carlo errors)"
    plot_errors(middle, names, shares, error, truth=0.0, title="Drawn steps", xlabel=what)
    middle.set_ylabel("chance")
    bottom, top = middle.get_ylim()
    middle.set_ylim(bottom + 0.2 * (bottom - top), top)  # room for the key
    middle.legend(loc="lower left")
    names_of_chances, names = names, [one.name for one in coverages]
    for number in range(len(chances)):
        held = [100.0 * one.held[number] for one in coverages]
        right.plot(
            held, range(len(names)), "o", color=style.MODELLED, alpha=0.4 + 0.3 * number, label=names_of_chances[number]
        )
        alone = [100.0 * one.without[number] for one in coverages]
        right.plot(alone, range(len(names)), "x", color=style.RECORDED, alpha=0.4 + 0.3 * number)
    right.axvline(95.0, color=style.OUTLINE, linewidth=0.9, linestyle="--")
    right.set_yticks(range(len(names)), names)
    right.invert_yaxis()
    right.set_title("Intervals of velocities")
    right.set_xlabel("truth inside the 95 % interval (%)\n(crosses: without the event more)")
    right.legend(title="chance", loc="center left")
    return figure


def draw_line(axes: Axes, settings: dict) -> None:
    """Expected number of exceedances of a line of sources without scatter, beside its closed form."""
    chosen = settings["line"]
    sharp = GroundMotion("site", "mw", -1.0, 0.5, 1.0, 0.0, nearest=1.0)
    velocity = np.geomspace(1.0 / chosen["reach"], 1.0 / chosen["offset"], STEPS_SHOWN)[:-1]
    found = line_of_sources(chosen, sharp, 2.0).rates(np.log10(velocity))[:, 0]
    true = 2.0 * chosen["density"] * np.sqrt(1.0 / velocity**2 - chosen["offset"] ** 2)
    plot_series(
        axes,
        {"sum over events": (velocity, found)},
        {"closed form": (velocity, true)},
        title="A line of sources",
        xlabel="velocity (m/s)",
        ylabel="expected number of exceedances",
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
