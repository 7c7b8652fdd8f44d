"""b-values of simulated catalogues against the b they were drawn with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalogs.sources import sizes
from verification.answers.statistics.samples import simulated_sizes
from verification.comparisons import monte_carlo_error
from verification.rows import Row


@dataclass(frozen=True)
class Estimates:
    """b of many catalogues of one case: value, stated error and interval (catalogue,)."""

    case: dict
    value: NDArray
    error: NDArray
    lower: NDArray
    upper: NDArray

    @property
    def name(self) -> str:
        """Text on what was drawn and how b was estimated: b, number of events, span, bins and bound."""
        case = self.case
        parts = [f"b {case['b']:g}", f"n {case['count']}"]
        if "span" in case:
            parts.append(f"cut off at {case['span']:g}")
        if "bin_width" in case:
            parts.append(f"bins of {case['bin_width']:g}")
        if "bound" in case:
            parts.append("bound: the largest" if case["bound"] == "largest" else "bound known")
        return ", ".join(parts)

    @property
    def coverage(self) -> float:
        """Share of catalogues whose interval holds the truth."""
        return float(np.mean((self.lower <= self.case["b"]) & (self.case["b"] <= self.upper)))

    @property
    def bias(self) -> float:
        """Mean less truth."""
        return float(self.value.mean() - self.case["b"])


def estimate_cases(settings: dict, seed: int, which: str = "cases") -> list[Estimates]:
    """b of `catalogues` simulated catalogues of each case."""
    return [
        _estimate(case, settings["catalogues"], settings["confidence"], np.random.default_rng([seed, number]))
        for number, case in enumerate(settings[which])
    ]


def _estimate(case: dict, catalogues: int, confidence: float, generator: np.random.Generator) -> Estimates:
    width = case.get("bin_width", 0.0)
    taken = 0.0 if case.get("taken_as") == "continuous" else width
    found = []
    for _ in range(catalogues):
        x = simulated_sizes(generator, case["count"], case["b"], case.get("span", np.inf), width)
        found.append(sizes.estimate_b(x, 0.0, taken, case.get("bound"), confidence))
    columns = [np.array([getattr(one, name) for one in found]) for name in ("b", "error", "lower", "upper")]
    return Estimates(case, *columns)


def size_rows(estimates: list[Estimates], uncorrected: list[Estimates], confidence: float, allowed: dict) -> list[Row]:
    """Rows of bias, coverage and stated error by case, and of what ignoring a bound or bins would do."""
    rows = []
    for one in estimates:
        truth, scatter = one.case["b"], float(one.value.std())
        count = len(one.value)
        chance = monte_carlo_error(confidence, count)
        rows += [
            Row(
                f"{one.name}: mean of b (error: bias over standard error)",
                truth, float(one.value.mean()), abs(one.bias) / scatter, allowed["bias"],
                f"bias {100 * one.bias / truth:+.2f} %, {count} catalogues, Monte Carlo error {count**-0.5:.3f}",
            ),
            Row.absolute(
                f"{one.name}: coverage of the {100 * confidence:g} % interval",
                confidence, one.coverage, allowed["coverage"],
                f"Monte Carlo standard error {chance:.4f}",
            ),
            Row.relative(
                f"{one.name}: mean stated error of b", scatter, float(one.error.mean()), allowed["scatter"],
                f"expected: the scatter found, itself known to {100 * (2 * count) ** -0.5:.1f} %",
            ),
        ]  # fmt: skip
    for one in uncorrected:
        taken = "taken as continuous" if "taken_as" in one.case else "bound ignored"
        rows.append(
            Row.relative(
                f"{one.name}, {taken}: mean of b",
                one.case["b"], float(one.value.mean()), None,
                f"what the correction is for: the interval holds the truth in {100 * one.coverage:.0f} %",
            )
        )  # fmt: skip
    return rows


def difference_row(settings: dict, seed: int, allowed: float) -> Row:
    """Row of how often two catalogues of one b are said to differ."""
    chosen, confidence, count = settings["difference"], settings["confidence"], settings["catalogues"]
    generator = np.random.default_rng([seed, 99])
    alarms = 0
    for _ in range(count):
        first, second = (
            sizes.estimate_b(simulated_sizes(generator, events, chosen["b"]), 0.0) for events in chosen["counts"]
        )
        alarms += bool(sizes.difference_b(first, second).p_value < 1.0 - confidence)
    share = alarms / count
    events = " and ".join(str(events) for events in chosen["counts"])
    quantity = f"b {chosen['b']:g}, n {events}: share of pairs of one law said to differ (p < {1 - confidence:.2f})"
    return Row.absolute(quantity, 1.0 - confidence, share, allowed)
