"""The Brazilian disc (paper section 3.4, Figs 14 to 16): elastic field, first failure, and the crack."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.sources.sizes import estimate_b, log_potency
from verification.answers.brazilian_disc.crack import Crack, Moment, read_crack
from verification.answers.brazilian_disc.elastic_rock import PressedDisc
from verification.answers.brazilian_disc.figure import draw
from verification.comparisons import convergence_orders, reported, vanishing
from verification.results import Results
from verification.rows import Row

KILO, MILLI, MICRO, GIGA = 1e-3, 1e3, 1e6, 1e9
NOTHING = float("nan")
NO_REST = "no state of rest with failed rock among the steps: the crack runs at the load of the first failure"


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study, of the variants that were run."""
    settings = results.settings
    discs = {name: PressedDisc(name, variant) for name, variant in results.variants.items()}
    cracks = {name: read_crack(disc) for name, disc in discs.items()}
    rows = []
    for name in settings["compared"]:
        if name in discs:
            crack = cracks[name]
            rows += elastic_rows(discs[name], results.allowed)
            rows += crack_rows(discs[name], crack, results)
            rows += event_rows(crack, settings) if crack else []
            rows += cost_rows(discs[name], crack)
    rows += order_rows([discs[name] for name in settings.get("cells", []) if name in discs], results.allowed)
    rows += together_rows(cracks.get("together"), settings)
    rows += spread_rows([crack for name in settings.get("spread", []) if (crack := cracks.get(name))], settings)
    return rows, draw(discs, cracks, settings)


def elastic_rows(disc: PressedDisc, allowed: dict) -> list[Row]:
    """Elastic field against Hondros', and first failure against that of plane strain."""
    rows = []
    stress, exact_stress = disc.centre_stress()
    load = disc.loading.before
    through = "" if disc.flat else ", mean through the thickness"
    for component, index in (("across", 0), ("along", 1)):
        quantity = f"{disc.name}: stress at the centre {component} the load{through}, Pa per newton"
        rows.append(Row.relative(quantity, exact_stress[index] / load, stress[index] / load, allowed.get("centre")))
    error = disc.field_error()
    quantity = f"{disc.name}: in-plane stress within 0.9 R, r.m.s. error over r.m.s. of the stress"
    rows.append(vanishing(quantity, error, allowed.get("field")))
    if disc.flat:
        widened, exact_widening = disc.widening()
        quantity = f"{disc.name}: growth of the diameter across the load, um"
        rows.append(Row.relative(quantity, MICRO * exact_widening, MICRO * widened, allowed.get("widening")))
    found, exact = disc.first_failure()
    quantity = f"{disc.name}: load at which rock first reaches strength, kN"
    rows.append(Row.relative(quantity, KILO * exact.resultant, KILO * found.resultant, allowed.get("first_failure")))
    off = float(np.hypot(*np.subtract(found.place, exact.place)) / disc.disc.radius)
    height, expected = (place.place[1] / disc.disc.radius for place in (found, exact))
    quantity = f"{disc.name}: height of that place on the loaded diameter, R (error: distance, R)"
    rows.append(Row(quantity, expected, height, off, allowed.get("place")))
    return rows


def crack_rows(disc: PressedDisc, crack: Crack[PressedDisc] | None, results: Results) -> list[Row]:
    """Load at which the crack starts and runs, its span, and the place and mechanism of its potency."""
    allowed, settings = results.allowed, results.settings
    through = f"{disc.name}: share of the loaded diameter that the crack spans in the last state of rest"
    if crack is None:
        row = Row.absolute(through, 1.0, NOTHING, allowed.get("through"), NO_REST)
        return [row, *potency_rows(disc.name, None, None, settings, allowed, NO_REST)]
    last = crack.moments[-1]
    first = disc.first_failure()[0].resultant
    part = (crack.load(1) - crack.load(0)) * KILO
    begins, ends = (crack.load(index) for index in (crack.first_part, crack.last_part))
    rows = [
        Row(
            f"{disc.name}: load of the first failure in the cascade, kN (error: in parts of the load's rise)",
            first * KILO,
            begins * KILO,
            max(0.0, first - begins, begins - first - part / KILO) * KILO / part,
            0.0,
            f"between the elastic prediction and the next part, {part:.3f} kN; the crack runs at "
            f"{'this load' if ends == begins else f'up to {ends * KILO:.3f} kN'}",
        ),
        Row.absolute(
            through, 1.0, last.span, allowed.get("through"),
            f"{len(crack.moments)} generations of failure, {last.failed_cells} cells; "
            + ("what fails next finds no rest" if crack.state.attrs.get("collapsed") else "at rest"),
        ),
    ]  # fmt: skip
    moment = crack.run_through(settings["span"])
    remark = "it never runs through: last state"
    if moment:
        remark = f"when {100 * settings['span']:g} % are spanned, after {moment.generation + 1} generations"
    moment = moment or last
    rows += potency_rows(disc.name, crack, moment, settings, allowed, remark)
    quantity = f"{disc.name}: double-couple share of the events, mean by potency"
    why = "fixed by the dilation angle, not by what made the rock fail"
    bound = allowed.get("double_couple")
    rows.append(Row.absolute(quantity, 1.0 / disc.dilation_factor, events_mean(crack, "dc"), bound, why))
    return rows


def potency_rows(
    name: str, crack: Crack | None, moment: Moment | None, settings: dict, allowed: dict, remark: str
) -> list[Row]:
    """Share of the potency near the loaded diameter at a moment, and the axis of opening until then.

    Without a crack that has such a moment there is only the first row, which fails.
    """
    near = f"{name}: share of potency within {MILLI * settings['near']:g} mm of the loaded diameter, run through"
    if crack is None or moment is None:
        return [Row.absolute(near, 1.0, NOTHING, allowed.get("near"), remark)]
    axis = f"{name}: T axis of all potency until then, degrees from the normal of the loaded diameter"
    return [
        Row.absolute(near, 1.0, crack.near_share(settings["near"], moment), allowed.get("near"), remark),
        vanishing(axis, crack.opening_axis_angle(moment), allowed.get("axis")),
    ]


def events_mean(crack: Crack, variable: str) -> float:
    """Mean of an event variable, weighted by potency."""
    events = crack.events()
    return float(np.average(events[variable].values, weights=events.potency.values))


def event_rows(crack: Crack, settings: dict) -> list[Row]:
    """Number, kind and sizes of the events, reported without theory."""
    name, events = crack.disc.name, crack.events()

    def told(quantity: str, value: float, remark: str = "", error: float = np.nan) -> Row:
        return reported(f"{name}: {quantity}", value, remark, error)

    resolved = events.resolved.values.astype(bool)
    rows = [told("events", float(len(resolved)), f"{resolved.sum()} of them resolved")]
    shares, potency = events.dc.values, events.potency.values
    kinds: dict[str, np.ndarray] = {
        "tensile": shares < settings["tensile"],
        "mixed": (shares >= settings["tensile"]) & (shares <= settings["shear"]),
        "shear": shares > settings["shear"],
    }
    for kind, chosen in kinds.items():
        by_potency = float(potency[chosen].sum() / potency.sum())
        remark = f"{by_potency:.3f} by potency"
        rows.append(told(f"share of {kind} events, by number", float(chosen.mean()), remark))
    sizes = log_potency(potency[resolved])
    floor = float(events.attrs["potency_floor"])
    b = estimate_b(sizes, float(np.log10(floor)))
    remark = f"{b.events} resolved events above log10 P = {np.log10(floor):.2f}; fewer than 10 give no b"
    rows.append(told("b of log10 potency (error: its standard error)", b.b, remark, b.error))
    span = float(sizes.max() - sizes.min()) if len(sizes) else np.nan
    rows.append(told("span of log10 potency of resolved events", span))
    largest = float(potency.max() / potency.sum())
    rows.append(told("share of the largest event in all potency", largest))
    return rows


def cost_rows(disc: PressedDisc, crack: Crack | None) -> list[Row]:
    """Particles, time and memory, where the stages left logs."""
    rows = [reported(f"{disc.name}: particles of rock", float(disc.present.sum()))]
    for stage in ("elastic", *([f"steps/{crack.step}"] if crack else [])):
        seconds, memory = disc.variant.seconds(stage), disc.variant.peak_memory(stage)
        if seconds is not None:
            remark = f"{memory:.0f} MiB"
            rows.append(reported(f"{disc.name}: wall time of {stage}, s", seconds, remark))
    return rows


def order_rows(discs: list[PressedDisc], allowed: dict) -> list[Row]:
    """Order of convergence of the elastic field, with the load of first failure as a remark."""
    if len(discs) < 2:
        return []
    sizes, errors = [disc.cell_size for disc in discs], [disc.field_error() for disc in discs]
    (order,) = convergence_orders((sizes[0], sizes[-1]), (errors[0], errors[-1]))
    loads = [found.resultant / exact.resultant - 1.0 for found, exact in (disc.first_failure() for disc in discs)]
    remark = (
        f"errors {', '.join(f'{100 * error:.2f}' for error in errors)} %; load of first failure "
        f"{', '.join(f'{100 * load:+.2f}' for load in loads)} %"
    )
    quantity = f"order of convergence of in-plane stress, h {MILLI * sizes[0]:g} to {MILLI * sizes[-1]:g} mm"
    return [Row.at_least(quantity, order, allowed["order"], remark)]


def together_rows(crack: Crack | None, settings: dict) -> list[Row]:
    """The crack where all rock above strength fails at once."""
    if crack is None:
        return []
    last = crack.moments[-1]
    remark = f"{last.failed_cells} cells in {len(crack.moments)} generations: a crushed zone, then no rest"
    near = crack.near_share(settings["near"], last)
    return [
        Row("all at once: share of the loaded diameter spanned in the last state of rest", 1.0, last.span, NOTHING,
            remark=remark),
        Row("all at once: share of potency near the loaded diameter", 1.0, near, NOTHING),
    ]  # fmt: skip


def spread_rows(cracks: list[Crack[PressedDisc]], settings: dict) -> list[Row]:
    """Means over perturbed runs of one scene. The error is the largest less the smallest value over the mean."""
    if len(cracks) < 2:
        return []
    cell = f"{MILLI * cracks[0].disc.cell_size:g} mm cells, {len(cracks)} perturbed runs"
    moments = [crack.run_through(settings["span"]) or crack.moments[-1] for crack in cracks]
    values = {
        "load at which the crack runs, kN": [KILO * crack.load(crack.last_part) for crack in cracks],
        "span of the crack": [crack.moments[-1].span for crack in cracks],
        "share of potency near the loaded diameter": [
            crack.near_share(settings["near"], moment) for crack, moment in zip(cracks, moments, strict=True)
        ],
        "potency when run through, mm3": [GIGA * moment.potency for moment in moments],
    }
    rows = []
    for quantity, found in values.items():
        remark = ", ".join(f"{crack.disc.name} {value:.3g}" for crack, value in zip(cracks, found, strict=True))
        spread = (max(found) - min(found)) / abs(np.mean(found))
        rows.append(reported(f"{cell}: {quantity}", float(np.mean(found)), remark, float(spread)))
    return rows
