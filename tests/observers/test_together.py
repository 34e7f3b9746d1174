"""Which sample has none of another output beside it."""

import numpy as np
import pytest

from hgorun.observers.together import not_beside


@pytest.mark.parametrize(
    ("S", "X", "said"),
    [
        ([0, 1, 2, 3], [0, 1, 3], "X has no sample beside that of S at t = 12, the nearest is 1 earlier"),
        ([0, 2.5, 3], [0, 1, 2.5, 3], "S has no sample beside that of X at t = 11, the nearest is 1 earlier"),
        ([0, 1], [0.25, 1], "X has no sample beside that of S at t = 10, the nearest is 0.25 later"),
        ([0, 1, 2], [0, 1], "X has no sample beside that of S at t = 12, the nearest is 1 earlier"),
        ([0, 1], [0, 1, 2], "S has no sample beside that of X at t = 12, the nearest is 1 earlier"),
        ([0, 1, 1], [0, 1], "X has no sample beside that of S at t = 11"),
        ([], [2], "S has no sample beside that of X at t = 12"),
    ],
)
def test_the_first_sample_that_is_alone(S: list[float], X: list[float], said: str) -> None:
    assert not_beside(("S", np.array(S)), ("X", np.array(X)), 10.0) == said
