"""What the trials say of the model between them: a Gaussian process for each output, over the unit cube."""

import copy
import warnings
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

LENGTH_BOUNDS = (0.1, 20.0)  # Length scales over ranges: a longer one than the last has no effect that trials show.
NOISE_BOUNDS = (1e-5, 2.0)  # Variance of the noise over that of the output.
RESTARTS = 4  # Maximisations of the marginal likelihood from other starting points.


@dataclass
class Surrogate:
    """Gaussian processes of outputs of trials; constant mean, squared exponential with a length for each quantity.

    points (trial, quantity) in [0, 1]; outputs (trial, output), finite; replicates of a point tell the noise best.
    """

    points: NDArray
    outputs: NDArray
    seed: int = 0
    _processes: list[GaussianProcessRegressor] = field(init=False, default_factory=list)
    _mean: NDArray = field(init=False)
    _scale: NDArray = field(init=False)

    def __post_init__(self):
        self._mean, scale = self.outputs.mean(axis=0), self.outputs.std(axis=0)
        self._scale = np.where(scale > 0.0, scale, 1.0)
        quantities = self.points.shape[1]
        for output in ((self.outputs - self._mean) / self._scale).T:
            kernel = ConstantKernel(1.0, (1e-2, 1e2)) * RBF([1.0] * quantities, LENGTH_BOUNDS)
            kernel += WhiteKernel(0.05, NOISE_BOUNDS)
            process = GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, random_state=self.seed)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound: the quantity has no effect
                self._processes.append(process.fit(self.points, output))

    def predict(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Mean and standard deviation (point, output) of the model's expected outputs, without the noise of a run."""
        found = [process.predict(points, return_std=True) for process in self._processes]
        mean = np.stack([part[0] for part in found], axis=1)
        variance = np.stack([part[1] for part in found], axis=1) ** 2 - self._noise
        return mean * self._scale + self._mean, np.sqrt(np.maximum(variance, 0.0)) * self._scale

    @property
    def _noise(self) -> NDArray:
        """Variance of the noise of each output in units of its own variance, (output,)."""
        return np.array([process.kernel_.k2.noise_level for process in self._processes])

    @property
    def noise(self) -> NDArray:
        """Standard deviation of a run about the model's expected outputs, (output,): chance, not ignorance."""
        return np.sqrt(self._noise) * self._scale

    @property
    def lengths(self) -> NDArray:
        """Length scales (output, quantity), in ranges of the quantity."""
        return np.array([np.broadcast_to(p.kernel_.k1.k2.length_scale, self.points.shape[1]) for p in self._processes])

    def without(self, trial: int) -> "Surrogate":
        """The surrogate of all other trials, with the hyperparameters of all."""
        kept = np.arange(len(self.points)) != trial
        other = copy.copy(self)
        other.points, other.outputs = self.points[kept], self.outputs[kept]
        scaled = (other.outputs - self._mean) / self._scale
        other._processes = [
            GaussianProcessRegressor(process.kernel_, optimizer=None).fit(other.points, output)
            for process, output in zip(self._processes, scaled.T, strict=True)
        ]
        return other

    def left_out(self) -> tuple[NDArray, NDArray]:
        """Each trial as the others predict it: mean and standard deviation (trial, output), noise included.

        Rasmussen and Williams (2006), Eqs 5.10 to 5.12; hyperparameters stay those of all trials.
        """
        means, deviations = [], []
        for process, output in zip(self._processes, ((self.outputs - self._mean) / self._scale).T, strict=True):
            inverse = np.linalg.inv(process.kernel_(self.points))
            means.append(output - inverse @ output / np.diag(inverse))
            deviations.append(np.sqrt(1.0 / np.diag(inverse)))
        return np.stack(means, 1) * self._scale + self._mean, np.stack(deviations, 1) * self._scale
