"""The hybrid multi-observer: several gains side by side, and the one that has cost least."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.errors import Problem
from hgorun.observers.base import Arrival, CorrectedObserver, Flow, PeriodLimit, Role, observer
from hgorun.observers.capabilities import ByLateness, BySampling
from hgorun.observers.modes import ObserverBank, chosen_of, estimates
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("bank")
class ContinuousBank(BySampling, ByLateness, ObserverBank):
    """Hybrid multi-observer: observers of one kind with different gains side by side, of which the best is shown.

    Mode 0 is the nominal observer, the one with the theorem; the others, k = 1, 2, ..., have any other gains, also
    zero or unstable ones. With r_k = y - h(xhat_k), the cost of every mode is an integral of its squared innovation
    and correction that forgets the past,

        eta_k' = -nu eta_k + lam1 |r_k|^2 + lam2 |L_k r_k|^2,    eta_k(0) = 1

    L_k r_k = xhat_k' - f(xhat_k). The estimate is xhat_sigma, sigma(0) = 0, the state ``mode``. When the smallest cost
    of another mode is eps eta_sigma or less, sigma becomes that mode, the first of equal ones. Decided at the ends of
    the solver's steps and after samples, at most one switch each. So eta_sigma stays below (min eta_k)/eps after each
    decision, and below 1/eps of the nominal's; for eps < 1 the ratio of two costs has to change by eps^2 before the way
    back. With eps = 1 equal costs do not switch, but almost equal ones may at every step. ``reset: true``: at a switch
    all modes but the nominal and the new one begin at the new one's estimate and cost, of samples with its innovation.
    The nominal mode is never reset.

    Modes are those of any observer of chains with the keys ``theta`` (``thetas``) or ``gains`` that has a flow only,
    for its plants. The theorem asks for nu below the nominal's rate of decay. lam2 > 0 in the units of the state counts
    against large gains, whose estimates are noisy while their innovation is small. Take it where one gain is right in
    the transient and another against noise; ``switched`` decides by a threshold instead, with one copy of the plant.

    With sampled outputs every mode has an innovation of its own, e_k' = -(its own correction) from sample to sample,
    and a late sample takes the bank back to its time (``late: replay``). Where continuous outputs are late, by a time d
    that is constant, every mode compares its own past: with alpha_k' = -(what mode k corrects),

        e_k = C xhat_k(t - d) - y(t - d) + alpha_k(t) - alpha_k(t - d)
    """

    def of_samples(self) -> SampledBank:
        return SampledBank.model_construct(self.model_fields_set, **dict(self))

    def of_late(self) -> LateBank:
        return LateBank.model_construct(self.model_fields_set, **dict(self))

    def require_times(self, form: CanonicalForm) -> None:
        self.require_continuous(form)

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        y = plant.output(self.estimate(s, k)) - e
        rates, felt = self.flow(plant, s, [plant.output(x) - y for x in estimates(s)], k)
        return Flow(rates, correction=chosen_of(s.mode, felt))


class SampledBank(ObserverBank, CorrectedObserver):
    """The bank of sampled outputs; see :class:`ContinuousBank`."""

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        return {**super().states(form), "innovations": np.zeros((len(self.modes), len(form.plant.outputs)))}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        rates, felt = self.flow(plant, s, [row.T for row in ca.vertsplit(s.innovations)], k)
        return Flow({**rates, "innovations": -ca.horzcat(*felt).T})

    def correct(self, plant: PlantCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        rows = [
            ca.if_else(arrival.fresh, plant.output(x) - arrival.y, held.T).T
            for x, held in zip(estimates(s), ca.vertsplit(s.innovations), strict=True)
        ]
        return {"innovations": ca.vertcat(*rows)}

    def begun_again(self, s: Symbols, best: ca.SX) -> dict[str, ca.SX]:
        """The innovation that is held, too: that of an estimate which is thrown away says nothing of the new one."""
        first, *others = ca.vertsplit(s.innovations)
        chosen = chosen_of(best, [first, *others])
        rows = [ca.if_else(best != s.mode, chosen, own) for own in others]
        return {**super().begun_again(s, best), "innovations": ca.vertcat(first, *rows)}


class LateBank(ObserverBank, RecallingObserver):
    """The bank of continuous outputs that are late; see :class:`ContinuousBank`."""

    def require_times(self, form: CanonicalForm) -> None:
        self.require_continuous(form)
        if self.reset:
            message = "a mode that begins anew has no past yet that could be compared with late outputs: leave it out"
            raise Problem(("reset",), message)
        for name, sensor in zip(form.plant.outputs, self._sensors, strict=False):
            if sensor.delay is None:
                message = (
                    f"the delay of {name} changes, and each mode would have to look back by other times: sample it"
                )
                raise Problem(("type",), message)

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        numbers = super().design(form)
        delays = [self._sensors[i].delay or 0.0 for i in self._late]
        return {**numbers, LAGS: np.tile(np.array(delays), len(self.modes))}

    @property
    def _late(self) -> list[int]:
        """Which outputs are late."""
        return [i for i, sensor in enumerate(self._sensors) if sensor.delay != 0]

    def longest_delay(self, form: CanonicalForm) -> PeriodLimit:
        return PeriodLimit(None, "each mode has its own, that of its observer alone")

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        return {**super().states(form), "corrections": np.zeros((len(self.modes), len(form.plant.outputs)))}

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {**super().roles(form), "corrections": "filter"}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        y, late, past = self.compared(plant, s, k) - e, self._late, ca.vertsplit(s.past)
        errors = []
        for i, x in enumerate(estimates(s)):
            found = plant.output(x) - y
            for place, j in enumerate(late):
                found[j] = past[i * len(late) + place] + s.corrections[i, j] - y[j]
            errors.append(found)
        rates, felt = self.flow(plant, s, errors, k)
        return Flow({**rates, "corrections": -ca.horzcat(*felt).T}, correction=felt[0])

    def signals(self, plant: PlantCopy, s: Symbols, k: Symbols) -> ca.SX:
        """C xhat_k - alpha_k of every mode, for the outputs that are late."""
        parts = [plant.output(x) - s.corrections[i, :].T for i, x in enumerate(estimates(s))]
        return ca.vertcat(*[one[j] for one in parts for j in self._late])

    def compared(self, plant: PlantCopy, s: Symbols, k: Symbols) -> ca.SX:
        """C xhat_0."""
        return plant.output(s.xhat)
