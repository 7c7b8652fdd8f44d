"""The model between the trials: a Gaussian process for each output, over the unit cube."""

import copy
import warnings
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Kernel, WhiteKernel

LENGTH_BOUNDS = (0.1, 20.0)  # Length scales over ranges: a longer one than the last has no effect that trials show.
NOISE_BOUNDS = (1e-5, 2.0)  # Variance of the noise over that of the output.
RESTARTS = 4  # Maximisations of the marginal likelihood from other starting points.
NO_TRIAL = -1.0  # Trial of a point that is predicted.


class QuantityKernel(RBF):
    """A squared exponential of all columns but the last one, which numbers the trial."""

    def __call__(self, X, Y=None, eval_gradient=False):
        """Kernel matrix of RBF, without the last column."""
        return super().__call__(X[:, :-1], None if Y is None else Y[:, :-1], eval_gradient)


class TrialKernel(WhiteKernel):
    """Noise that rows of one trial, by the last column, have in common."""

    def __call__(self, X, Y=None, eval_gradient=False):
        """Kernel matrix of WhiteKernel, in which rows of one trial are the same."""
        other = X if Y is None else Y
        value = self.noise_level * (X[:, -1:] == other[:, -1]).astype(float)
        return (value, value[:, :, None]) if eval_gradient else value


@dataclass
class Surrogate:
    """Gaussian processes of outputs of trials; constant mean, squared exponential with a length for each quantity.

    points (row, quantity) in [0, 1]; outputs (row, output), finite; trials (row,): the trial that a row is of. Rows of
    one trial come from the same rock, and share its chance. Replicates of a point tell the noise best. miss (output,):
    root mean square of what the other trials miss of a trial, over the deviation that they state, at least 1.
    """

    points: NDArray
    outputs: NDArray
    trials: NDArray
    seed: int = 0
    _processes: list[GaussianProcessRegressor] = field(init=False, default_factory=list)
    miss: NDArray = field(init=False)
    _mean: NDArray = field(init=False)
    _scale: NDArray = field(init=False)

    def __post_init__(self):
        has_shared_rows = len(np.unique(self.trials)) < len(self.trials)
        kernel: Kernel = ConstantKernel(1.0, (1e-2, 1e2)) * QuantityKernel([1.0] * self.points.shape[1], LENGTH_BOUNDS)
        noise: Kernel = WhiteKernel(0.05, NOISE_BOUNDS)
        kernel += noise + TrialKernel(0.05, NOISE_BOUNDS) if has_shared_rows else noise
        rows = self._rows(self.points, self.trials)
        for output in self._scaled():
            process = GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, random_state=self.seed)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound: the quantity has no effect
                self._processes.append(process.fit(rows, output))
        self._find_miss()

    def _find_miss(self) -> None:
        mean, deviation = self.left_out()
        off = (self.outputs - mean) / np.maximum(deviation, 1e-300)
        self.miss = np.maximum(1.0, np.sqrt(np.mean(off**2, axis=0)))

    @staticmethod
    def _rows(points: NDArray, trials: NDArray | float) -> NDArray:
        """Points with the number of their trial as the last column."""
        return np.column_stack([points, np.broadcast_to(np.asarray(trials, float), len(points))])

    def _scaled(self) -> NDArray:
        """Outputs (output, row) of mean 0 and standard deviation 1."""
        self._mean, scale = self.outputs.mean(axis=0), self.outputs.std(axis=0)
        self._scale = np.where(scale > 0.0, scale, 1.0)
        return ((self.outputs - self._mean) / self._scale).T

    def predict(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Mean and standard deviation (point, output) of the model's expected outputs, without the noise of a run."""
        rows = self._rows(points, NO_TRIAL)
        predictions = [process.predict(rows, return_std=True) for process in self._processes]
        mean = np.stack([part[0] for part in predictions], axis=1)
        variance = np.stack([part[1] for part in predictions], axis=1) ** 2 - self._noise
        return mean * self._scale + self._mean, np.sqrt(np.maximum(variance, 0.0)) * self._scale

    def covariance(self, points: NDArray, output: int) -> NDArray:
        """Covariance (point, point) of an expected output between points, given the trials; without noise of runs."""
        process = self._processes[output]
        covariance_with_noise = process.predict(self._rows(points, NO_TRIAL), return_cov=True)[1]
        signal = process.kernel_.k1(self._rows(points, NO_TRIAL))
        noise = process.kernel_(self._rows(points, NO_TRIAL)) - signal
        return (covariance_with_noise - noise) * self._scale[output] ** 2

    @property
    def _noise(self) -> NDArray:
        """Variance of the noise of each output in units of its own variance, (output,)."""
        levels = [process.kernel_.k2.get_params() for process in self._processes]
        return np.array([sum(v for name, v in level.items() if name.endswith("noise_level")) for level in levels])

    @property
    def noise(self) -> NDArray:
        """Standard deviation of a run about the model's expected outputs, (output,): chance, not ignorance."""
        return np.sqrt(self._noise) * self._scale

    @property
    def lengths(self) -> NDArray:
        """Length scales (output, quantity), in ranges of the quantity."""
        return np.array([np.broadcast_to(p.kernel_.k1.k2.length_scale, self.points.shape[1]) for p in self._processes])

    def of(self, points: NDArray, outputs: NDArray, trials: NDArray) -> "Surrogate":
        """A surrogate of other rows with the hyperparameters of these, each relative to the scale of its output."""
        other = copy.copy(self)
        other.points, other.outputs, other.trials = points, outputs, trials
        rows = self._rows(points, trials)
        other._processes = [
            GaussianProcessRegressor(process.kernel_, optimizer=None).fit(rows, output)
            for process, output in zip(self._processes, other._scaled(), strict=True)
        ]
        other._find_miss()
        return other

    def left_out(self) -> tuple[NDArray, NDArray]:
        """Leave-one-out predictions of the trials: mean and standard deviation (row, output), noise included.

        Rasmussen and Williams (2006), Eqs 5.10 to 5.12, for blocks of rows; hyperparameters stay those of all trials.
        """
        rows, scaled = self._rows(self.points, self.trials), ((self.outputs - self._mean) / self._scale).T
        mean, deviation = np.empty_like(self.outputs), np.empty_like(self.outputs)
        for number, (process, output) in enumerate(zip(self._processes, scaled, strict=True)):
            inverse = np.linalg.inv(process.kernel_(rows))
            weights = inverse @ output
            for trial in np.unique(self.trials):
                own = np.flatnonzero(self.trials == trial)
                block = np.linalg.inv(inverse[np.ix_(own, own)])
                mean[own, number] = output[own] - block @ weights[own]
                deviation[own, number] = np.sqrt(np.diag(block))
        return mean * self._scale + self._mean, deviation * self._scale
