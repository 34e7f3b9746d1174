"""A threshold for the innovation that tells errors from noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.errors import Problem
from hgorun.observers.capabilities import NoiseInformed
from hgorun.symbolic.forms import Form

HARDLY_MORE = 1.001  # the larger of two gains over the other, where the error of one of them is looked at
_LARGER = 1.5  # than the noise
Given = float | Mapping[str, float] | None


class NoiseThreshold(NoiseInformed):
    """A number for each output that the innovation exceeds by more than noise: by default 1.5 times its amplitude."""

    def threshold(self, form: Form, key: str, given: Given) -> np.ndarray:
        """What is given, or what follows from the noise, shape (q,).

        Raises
        ------
        Problem
            When an output is not named, or the amplitude of its noise is not known.
        """
        outputs = form.plant.outputs
        if isinstance(given, Mapping):
            if set(given) != set(outputs):
                raise Problem((key,), f"expected a number for each output: {', '.join(outputs)}")
            return np.array([given[output] for output in outputs])
        if given is not None:
            return np.full(len(outputs), given)
        return np.array([_LARGER * self._amplitude(i, output, key) for i, output in enumerate(outputs)])

    def _amplitude(self, i: int, output: str, key: str) -> float:
        amplitude = self._sensors[i].amplitude if self._sensors else None
        if amplitude is None:
            raise Problem(
                (), f"{key} is missing: it does not follow from the noise of {output}, whose amplitude is not known"
            )
        return amplitude

    def variances(self, count: int) -> np.ndarray:
        """Of a sample of each output, 0 where it is not known, shape (q,)."""
        known = [sensor.variance if sensor.variance and not sensor.multiplicative else 0.0 for sensor in self._sensors]
        return np.array(known if known else [0.0] * count)


def falling(theta_1: float, theta_2: float) -> dict[str, np.ndarray]:
    """The gains of large and of small innovations, as numbers of a design.

    Raises
    ------
    Problem
        Unless theta_1 > theta_2.
    """
    if not theta_1 > theta_2:
        raise Problem(("theta_1",), f"must be above theta_2 = {theta_2:g}, found {theta_1:g}")
    return {"theta_1": np.array(theta_1), "theta_2": np.array(theta_2)}
