"""Values in order, each once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun.symbolic.levels import distinct


@pytest.mark.costly
@given(st.lists(st.sampled_from([-np.inf, -1.5, 0.0, 1e-300, 2.0, np.inf]) | st.floats(-10, 10), max_size=20))
def test_distinct_values_are_those_of_numpy(values: list[float]) -> None:
    np.testing.assert_array_equal(distinct(np.array(values)), np.unique(values))
