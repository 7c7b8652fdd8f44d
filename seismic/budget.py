"""The budget of a step's plastic strain, closed in each tensor component."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from common.voigt import NAMES

MAX_CLOSURE_ERROR = 1e-12  # Relative to the sum of magnitudes; round-off of sums over 10^7 particles stays below.
BUDGET_PARTS = ("events", "aseismic_share", "overshoot", "later")


def potency_budget(
    strain: dict[str, NDArray],
    volume: NDArray,
    seismic_fraction: float,
    event_potency: NDArray,
    scalars: dict[str, float],
    where: str,
) -> dict:
    """Budget of a step: events + (1 - alpha) share + overshoot + later = plastic, in each of six components, m3.

    strain: seismic, overshoot, later and plastic (all three together) of this step, each (particle, 6); volume
    (particle,) m3; event_potency (event, 6) m3; scalars: particle_scalars, event_scalars and resolved_scalars, m3 (the
    scalar of a sum is not the sum of scalars). Gives a dict ready for JSON, each part a list in voigt order, `closure`
    the error relative to the sum of magnitudes. Raises InputError naming `where` if a component does not close.
    """
    total = {name: np.sum(values * volume[:, None], axis=0) for name, values in strain.items()}
    magnitude = sum(np.sum(np.abs(values) * volume[:, None], axis=0) for values in strain.values())
    parts = {
        "events": np.sum(event_potency, axis=0),
        "aseismic_share": (1.0 - seismic_fraction) * total["seismic"],
        "overshoot": total["overshoot"],
        "later": total["later"],
    }
    error = sum(parts.values()) - total["plastic"]
    closure = np.divide(np.abs(error), magnitude, out=np.zeros(6), where=magnitude > 0.0)
    if not np.all(closure <= MAX_CLOSURE_ERROR):
        worst = int(np.argmax(np.where(np.isnan(closure), np.inf, closure)))
        raise InputError(
            f"{where}: potency budget of component {NAMES[worst]} misses the plastic strain by {closure[worst]:.1e} "
            "of it: seismic, overshoot and later strain must add up to plastic_strain_step; compute the step again"
        )
    budget = {"components": list(NAMES), "unit": "m3"}
    budget |= {name: values.tolist() for name, values in parts.items()}
    budget |= {"plastic": total["plastic"].tolist(), "closure": closure.tolist()}
    return budget | scalars | {"scalar_ratio": scalar_ratio(scalars)}


def scalar_ratio(scalars: dict[str, float]) -> float | None:
    """Sum of event scalars over sum of particle scalars, at most 1; None without particles."""
    return scalars["event_scalars"] / scalars["particle_scalars"] if scalars["particle_scalars"] > 0.0 else None


def add_budgets(budgets: list[dict]) -> dict:
    """The budget of several steps together; closure is the worst of them."""
    total: dict[str, Any] = {"components": list(NAMES), "unit": "m3"}
    for name in (*BUDGET_PARTS, "plastic"):
        total[name] = np.sum([budget[name] for budget in budgets] or [np.zeros(6)], axis=0).tolist()
    total["closure"] = np.max([budget["closure"] for budget in budgets] or [np.zeros(6)], axis=0).tolist()
    for name in ("particle_scalars", "event_scalars", "resolved_scalars"):
        total[name] = float(sum(budget[name] for budget in budgets))
    return total | {"scalar_ratio": scalar_ratio(total)}


def log_budget(budget: dict) -> None:
    """Write the budget to the log as a table."""
    logging.info("potency budget, m3     %s", "".join(f"{name:>12}" for name in budget["components"]))
    for name in (*BUDGET_PARTS, "plastic", "closure"):
        logging.info("  %-20s %s", name, "".join(f"{value:12.3e}" for value in budget[name]))
    ratio = "none" if budget["scalar_ratio"] is None else f"{budget['scalar_ratio']:.3f}"
    logging.info(
        "  sum of scalars: particles %.6e, events %.6e (of these resolved %.6e), events over particles %s",
        budget["particle_scalars"],
        budget["event_scalars"],
        budget["resolved_scalars"],
        ratio,
    )
