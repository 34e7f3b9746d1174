"""The chains of integrators on which observers are looked at: the names of their outputs."""

from __future__ import annotations

from collections.abc import Sequence

from hgorun.observers.base import AnyObserver
from hgorun.observers.chain_speed import ChainSpeed


def outputs_of_chains(count: int) -> tuple[str, ...]:
    """Of one chain each."""
    return tuple(f"y{i + 1}" for i in range(count))


def on_chains(observer: AnyObserver, outputs: Sequence[str]) -> AnyObserver:
    """An observer of a plant with these outputs, as it is for the chains: what it names an output is of its chain."""
    if not isinstance(observer, ChainSpeed) or observer.speed is None:
        return observer
    names = dict(zip(outputs, outputs_of_chains(len(outputs)), strict=True))
    return observer.model_copy(update={"speed": {names[output]: speed for output, speed in observer.speed.items()}})
