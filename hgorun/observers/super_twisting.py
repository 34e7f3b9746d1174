"""The super-twisting observer of second-order plants."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Name, Positive
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver, Flow, observer
from hgorun.observers.capabilities import Punctual, SlidingMode, Switching
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("super_twisting")
class SuperTwistingObserver(SlidingMode, Switching, Punctual, ContinuousObserver):
    """Super-twisting observer, for uniformly observable plants with chains of two states.

    A sliding mode in the output in place of a linear correction. In the coordinates of a chain of two, with the
    innovation e = xhat_1 - y,

        xhat_1' = xhat_2 - 1.5 sqrt(f) |e|^(1/2) sign(e)
        xhat_2' = phi(t, xhat, u) - 1.1 f sign(e),              f >= sup |phi(x) - phi(xhat)| + sup |disturbance|

    and in the plant's own xhat' = f(xhat, u) - J^-1 (...). Without noise the estimate is right after a finite time, in
    spite of what the model does not know, as long as it is below f, in the units of x_2'. phi at xhat is part of it:
    the better the model, the smaller f may be. Without a model, phi = 0, it is ``levant`` with n = 2, and ``red`` in
    discrete time. Noise of the amplitude v leaves errors of the order sqrt(f v) in xhat_2.

    The right-hand side is discontinuous: take ``method: euler`` and a step h, with which it is a recursion of what is
    measured at the steps, and expect it to chatter by about f h. Samples come through the common innovation: with the
    period for a step that is one Euler step from each sample to the next. Late outputs are refused, since a relay with
    a delay d ends in a limit cycle, of the size f d in xhat_2. Choose it where the plant is disturbed by something
    bounded and the output is clean; ``extended`` estimates the disturbance with a linear correction instead.

    The gains are quoted from memory of the publication.
    """

    because = "a relay with a delay ends in a limit cycle"
    lacks = {
        "extend": "its chain has two states, and an unknown input would be a third; below f it is rejected as it is"
    }

    reference = "Davila, Fridman, Levant 2005"

    f: Positive | dict[Name, Positive] = Field(
        description="bound of what is unknown in x_2', in its units, > 0: a number, or {output: number}"
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"f": 1.0}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if any(length != 2 for length in form.chains):
            found = ", ".join(f"{length}" for length in form.chains)
            raise Problem(("type",), f"it is for chains of two states; found {found}. For more take red or homogeneous")
        outputs = form.plant.outputs
        f = self.f if isinstance(self.f, dict) else dict.fromkeys(outputs, self.f)
        if set(f) != set(outputs):
            raise Problem(("f",), f"expected a number for each output: {', '.join(outputs)}")
        bounds = np.array([f[output] for output in outputs])
        return {"first": 1.5 * np.sqrt(bounds), "second": 1.1 * bounds}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        first, second = k.first * ca.sqrt(ca.fabs(e)) * ca.sign(e), k.second * ca.sign(e)
        kappa = ca.vertcat(*[ca.vertcat(a, b) for a, b in zip(ca.vertsplit(first), ca.vertsplit(second), strict=True)])
        return Flow({"xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa)}, correction=plant.felt(s.xhat, kappa))
