"""The page of a calibration, and the table of its trials."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calibration.figures import draw_pairs, draw_predictions, draw_surrogate
from calibration.fit import SHARES, Fit, expected
from calibration.likelihood import MAX_IMPLAUSIBILITY
from calibration.self_test import SelfTest
from calibration.settings import CalibratedQuantity
from catalogs.figures import style
from common.datasets import atomic_path
from common.pages import page_templates

TEMPLATES = Path(__file__).parent / "templates"
RIDGE_CORRELATION = 0.7  # Two quantities of the posterior that are correlated as much are said to trade off.
UNKNOWN_WIDTH = 0.9  # A quantity with more of its prior's width left is said to be unknown to the record.
BEST_TRIALS = 5


@dataclass(frozen=True)
class Trials:
    """The trials of a fit: points (trial, quantity) in the unit cube, the replicates in its middle first.

    pairs: how many were run on finer cells, too. silent_history: whether history mines openings and no rock fails in
    it.
    """

    points: NDArray
    replicates: int
    pairs: int
    silent_history: bool

    @property
    def design(self) -> NDArray:
        """Points of the design."""
        return self.points[self.replicates :]


def format_number(number: float) -> str:
    """Three significant digits, without an exponent."""
    return f"{float(f'{number:.3g}'):,.10g}"


def formatted(quantity: CalibratedQuantity, share: float) -> str:
    """A value of a quantity as the page shows it, without unit."""
    return format_number(quantity.value(share))


def correlation(fit: Fit) -> NDArray:
    """Correlation of the quantities (quantity, quantity) in the posterior."""
    covariance = np.atleast_2d(np.cov(fit.posterior.points.T, aweights=fit.posterior.weights))
    deviation = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return covariance / np.outer(deviation, deviation)


def verdict(fit: Fit, quantities: list[CalibratedQuantity]) -> list[str]:
    """What the calibration found, in sentences."""
    found = []
    least = fit.posterior.implausibility
    if not fit.fits:
        found.append(
            f"No values within the ranges fit the record: in the nearest, the potency of some step is {least:.1f} "
            f"standard deviations off ({MAX_IMPLAUSIBILITY:g} are plausible). Widen the ranges, or look for what the "
            "model lacks. The intervals below mean little."
        )
    left = fit.posterior.width_left()
    known = [quantity for quantity, width in zip(quantities, left, strict=True) if width <= UNKNOWN_WIDTH]
    unknown = [quantity for quantity, width in zip(quantities, left, strict=True) if width > UNKNOWN_WIDTH]
    if known:
        shares = [
            f"{quantity.key} to {100 * width:.0f} %"
            for quantity, width in zip(quantities, left, strict=True)
            if quantity in known
        ]
        found.append(f"The record narrows the range of {', of '.join(shares)} of its width.")
    if unknown:
        found.append(f"The record says hardly anything of {' and of '.join(quantity.key for quantity in unknown)}.")
    related = correlation(fit)
    for first in range(len(quantities)):
        for other in range(first):
            if abs(related[first, other]) > RIDGE_CORRELATION:
                way = "both larger or both smaller" if related[first, other] > 0 else "one larger and the other smaller"
                found.append(
                    f"The record cannot tell {quantities[other].key} from {quantities[first].key}: {way} fits as well "
                    f"(correlation {related[first, other]:.2f})."
                )
    return found


def write_page(
    page: Path,
    mine: str,
    fit: Fit,
    trials: Trials,
    tested: SelfTest,
    quantities: list[CalibratedQuantity],
    steps: list[str],
    draws: int,
) -> None:
    """Write the page, which needs nothing else, atomically."""
    with style.applied():
        prior = expected(fit.surrogate, fit.correction, trials.design)[0]
        figures = {
            "pairs": draw_pairs(fit, quantities, trials.design),
            "predictions": draw_predictions(fit, steps, prior),
            "surrogate": draw_surrogate(fit, steps),
        }
        pictures = {name: style.save(figure, page.parent / f"{name}.svg") for name, figure in figures.items()}
    text = (
        page_templates(TEMPLATES)
        .get_template("calibration.html.j2")
        .render(
            mine=mine,
            fits=fit.fits,
            verdict=verdict(fit, quantities),
            quantities=quantity_rows(fit, quantities),
            steps=step_rows(fit, steps),
            trials_sentence=trials_sentence(fit, trials),
            tested=tested_sentence(tested, quantities),
            best=best_rows(fit, trials, quantities),
            model_error=fit.model_error,
            draws=draws,
            **pictures,
        )
    )
    with atomic_path(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def quantity_rows(fit: Fit, quantities: list[CalibratedQuantity]) -> list[dict]:
    """Median, interval and width left of each quantity."""
    low, middle, high = fit.posterior.quantiles(SHARES)
    rows = []
    for number, (quantity, left) in enumerate(zip(quantities, fit.posterior.width_left(), strict=True)):
        unit = f" {quantity.unit}" if quantity.unit else ""
        rows.append(
            {
                "key": quantity.key,
                "range": f"{formatted(quantity, 0.0)} to {formatted(quantity, 1.0)}{unit}",
                "median": f"{formatted(quantity, middle[number])}{unit}",
                "interval": f"{formatted(quantity, low[number])} to {formatted(quantity, high[number])}{unit}",
                "width": f"{left:.2f}",
                "source": quantity.source,
            }
        )
    return rows


def step_rows(fit: Fit, steps: list[str]) -> list[dict]:
    """Recorded and predicted potency and number of each step."""
    low, middle, high = fit.intervals()
    deviation = np.sqrt(np.diag(fit.recorded.covariance))
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
    """How many trials there were, and how well they predict each other."""
    mean, deviation = fit.surrogate.left_out()
    inside = np.mean(np.abs(fit.surrogate.outputs - mean) < 1.645 * deviation)
    off = np.sqrt(np.mean((fit.surrogate.outputs - mean)[:, : fit.steps] ** 2))
    text = f"{len(trials.design)} trials fill the ranges evenly"
    text += f", and {trials.replicates} more in their middle differ by chance only. " if trials.replicates else ". "
    if trials.pairs:
        shift = np.exp(fit.correction.log_potency)
        text += (
            f"{trials.pairs} were run on the mine's own cells, too, which multiply the potency of the steps by "
            f"{', '.join(f'{value:.2f}' for value in shift)}. "
        )
    if trials.pairs and trials.silent_history:
        text += (
            "On cells of twice the size no rock fails in history, as they do not resolve its openings. The factors "
            "carry this, and their scatter is part of the uncertainty. "
            "Trials with calibration.cells: own need no factors. "
        )
    return text + (
        f"All others predict the potency of a trial to {100 * off:.0f} % (r.m.s.), and their 90 % intervals hold "
        f"{100 * inside:.0f} % of what the trials made."
    )


def tested_sentence(tested: SelfTest, quantities: list[CalibratedQuantity]) -> str:
    """How often the intervals held values that are known."""
    widths = ", ".join(
        f"{quantity.key} {width:.2f}" for quantity, width in zip(quantities, tested.width.mean(axis=0), strict=True)
    )
    return (
        f"Each of the {len(tested.held)} designed trials was taken as the record and calibrated to without it; its "
        f"values got errors like the record's. The 90 % intervals hold {100 * tested.coverage:.0f} % of the values "
        f"that made the trials. Their mean width, over that of the prior: {widths}."
    )


def best_rows(fit: Fit, trials: Trials, quantities: list[CalibratedQuantity]) -> list[dict]:
    """The trials with the largest likelihood, by the surrogate."""
    values = fit.log_likelihood(trials.points)
    order = np.argsort(-values)[:BEST_TRIALS]
    return [
        {
            "number": int(trial) + 1,
            "vals": [
                formatted(quantity, share) for quantity, share in zip(quantities, trials.points[trial], strict=True)
            ],
            "below": f"{fit.best_log_likelihood - values[trial]:.1f}",
        }
        for trial in order
    ]


def write_table(table: Path, fit: Fit, trials: Trials, quantities: list[CalibratedQuantity], steps: list[str]) -> None:
    """Write what every trial was and made, atomically."""
    columns: dict[str, NDArray] = {"trial": np.arange(1, len(trials.points) + 1)}
    for number, quantity in enumerate(quantities):
        name = f"{quantity.key}, {quantity.unit}" if quantity.unit else quantity.key
        columns[name] = np.array([quantity.value(share) for share in trials.points[:, number]])
    made = np.exp(fit.surrogate.outputs)
    for index, step in enumerate(steps):
        columns[f"potency {step}, m3"] = made[:, index]
        columns[f"events {step}"] = made[:, fit.steps + index]
    columns["log-likelihood"] = fit.log_likelihood(trials.points)
    with atomic_path(table) as temporary:
        pd.DataFrame(columns).to_csv(temporary, index=False, float_format="%.6g")
