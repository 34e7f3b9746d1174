"""The modes of a hybrid multi-observer: observers of one kind with different gains, and what each costs."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field, ValidationError, model_validator

from hgorun.config.nearest import meant
from hgorun.config.types import Block, NonNegative, Number, Positive
from hgorun.errors import Problem
from hgorun.observers.base import (
    OBSERVERS,
    ContinuousObserver,
    CorrectedObserver,
    DecidedObserver,
    Role,
)
from hgorun.observers.capabilities import HighGain, NoiseInformed, NotLinear, OneGain, SeveralGains
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.keys import Keys
from hgorun.observers.recalling import RecallingObserver
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_NOT_INSIDE = frozenset(Keys.model_fields) - {"type"}
_MOST = 20  # modes


class ObserverBank(NoiseInformed, NotLinear, SeveralGains, DecidedObserver):
    """The keys of a bank, and what its modes have in common."""

    lacks = {"extend": "it is a key of the modes: give it in the block of their observer"}

    reference = (
        "Petri, Postoyan, Astolfi, Nesic, Andrieu, arXiv 2209.10130 and 2303.06936, whose abstracts were read; "
        "equations quoted from memory"
    )

    observer: dict[str, object] = Field(
        description="the block of the modes' observer, but for what the bank says itself (initial, saturation, ...)"
    )
    thetas: tuple[Positive, ...] | None = Field(
        default=None, min_length=1, max_length=_MOST, description="theta of every mode, the nominal one first"
    )
    gains: tuple[tuple[Number, ...], ...] | None = Field(
        default=None, min_length=1, max_length=_MOST, description="or the gains of every mode: any numbers, also zero"
    )
    nu: Positive | None = Field(
        default=None, description="rate at which costs are forgotten, nu > 0; half the nominal theta by default"
    )
    lam1: Positive = Field(default=1.0, description="weight of the squared innovation in the cost, > 0")
    lam2: NonNegative = Field(default=0.0, description="weight of the squared correction in the cost, >= 0")
    eps: Positive = Field(
        default=0.9, le=1, description="a mode is left for one that costs at most eps of it, in (0, 1]"
    )
    reset: bool = Field(default=False, description="true: at a switch all but the nominal mode begin at the new one")

    @model_validator(mode="after")
    def _modes_fit(self) -> ObserverBank:
        _ = self.modes
        return self

    @property
    def modes(self) -> list[ContinuousObserver]:
        """The observer of every mode; ValueError where there is none."""
        if (self.thetas is None and self.gains is None) or (self.thetas is not None and self.gains is not None):
            raise ValueError("the modes are given by one of thetas and gains")
        family = _family(self.observer)
        if self.thetas is not None:
            _require_key(family, HighGain, "theta")
            return [_mode(family, {**self.observer, "theta": theta}) for theta in self.thetas]
        _require_key(family, PlacedGain, "gains")
        assert self.gains is not None
        base = {name: value for name, value in self.observer.items() if name != "poles"}
        return [_mode(family, {**base, "gains": list(gains)}) for gains in self.gains]

    @property
    def inner(self) -> ContinuousObserver:
        """Of which kind the modes are, whose equations all of them have."""
        family = _family(self.observer)
        some = {"theta": 1.0} if issubclass(family, HighGain) else {}
        return _mode(family, {**some, **self.observer})

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"observer": {"type": "shgo", "theta": 2.0}, "thetas": [2.0, 4.0]}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if self.coordinates == "canonical":
            raise Problem(("coordinates",), "the modes are in the plant's coordinates: leave this key out")
        self.require_times(form)
        for name in self.internal:
            if name not in ("mode", "eta"):
                raise Problem(("internal", name), "all modes begin at the initial estimate: mode and eta can be given")
        start = np.asarray(self.internal.get("eta", 1.0), dtype=object)
        if any(isinstance(one, int | float) and one <= 0 for one in start.ravel()):
            raise Problem(("internal", "eta"), "costs start above 0")
        count, mode = len(self.modes), self.internal.get("mode", 0)
        if mode not in range(count):
            raise Problem(("internal", "mode"), f"expected the number of a mode, 0 to {count - 1}; found {mode}")
        numbers = {
            "nu": np.array(self._forgetting),
            "lam1": np.array(self.lam1),
            "lam2": np.array(self.lam2),
            "eps": np.array(self.eps),
        }
        for i, one in enumerate(self.modes):
            try:
                own = one.design(form)
            except Problem as problem:
                raise Problem(("observer", *problem.path), f"mode {i}: {problem.message}") from problem
            numbers |= {f"{name}_{i}": value for name, value in own.items()}
        return numbers

    @property
    def _forgetting(self) -> float:
        """nu."""
        if self.nu is not None:
            return self.nu
        nominal = self.modes[0]
        if not isinstance(nominal, HighGain):
            raise Problem((), "nu is missing: there is no theta that it could follow from")
        return nominal.theta / 2

    def require_times(self, form: CanonicalForm) -> None:
        """Refuse outputs that are not as this class takes them."""

    def require_continuous(self, form: CanonicalForm) -> None:
        """Refuse outputs of which some are sampled."""
        for name, sensor in zip(form.plant.outputs, self._sensors, strict=False):
            if sensor.sampled:
                other = "it is continuous in other phases" if sensor.continuous else "others are continuous"
                message = f"{name} is sampled, and {other}: expected outputs of one kind"
                raise Problem(("type",), message)

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        count = len(self.modes)
        found: dict[str, np.ndarray | Symmetric] = {"mode": np.array(0.0), "eta": np.ones(count)}
        if count > 1:
            start = np.array([self.initial.get(name, 0.0) for name in form.plant.states])
            found["others"] = np.tile(start, (count - 1, 1))
        own = self.inner.states(form)
        return found | {f"{name}_{i}": value for i in range(count) for name, value in own.items()}

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {name: "gain" if name in ("mode", "eta") else "signal" for name in self.states(form)}

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return chosen_of(s.mode, estimates(s))

    @property
    def not_linear(self) -> str | None:
        return (
            "its gain changes by decisions, from that of one mode to that of another; each mode is an observer of its "
            "own, to be looked at apart"
        )

    def fastest_rate(self, form: CanonicalForm) -> float:
        return max(one.fastest_rate(form) for one in self.modes)

    def error_rate(self, form: CanonicalForm) -> float:
        return self.modes[0].error_rate(form)

    def alone(self) -> list[OneGain]:
        """The modes: one whose numbers overflow takes all others with it."""
        if self.thetas is not None:
            blocks = [{**self.observer, "theta": theta} for theta in sorted(self.thetas, reverse=True)]
        else:
            base = {name: value for name, value in self.observer.items() if name != "poles"}
            blocks = [{**base, "gains": list(gains)} for gains in self.gains or ()]
        initial, key = {"initial": dict(self.initial)}, "observer.theta" if self.thetas is None else "thetas"
        return [OneGain({**block, **initial}, key, 1.0, "in this mode") for block in blocks]

    def flow(
        self, plant: PlantCopy, s: Symbols, errors: list[ca.SX], k: Symbols
    ) -> tuple[dict[str, ca.SX], list[ca.SX]]:
        """The derivatives of all states, and the correction of every mode, shape (q,), from their innovations."""
        inner, rates, costs, felt = self.inner, dict[str, ca.SX](), [], []
        moved = []
        for i, (x, e) in enumerate(zip(estimates(s), errors, strict=True)):
            flow = inner.equations(plant, _of_mode(s, i, x), e, _of_mode(k, i))
            rate = flow.derivatives["xhat"]
            moved.append(rate)
            rates |= {f"{name}_{i}": one for name, one in flow.derivatives.items() if name != "xhat"}
            pulled = plant.copy(x) - rate
            costs.append(k.lam1 * ca.sumsqr(e) + k.lam2 * ca.sumsqr(pulled))
            felt.append(ca.jtimes(plant.output(x), x, pulled) if flow.correction is None else flow.correction)
        rates |= {"xhat": moved[0], "mode": ca.SX(0), "eta": ca.vertcat(*costs) - k.nu * s.eta}
        if len(moved) > 1:
            rates["others"] = ca.horzcat(*moved[1:]).T
        return rates, felt

    def decide(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        etas = ca.vertsplit(s.eta)
        now = chosen_of(s.mode, etas)
        best, least = s.mode, now
        for i, eta in enumerate(etas):
            less = ca.logic_and(eta <= k.eps * now, eta < least)
            best, least = ca.if_else(less, i, best), ca.if_else(less, eta, least)
        if not self.reset or len(etas) == 1:
            return {"mode": best}
        return {"mode": best, **self.begun_again(s, best)}

    def begun_again(self, s: Symbols, best: ca.SX) -> dict[str, ca.SX]:
        """At a switch all modes but the nominal one are what the new one is."""
        count, switched = s.eta.numel(), best != s.mode
        names = [name[:-2] for name in vars(s) if name.endswith("_0") and f"{name[:-2]}_1" in vars(s)]
        new = dict[str, ca.SX]()
        for name in names:
            values = [vars(s)[f"{name}_{i}"] for i in range(count)]
            chosen = chosen_of(best, values)
            new |= {f"{name}_{i}": ca.if_else(switched, chosen, values[i]) for i in range(1, count)}
        x, eta = chosen_of(best, estimates(s)), chosen_of(best, ca.vertsplit(s.eta))
        new["others"] = ca.if_else(switched, ca.repmat(x.T, count - 1, 1), s.others)
        new["eta"] = ca.vertcat(s.eta[0], ca.if_else(switched, ca.repmat(eta, count - 1, 1), s.eta[1:]))
        return new


def _family(block: Mapping[str, object]) -> type[ContinuousObserver]:
    """The class of the modes; ValueError says why there is none."""
    own = sorted(_NOT_INSIDE & set(block))
    if own:
        raise ValueError(f"observer: {', '.join(own)} of all modes is a key of the bank itself")
    name = str(block.get("type", ""))
    try:
        family = OBSERVERS.find(name)
    except KeyError:
        raise ValueError(
            f"observer: no observer is called {name!r}; take one of chains, such as shgo or fhgo2"
            f"{meant(name, OBSERVERS.names())}"
        ) from None
    jumps = issubclass(family, CorrectedObserver | DecidedObserver | RecallingObserver | NoiseInformed)
    if not issubclass(family, ContinuousObserver) or jumps or family.form is not canonical_form:
        raise ValueError(
            "observer: modes are observers of chains that are differential equations alone, and ask nothing of the "
            f"noise, such as shgo or fhgo2; {name} is not"
        )
    return family


def _require_key(family: type[ContinuousObserver], capability: type[Block], key: str) -> None:
    if not issubclass(family, capability):
        raise ValueError(f"the observer of the modes has no key {key} in which they could differ")


def _mode(family: type[ContinuousObserver], block: Mapping[str, object]) -> ContinuousObserver:
    """A block of the class; ValueError says what is wrong with it."""
    try:
        return family.model_validate(dict(block))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ValueError(f"{'.'.join(map(str, ('observer', *first['loc'])))}: {first['msg']}") from error


def estimates(s: Symbols) -> list[ca.SX]:
    """xhat of every mode, the nominal one first."""
    return [s.xhat, *([row.T for row in ca.vertsplit(s.others)] if "others" in vars(s) else [])]


def chosen_of(mode: ca.SX, values: list[ca.SX]) -> ca.SX:
    """That of the mode."""
    found = values[0]
    for i, one in enumerate(values[1:], start=1):
        found = ca.if_else(mode == i, one, found)
    return found


def _of_mode(symbols: Symbols, i: int, xhat: ca.SX | None = None) -> Symbols:
    """The states, or the numbers, of one mode by the names that its observer gives them."""
    own = {name.removesuffix(f"_{i}"): value for name, value in vars(symbols).items() if name.endswith(f"_{i}")}
    return Symbols(own if xhat is None else own | {"xhat": xhat})
