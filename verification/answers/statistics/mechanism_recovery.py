"""Axes, Kagan angles and source shares of tensors whose true values are known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catalogs.sources import mechanisms
from common.source_tensors import moment_from_potency, principal_axes, source_shares
from verification.comparisons import monte_carlo_error, vanishing
from verification.rows import Row


def fault_vectors(strike: NDArray, dip: NDArray, rake: NDArray) -> tuple[NDArray, NDArray]:
    """Normal and slip (..., 3), x east, y north, z up, of planes in degrees (Aki and Richards 2002, Eqs 4.88 and 4.89).

    The normal points from the footwall to the hanging wall, the slip is that of the hanging wall.
    """
    strike, dip, rake = np.radians(strike), np.radians(dip), np.radians(rake)
    north = np.cos(rake) * np.cos(strike) + np.cos(dip) * np.sin(rake) * np.sin(strike)
    east = np.cos(rake) * np.sin(strike) - np.cos(dip) * np.sin(rake) * np.cos(strike)
    slip = np.stack([east, north, np.sin(dip) * np.sin(rake)], axis=-1)
    normal = np.stack([np.sin(dip) * np.cos(strike), -np.sin(dip) * np.sin(strike), np.cos(dip)], axis=-1)
    return normal, slip


def double_couple(normal: NDArray, slip: NDArray) -> NDArray:
    """Potency tensors (..., 3, 3) of unit slip on a unit area: half of n s + s n."""
    product = normal[..., :, None] * slip[..., None, :]
    return 0.5 * (product + np.swapaxes(product, -1, -2))


def share_closer(degrees: float) -> float:
    """Chance that two random double couples are less than `degrees` (up to 90) apart: 4 (w - sin w) / pi (Kagan 1991).

    Turns of a random rotation have density (1 - cos w) / pi up to half a turn. Of the four turns that lead from one
    double couple to the other one at most is below 90 degrees, and each is as likely.
    """
    angle = np.radians(degrees)
    return float(4.0 * (angle - np.sin(angle)) / np.pi)


@dataclass(frozen=True)
class RandomPairs:
    """Kagan angles (pair,), degrees: turned by a known angle (known, found), and of random double couples."""

    known: NDArray
    found: NDArray
    random: NDArray


def random_pairs(settings: dict, seed: int) -> RandomPairs:
    """Double couples turned about random axes by up to 90 degrees, and uniformly random ones."""
    generator = np.random.default_rng([seed, 1])
    count = settings["pairs"]
    start = mechanisms.random_frames(count, generator)
    axis = generator.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    known = np.linspace(0.0, 90.0, count)
    turn = Rotation.from_rotvec(np.radians(known)[:, None] * axis).as_matrix()
    end = start @ np.swapaxes(turn, 1, 2)
    flip = generator.choice([-1.0, 1.0], size=(count, 3, 1))  # An axis has no direction of its own.
    uniform = mechanisms.random_frames(settings["random_pairs"], generator)
    return RandomPairs(known, mechanisms.kagan_angle(start, end * flip), mechanisms.kagan_angle(uniform, np.eye(3)))


def mechanism_rows(settings: dict, pairs: RandomPairs, seed: int, allowed: dict) -> list[Row]:
    """Rows of axes, angles, shares and cones."""
    rows = [_known_row(known, allowed["angle"]) for known in settings["known"]]
    rows.append(_axes_row(settings["pairs"], seed, allowed["angle"]))
    worst = float(np.max(np.abs(pairs.found - pairs.known)))
    quantity = "Kagan angle of a double couple turned by 0 to 90 degrees about any axis: worst error, degrees"
    rows.append(vanishing(quantity, worst, allowed["angle"], f"{len(pairs.known)} turns"))
    ring = float(mechanisms.kagan_angle(np.eye(3), np.eye(3)[[1, 2, 0]]))
    quantity = "Kagan angle, degrees, if P, B and T change places in a ring: the largest there is"
    rows.append(Row.absolute(quantity, 120.0, ring, allowed["angle"]))
    for degrees in settings["shares_below"]:
        expected, found = share_closer(degrees), float(np.mean(pairs.random < degrees))
        quantity = f"random double couples: share with a Kagan angle below {degrees} degrees"
        rows.append(Row.absolute(quantity, expected, found, allowed["random_angles"], "4 (w - sin w) / pi"))
    rows.append(_share_row(allowed["share"]))
    rows.append(_cone_row(settings["cone"], seed, allowed["cone"]))
    return rows


def _known_row(known: dict, allowed: float) -> Row:
    """Axes of a textbook mechanism against their trends and plunges."""
    axes = principal_axes(double_couple(*fault_vectors(*known["plane"])))
    expected = mechanisms.axis_from_trend_plunge(*np.array(known["axes"], dtype=float).T)
    worst = float(np.max(mechanisms.angle_between_axes(axes, expected)))
    trends = ", ".join(f"{name} {trend}/{plunge}" for name, (trend, plunge) in zip("PBT", known["axes"], strict=True))
    return vanishing(f"{known['name']}: worst error of the P, B and T axes, degrees", worst, allowed, trends)


def _axes_row(count: int, seed: int, allowed: float) -> Row:
    """Random planes and slips: P = (n - s) / sqrt 2, B = n x s, T = (n + s) / sqrt 2."""
    generator = np.random.default_rng([seed, 2])
    strike, dip, rake = generator.uniform([[0.0], [0.0], [-180.0]], [[360.0], [90.0], [180.0]], size=(3, count))
    normal, slip = fault_vectors(strike, dip, rake)
    expected = np.stack([(normal - slip) / np.sqrt(2), np.cross(normal, slip), (normal + slip) / np.sqrt(2)], axis=1)
    found = principal_axes(double_couple(normal, slip))
    worst = float(np.max(mechanisms.angle_between_axes(found, expected)))
    what = f"P, B and T axes of {count} random strikes, dips and rakes: worst error, degrees"
    return vanishing(what, worst, allowed)


def _share_row(allowed: float) -> Row:
    """Isotropic, CLVD and double-couple shares of an explosion, a double couple, a CLVD and an opening crack."""
    crack = np.diag([0.0, 0.0, 1.0])
    tensors = np.array(
        [np.eye(3), np.diag([1.0, 0, -1]), np.diag([2.0, -1, -1]), crack, moment_from_potency(crack, 1.0, 1.0)]
    )
    # Shares of a crack's potency are 1/3 and 2/3. Its moment with lambda = mu is diag(1, 1, 3) mu: 5/9 and 4/9.
    exact = np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0], [1 / 3, 2 / 3, 0], [5 / 9, 4 / 9, 0]])
    worst = float(np.max(np.abs(source_shares(tensors) - exact)))
    what = "shares of an explosion, a double couple, a CLVD and a crack (potency, moment): worst error"
    return vanishing(what, worst, allowed, "Vavrycuk 2015")


def _cone_row(chosen: dict, seed: int, allowed: float) -> Row:
    """Coverage of the 95 % cone around the mean P axis."""
    generator = np.random.default_rng([seed, 3])
    truth = mechanisms.random_frames(1, generator)[0]
    events, held = chosen["events"], 0
    blocks = np.arange(events) * chosen["blocks"] // events
    other = mechanisms.AxesSample(truth[None].repeat(2, axis=0), np.zeros((2, 3)), np.arange(2))
    for index in range(chosen["catalogues"]):
        turn = Rotation.from_rotvec(np.radians(chosen["spread"]) * generator.normal(size=(events, 3))).as_matrix()
        sample = mechanisms.AxesSample(truth @ np.swapaxes(turn, 1, 2), np.zeros((events, 3)), blocks)
        found = mechanisms.compare_axes(sample, other, seed=index, resamplings=chosen["resamplings"])
        held += bool(mechanisms.angle_between_axes(found["mean_axis"][0, 0], truth[0]) <= found["mean_cone"][0, 0])
    share = held / chosen["catalogues"]
    chance = monte_carlo_error(0.95, chosen["catalogues"])
    quantity = (
        f"mean P axis of {events} events turned by {chosen['spread']} degrees each way: coverage of its 95 % cone"
    )
    remark = f"{chosen['blocks']} blocks, {chosen['catalogues']} catalogues, Monte Carlo standard error {chance:.3f}"
    return Row.absolute(quantity, 0.95, share, allowed, remark)
