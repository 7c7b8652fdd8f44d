"""What no mine file reaches, driven within this process: the share of the stable time step, single precision."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import numpy as np

from mpm_core.equilibrium import body


@contextmanager
def courant(factor: float, damping: float) -> Iterator[None]:
    """Time steps of `factor` times the limit without damping; the body takes 0.98 / sqrt(1 + damping) by itself."""
    with patch.object(body, "TIME_STEP_SHARE", factor * np.sqrt(1.0 + damping)):
        yield


@contextmanager
def single_precision() -> Iterator[None]:
    """Stress, displacement and hourglass forces rounded to float32 after every update of stress, by either scheme."""
    update = body.Body.update

    def rounded(self: body.Body, *arguments) -> None:
        update(self, *arguments)
        for array in (self.state.stress, self.state.displacement, self.state.hourglass_force):
            array[...] = array.astype(np.float32)

    with patch.object(body.Body, "update", rounded):
        yield
