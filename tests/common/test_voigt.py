"""The order of six components: written out once, and there and back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from common.voigt import COMPONENTS, NAMES, tensor_from_voigt, voigt_from_tensor

VOIGTS = array_shapes(min_dims=0, max_dims=2, min_side=0).flatmap(
    lambda shape: arrays(np.float64, (*shape, 6), elements=st.floats(-1e9, 1e9))
)


def test_the_order_is_xx_yy_zz_yz_xz_xy():
    assert NAMES == ("xx", "yy", "zz", "yz", "xz", "xy")
    np.testing.assert_array_equal(tensor_from_voigt([1, 2, 3, 4, 5, 6]), [[1, 6, 5], [6, 2, 4], [5, 4, 3]])
    assert ["xyz"[row] + "xyz"[column] for row, column in COMPONENTS.values()] == list(COMPONENTS)


@given(VOIGTS)
def test_there_and_back(voigt):
    """Of any leading shape; the tensors are symmetric, and each component is where its name says."""
    tensor = tensor_from_voigt(voigt)
    assert tensor.shape == (*voigt.shape[:-1], 3, 3)
    np.testing.assert_array_equal(tensor, np.swapaxes(tensor, -1, -2))
    np.testing.assert_array_equal(voigt_from_tensor(tensor), voigt)
    for index, (row, column) in enumerate(COMPONENTS.values()):
        np.testing.assert_array_equal(tensor[..., row, column], voigt[..., index])
