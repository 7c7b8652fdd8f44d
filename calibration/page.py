"""The page of a calibration, and the table of its trials."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calibration.figures import draw_instruments, draw_pairs, draw_predictions, draw_surrogate
from calibration.fit import INTERVAL_SHARE, Fit, Rows, SelfTest
from calibration.instrument_findings import BOTH, CATALOGUE, InstrumentFindings, sentences
from calibration.likelihood import MAX_IMPLAUSIBILITY
from calibration.limits import BeyondRange, SizeLaw
from calibration.settings import INSTRUMENTS, CalibratedQuantity
from calibration.tradeoffs import best_known_strengths, correlation, telling_observations
from calibration.trials import NUMBER, PLACES, POTENCY, SIZES
from catalogs.figures import style
from catalogs.report.text import plural
from common.datasets import atomic_path
from common.pages import page_templates

TEMPLATES = Path(__file__).parent / "templates"
RIDGE_CORRELATION = 0.7  # Two quantities of the posterior that are correlated as much are said to trade off.
UNKNOWN_WIDTH = 0.9  # A quantity with more of its prior's width left is said to be unknown to the record.
BEST_TRIALS = 5


@dataclass(frozen=True)
class Trials:
    """The trials of a fit, in order: names, and the kind of each: `replicate`, `design`, `further` or `collapsed`.

    pairs: number of those that were run on finer cells, too. collapsed: why rock found no equilibrium, by number of the
    trial; such trials are left out. nothing_fails_before_record: history mines openings, and no rock fails in it.
    """

    names: list[str]
    kinds: list[str]
    pairs: int
    collapsed: dict[int, str]
    nothing_fails_before_record: bool

    def count(self, kind: str) -> int:
        """Number of trials of a kind."""
        return self.kinds.count(kind)

    def of_kind(self, kind: str) -> NDArray:
        """Numbers, from 0, of the trials of a kind."""
        return np.array([number for number, one in enumerate(self.kinds) if one == kind], int)


@dataclass(frozen=True)
class Tests:
    """Tests of a calibration: on known trials, of the ends of the ranges, of the law of sizes and of the instruments.

    law: None where no record counts; instruments: None where none counts; cut: log10 m3, from which events count.
    """

    known: SelfTest
    beyond: BeyondRange
    law: SizeLaw | None
    cut: float
    instruments: InstrumentFindings | None = None


def evidence(fit: Fit) -> str:
    """What the quantities are calibrated to, as a singular noun with its article."""
    if INSTRUMENTS not in fit.likelihood.terms:
        return "the record"
    return "the evidence of record and readings" if fit.steps else "the evidence of the readings"


def capital(text: str) -> str:
    """Text with a capital first letter."""
    return text[:1].upper() + text[1:]


def format_number(number: float) -> str:
    """Three significant digits, without an exponent."""
    return f"{float(f'{number:.3g}'):,.10g}"


def formatted(quantity: CalibratedQuantity, share: float) -> str:
    """A value of a quantity as the page shows it, without unit."""
    return format_number(quantity.value(share))


def warnings(fit: Fit, quantities: Sequence[CalibratedQuantity], tests: Tests, trials: Trials) -> list[str]:
    """Signs that the truth lies where no trial can reach, in sentences."""
    lines = []
    if trials.collapsed:
        first, reason = next(iter(trials.collapsed.items()))
        lines.append(
            f"Rock found no equilibrium in {len(trials.collapsed)} of {plural(len(trials.names), 'trial')} "
            f"({', '.join(trials.names[number] for number in trials.collapsed)}; {trials.names[first]} in {reason}). "
            "They are left out: of such rock the posterior knows only what the other trials suggest. See "
            "docs/how-to/loose-rock.md, or narrow the ranges to rock that stands."
        )
    least = fit.posterior.implausibility
    if not fit.fits:
        lines.append(
            f"No values within the ranges fit {evidence(fit)}: at the nearest, one of its numbers or all of them "
            f"together are {least:.1f} standard deviations off ({MAX_IMPLAUSIBILITY:g} are plausible). Widen the "
            "ranges, or look for what the model lacks. The intervals below mean little."
        )
    beyond, law = tests.beyond, tests.law
    if beyond.is_told:
        ends = " and ".join(
            f"the {'upper' if side > 0 else 'lower'} end of the range of {quantities[number].title}, "
            f"{formatted(quantities[number], float(side > 0))} {quantities[number].unit}".rstrip()
            for number, side in beyond.ends.items()
        )
        lines.append(
            f"{capital(evidence(fit))} points beyond {ends}: values outside would fit better by "
            f"{beyond.improvement:.1f} standard deviations (p {_p_value(beyond.p_value)} if the true values lie within "
            "the ranges). Widen the range. If that cannot be, the model lacks something, and the intervals below mean "
            "little."
        )
    if law is not None and law.is_told:
        low, high = law.modelled
        ends = f"{low:.2f} to {high:.2f}" if np.isfinite(high) else f"{low:.2f} or more"
        recorded = f"{law.recorded:.2f}" if np.isfinite(law.recorded) else "too large to say"
        lines.append(
            f"The recorded sizes have another law than those of the model: above the cut b of log potency is "
            f"{recorded} in the record, and {ends} (90 %) for such a "
            f"record of the calibrated model (p {_p_value(law.p_value)} if both are one). The few largest events rule "
            "the potency: trust neither the potency nor the forecasts of the calibrated model."
        )
    return [*lines, *(sentences(tests.instruments) if tests.instruments else [])]


def _p_value(p_value: float) -> str:
    return f"= {p_value:.2g}" if p_value >= 0.005 else "< 0.005"


def verdict(fit: Fit, quantities: Sequence[CalibratedQuantity]) -> list[str]:
    """The results of the calibration, in sentences."""
    lines, source = [], capital(evidence(fit))
    left = fit.posterior.width_left()
    named = list(zip(quantities, left, strict=True))
    known = [f"{one.title} to {100 * width:.0f} %" for one, width in named if width <= UNKNOWN_WIDTH]
    unknown = [one.title for one, width in named if width > UNKNOWN_WIDTH]
    if known:
        lines.append(f"{source} narrows the range of {', of '.join(known)} of its width.")
    if unknown:
        lines.append(f"{source} says hardly anything of {' and of '.join(unknown)}.")
    related = correlation(fit)
    for first in range(len(quantities)):
        for other in range(first):
            if abs(related[first, other]) > RIDGE_CORRELATION:
                way = "both larger or both smaller" if related[first, other] > 0 else "one larger and the other smaller"
                lines.append(
                    f"{source} cannot tell {quantities[other].title} from {quantities[first].title}: {way} fits as "
                    f"well (correlation {related[first, other]:.2f})."
                )
    for strength in best_known_strengths(fit, quantities):
        lines.append(
            f"Best known is the {strength.state} strength of {strength.material} under a confinement of "
            f"{strength.confinement:.1f} MPa: {format_number(strength.low)} to {format_number(strength.high)} MPa "
            f"(90 %), {100 * strength.width:.0f} % of what the ranges allow. A calibration may take this strength in "
            "place of the cohesion (confinement)."
        )
    for one in telling_observations(fit, quantities):
        lines.append(
            f"A measurement of {one.measured.title} to a tenth of its range would narrow {one.narrowed.title} from "
            f"{100 * one.before:.0f} to {100 * one.after:.0f} % of its width."
        )
    return lines


def write_page(
    page: Path,
    mine: str,
    fit: Fit,
    rows: Rows,
    trials: Trials,
    tests: Tests,
    quantities: Sequence[CalibratedQuantity],
    steps: Sequence[str],
    draws: int,
) -> None:
    """Write the page, which needs nothing else, atomically."""
    with style.applied():
        evenly = np.isin(rows.trials, trials.of_kind("design"))
        prior = fit.expected(rows.points[evenly])[0]
        figures = {
            "pairs": draw_pairs(fit, quantities, rows.points[~np.isin(rows.trials, trials.of_kind("replicate"))])
        }
        if steps:
            figures |= {"predictions": draw_predictions(fit, steps, prior), "surrogate": draw_surrogate(fit, steps)}
        if tests.instruments is not None:
            figures["instruments"] = draw_instruments(fit)
        pictures = {name: style.save(figure, page.parent / f"{name}.svg") for name, figure in figures.items()}
    text = (
        page_templates(TEMPLATES)
        .get_template("calibration.html.j2")
        .render(
            mine=mine,
            warnings=warnings(fit, quantities, tests, trials),
            verdict=verdict(fit, quantities),
            evidence=evidence(fit),
            with_record=bool(steps),
            added=added_rows(tests.instruments, quantities),
            instruments_sentence=instruments_sentence(tests.instruments),
            instrument_lines=tests.instruments.instruments if tests.instruments else (),
            cut=f"{tests.cut:.2f}",
            quantities=quantity_rows(fit, quantities),
            steps=step_rows(fit, steps),
            trials_sentence=trials_sentence(fit, trials),
            tested=tested_sentence(tests.known, quantities, fit),
            best=best_rows(fit, rows, trials, quantities),
            model_error=fit.likelihood.model_error,
            draws=draws,
            **pictures,
        )
    )
    with atomic_path(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def quantity_rows(fit: Fit, quantities: Sequence[CalibratedQuantity]) -> list[dict]:
    """Median, interval and width left of each quantity."""
    low, middle, high = fit.posterior.intervals(INTERVAL_SHARE)
    rows = []
    for number, (quantity, left) in enumerate(zip(quantities, fit.posterior.width_left(), strict=True)):
        unit = f" {quantity.unit}" if quantity.unit else ""
        rows.append(
            {
                "key": quantity.title,
                "range": f"{formatted(quantity, 0.0)} to {formatted(quantity, 1.0)}{unit}",
                "median": f"{formatted(quantity, middle[number])}{unit}",
                "interval": f"{formatted(quantity, low[number])} to {formatted(quantity, high[number])}{unit}",
                "width": f"{left:.2f}",
                "source": quantity.source,
            }
        )
    return rows


def added_rows(found: InstrumentFindings | None, quantities: Sequence[CalibratedQuantity]) -> list[dict]:
    """Interval and width left of each quantity by the catalogue alone, by the instruments alone, and by both."""
    if found is None or len(found.intervals) < 2:
        return []
    rows = []
    for number, quantity in enumerate(quantities):
        by_data = [
            f"{_between_values(quantity, ends[0, number], ends[-1, number])} ({found.widths[name][number]:.2f})"
            for name, ends in found.intervals.items()
        ]
        rows.append(
            {"key": f"{quantity.title} ({quantity.unit})" if quantity.unit else quantity.title, "vals": by_data}
        )
    return rows


def _between_values(quantity: CalibratedQuantity, low: float, high: float) -> str:
    return f"{formatted(quantity, low)} to {formatted(quantity, high)}"


def instruments_sentence(found: InstrumentFindings | None) -> str:
    """State what instruments add to the catalogue, and which of them have no reading that counts."""
    if found is None:
        return ""
    text = ""
    if BOTH in found.widths:
        ratio = found.widths[BOTH] / found.widths[CATALOGUE]
        text = (
            f"With the instruments the intervals have {100 * np.median(ratio):.0f} % of their width without (median). "
        )
    if found.unused:
        text += f"No reading of {', '.join(found.unused)} counts: one that was zeroed needs readings in two steps. "
    return text


def step_rows(fit: Fit, steps: Sequence[str]) -> list[dict]:
    """RecordedOutputs and predicted potency and number of each step."""
    low, middle, high = fit.intervals()
    deviation = np.sqrt(np.diag(fit.recorded.potency_covariance))
    recorded = [np.exp(fit.recorded.log_potency + shift * deviation) for shift in (0.0, -1.645, 1.645)]
    rows = []
    for index, step in enumerate(steps):
        number = fit.steps + index
        rows.append(
            {
                "step": step,
                "potency": format_number(recorded[0][index]),
                "potency_interval": _between(recorded[1][index], recorded[2][index]),
                "potency_predicted": ", ".join([format_number(middle[index]), _between(low[index], high[index])]),
                "number": int(fit.recorded.number[index]),
                "number_predicted": f"{middle[number]:.0f}, {low[number]:.0f} to {high[number]:.0f}",
            }
        )
    return rows


def _between(low: float, high: float) -> str:
    return f"{format_number(low)} to {format_number(high)}"


def trials_sentence(fit: Fit, trials: Trials) -> str:
    """State the number of trials, and the error with which they predict each other."""
    mean, deviation = fit.surrogate.left_out()
    missed = fit.surrogate.outputs - mean
    inside = np.mean(np.abs(missed) < 1.645 * deviation)
    potency = fit.likelihood.columns[POTENCY]
    text = f"{trials.count('design')} trials fill the ranges evenly"
    if trials.count("replicate"):
        text += f", and {trials.count('replicate')} more in their middle differ by chance only"
    text += ". "
    if trials.count("further"):
        text += f"{trials.count('further')} further trials lie where those before left most uncertain. "
    if trials.pairs and fit.steps:
        correction = fit.likelihood.correction
        shift = np.exp(correction.shift[potency]) / (1.0 if correction.share is None else correction.share)
        text += (
            f"{trials.pairs} were run on the mine's own cells, too, which multiply the potency of the steps by "
            f"{', '.join(f'{value:.2f}' for value in shift)}. "
        )
    elif trials.pairs:
        text += f"{trials.pairs} were run on the mine's own cells, too, whose mean difference corrects the others. "
    if trials.pairs and fit.steps and trials.nothing_fails_before_record:
        text += (
            "On cells of twice the size no rock fails in history, as they do not resolve its openings. The factors "
            "carry this, and their scatter is part of the uncertainty. "
            "Trials with calibration.cells: own need no factors. "
        )
    held = f"{100 * inside:.0f} % of what the trials made."
    if not fit.steps:
        return f"{text}What all others predict for a trial has 90 % intervals that hold {held}"
    off = np.sqrt(np.mean(missed[:, potency] ** 2))
    return (
        f"{text}All others predict the potency of a trial to {100 * off:.0f} % (r.m.s.), and their 90 % intervals hold "
        f"{held}"
    )


def tested_sentence(tested: SelfTest, quantities: Sequence[CalibratedQuantity], fit: Fit) -> str:
    """State how often the intervals held values that are known."""
    made = "a record was made with its values, of what all other trials predict there"
    errors = "Its events come in clusters like the record's, with sizes drawn at random."
    if INSTRUMENTS in fit.likelihood.terms:
        both = "a record and readings were" if fit.steps else "readings were"
        made = f"{both} made with its values, of what all other trials predict there"
        errors = f"{errors} " if fit.steps else ""
        errors += "Readings have all errors that instruments which work are thought to have."
    widths = ", ".join(
        f"{quantity.title} {width:.2f}" for quantity, width in zip(quantities, tested.width.mean(axis=0), strict=True)
    )
    # the intervals of one trial hold its values, or do not, for the same chance
    by_trial = tested.held.mean(axis=1).std(ddof=1) / np.sqrt(len(tested.held)) if len(tested.held) > 1 else 0.0
    error = 100.0 * max(by_trial, np.sqrt(0.9 * 0.1 / tested.held.size))
    return (
        f"For each of the {len(tested.held)} designed trials {made}, and calibrated to without the trial. {errors} "
        f"The 90 % intervals hold {100 * tested.coverage:.0f} % of the true values "
        f"(standard error {error:.0f} %). Their mean width, over that of the prior: {widths}."
    )


def best_rows(fit: Fit, rows: Rows, trials: Trials, quantities: Sequence[CalibratedQuantity]) -> list[dict]:
    """The rows with the largest likelihood, by the surrogate."""
    values = fit.log_likelihood(rows.points)
    order, best = np.argsort(-values)[:BEST_TRIALS], max(fit.best_log_likelihood, values.max())
    return [
        {
            "number": trials.names[rows.trials[row]],
            "vals": [formatted(quantity, share) for quantity, share in zip(quantities, rows.points[row], strict=True)],
            "below": f"{best - values[row]:.1f}",
        }
        for row in order
    ]


def write_table(
    table: Path,
    fit: Fit,
    rows: Rows,
    trials: Trials,
    quantities: Sequence[CalibratedQuantity],
    steps: Sequence[str],
) -> None:
    """Write quantities and outputs of every row of the trials, atomically."""
    columns: dict[str, NDArray | list] = {
        "trial": [trials.names[trial] for trial in rows.trials],
        "kind": [trials.kinds[trial] for trial in rows.trials],
    }
    for number, quantity in enumerate(quantities):
        name = f"{quantity.title}, {quantity.unit}" if quantity.unit else quantity.title
        columns[name] = np.array([quantity.value(share) for share in rows.points[:, number]])
    by_term = rows.outputs.by_term
    for index, step in enumerate(steps):
        columns[f"potency {step}, m3"] = np.exp(by_term[POTENCY][:, index])
        columns[f"events {step}"] = np.exp(by_term[NUMBER][:, index])
        if PLACES in by_term:
            columns[f"gain {step}, nats"] = by_term[PLACES][:, index]
    if SIZES in by_term and steps:
        columns["mean log potency above the cut"] = np.exp(by_term[SIZES][:, 0])
    columns["log-likelihood"] = fit.log_likelihood(rows.points)
    with atomic_path(table) as temporary:
        pd.DataFrame(columns).to_csv(temporary, index=False, float_format="%.6g")
