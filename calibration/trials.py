"""Trials as a table: the values of the quantities, and what each trial makes of every dated step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from calibration.likelihood import Recorded
from catalogs.completeness import completeness
from catalogs.exposure import Exposure
from catalogs.sizes import log_potency
from catalogs.sum_measures import potency_clustering
from common.errors import InputError

BOOTSTRAPS = 2000  # Resamplings of the record's potency.


@dataclass(frozen=True)
class Outcome:
    """What catalogues make of each dated step: ln potency (run, step) of m3 and ln number (run, step) from the cut on.

    A step without potency counts as the smallest resolvable event, one without events as half an event.
    """

    log_potency: NDArray
    log_number: NDArray


def common_cut(catalogues: Sequence[xr.Dataset], record: xr.Dataset) -> float:
    """log10 potency (m3) from which every trial and the record are complete."""
    sizes = log_potency(record["potency"].values[record["resolved"].values == 1])
    floors = [float(one.attrs["potency_floor"]) for one in catalogues]
    floors = [float(log_potency(floor)) for floor in floors if np.isfinite(floor)]
    return float(np.nanmax([completeness(sizes), *floors]))


def outcome(catalogues: Sequence[xr.Dataset], steps: Sequence[str], cut: float) -> Outcome:
    """What the catalogues make of the steps."""
    potency = np.zeros((len(catalogues), len(steps)))
    number = np.zeros_like(potency)
    for run, events in enumerate(catalogues):
        size, step = events["potency"].values, events["step"].values
        counted = (events["resolved"].values == 1) & (log_potency(size) >= cut)
        for index, name in enumerate(steps):
            potency[run, index] = size[step == name].sum()
            number[run, index] = np.count_nonzero(counted & (step == name))
    return Outcome(np.log(np.maximum(potency, 10.0**cut)), np.log(np.maximum(number, 0.5)))


def read_record(record: xr.Dataset, exposure: Exposure, cut: float, seed: int) -> Recorded:
    """What the record says of each dated step, its potency with a covariance by bootstrap of its events.

    Events of a day are drawn together in effect: the variance is raised by how clustered their numbers are. Raises
    InputError where a step has no recorded potency.
    """
    step, potency = exposure.step(record["time"].values), record["potency"].values
    used = (step >= 0) & (record["resolved"].values == 1)
    clustering = exposure.clustering(record["time"].values[used])
    counted = used & (log_potency(potency) >= cut)
    generator, steps = np.random.default_rng(seed), len(exposure.start)
    logs, variances = np.zeros(steps), np.zeros(steps)
    for index in range(steps):
        sizes = potency[(step == index) & np.isfinite(potency)]
        if not sizes.sum() > 0.0:
            raise InputError(
                f"record: no potency in dated step number {index + 1}; calibrate to steps with recorded events, or "
                "leave potency out of calibration.terms"
            )
        logs[index] = np.log(sizes.sum())
        drawn = generator.poisson(1.0, (BOOTSTRAPS, len(sizes))) @ sizes  # numbers vary as well as sizes
        drawn = drawn[drawn > 0.0]
        variances[index] = np.log(drawn).var() * potency_clustering(sizes, clustering)
    number = np.array([np.count_nonzero(counted & (step == index)) for index in range(steps)])
    return Recorded(logs, np.diag(variances), number, clustering)


def has_silent_history(catalogues: Sequence[xr.Dataset]) -> bool:
    """Whether no rock fails before the record in any of the trials, as where cells do not resolve its openings."""
    return all(float(one.attrs["potency_before_record"]) == 0.0 for one in catalogues)
