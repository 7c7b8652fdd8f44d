"""Base cells tile the domain exactly, or are refused; sizes that do not divide in binary do."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from common.quantities import parse_quantity
from mpm_core.grid.domain import base_cells


@settings(max_examples=300, deadline=None)
@given(
    count=st.integers(1, 2000),
    cell=st.integers(1, 10**6),
    lower=st.integers(-(10**10), 10**10),
    unit=st.sampled_from(["m", "cm", "ft", "inch"]),
    off=st.sampled_from([0, 0, 1, -1, 10]),
)
def test_decimal_sizes_tile_or_are_refused(count, cell, lower, unit, off):
    """Sizes in thousandths of a unit, as text; `off` the side by 1e-9 or 1e-8 of it, where round-off is finer."""
    upper = Fraction(lower + count * cell) + Fraction(off * count * cell, 10**9)
    texts = [f"{float(value / 1000)!r} {unit}" for value in (Fraction(lower), upper, Fraction(cell))]
    low, high, size = (parse_quantity(text, "m") for text in texts)
    resolved = abs(off) * 1e-9 * count * size > 8 * np.finfo(float).eps * max(abs(low), abs(high))
    if off == 0:
        assert base_cells([low], [high], size).tolist() == [count]
    elif resolved:
        with pytest.raises(InputError, match=r"domain\.upper\[0\]: .* not a whole multiple of grid\.coarse_cell"):
            base_cells([low], [high], size)


def test_a_billionth_too_much_is_said_in_one_line():
    with pytest.raises(InputError) as caught:
        base_cells([0.0, 0.0], [7.0, 2.1000000021], 0.7)
    assert str(caught.value) == (
        "domain.upper[1]: the side of 2.1000000021 m is not a whole multiple of grid.coarse_cell, 0.7 m, of which 3 "
        "make 2.1 m; change one of the two"
    )
