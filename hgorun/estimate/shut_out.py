"""Gates that leave out so many samples that these are no outliers: the estimate does not follow what is measured."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.result.result import Result

_OUTLIERS = 0.2  # of the samples: more are none


def too_many(left_out: int, count: int) -> bool:
    """Whether a gate has left out more of ``count`` samples than can be outliers."""
    return left_out > _OUTLIERS * count


def shut_out(result: Result) -> Iterator[tuple[str, str, int, int]]:
    """Of such gates the observer, the output, how many samples were left out, and of how many."""
    if result.recorded is None:
        return
    for j, (label, observer) in enumerate(result.observers.items()):
        gated = {} if observer.assessed is None else observer.assessed.scores.get("gated", {})
        for output, score in gated.items():
            left_out = round(score)
            count = left_out + int(np.count_nonzero(result.recorded.outputs[output].used[:, j]))
            if too_many(left_out, count):
                yield label, output, left_out, count
