"""Random schedules against the naive event list."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

import naive_schedule as naive
import numpy as np
import pytest
from examples import inline, simulated
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st
from naive_schedule import Formula, Layer, Noise, Sampling

from hgorun.config.models import Time
from hgorun.errors import Problem
from hgorun.measurement import events as irregular
from hgorun.measurement import schedule as measured
from hgorun.measurement import variants
from hgorun.measurement.availability import resolve
from hgorun.measurement.blocks import Measurement
from hgorun.measurement.channels import Channel, find_channels
from hgorun.measurement.events import Irregular
from hgorun.measurement.schedule import Schedule, build_schedule, nearest_event

GRID = 20  # times are decimals, multiples of 1/GRID: what coincides on paper does not in binary
LEVELS = 4
NEAR = 1e-9

times = st.integers(1, 12).map(lambda n: Fraction(n, GRID))
or_zero = st.integers(0, 8).map(lambda n: Fraction(n, GRID))
CONSTANT = or_zero.map(lambda d: Formula(repr(float(d)) if d else "0", lambda t, d=d: d))
VARYING = st.sampled_from(
    [
        Formula("0.2 + 0.15*sin(3*t)", lambda t: 0.2 + 0.15 * math.sin(3 * t)),
        Formula("max(0, 0.6 - t)", lambda t: max(0.0, 0.6 - float(t))),
        Formula("0.3*abs(cos(t))", lambda t: 0.3 * abs(math.cos(t))),
    ]
)
STEPS = st.tuples(times, or_zero).map(
    lambda s: Formula(f"{float(s[0])!r} + {float(s[1])!r}*k", lambda k, s=s: s[0] + s[1] * k)
)
FUNCTIONS = st.sampled_from(
    [
        ({"type": "sinusoids", "terms": [{"amplitude": 0.5, "omega": 7, "phase": 1}]}, "0.5*sin(7*t + 1)"),
        ({"type": "expression", "value": "t**2 - 1"}, "t**2 - 1"),
        ({"type": "expression", "value": "0.1*k + t"}, "0.1*k + t"),
    ]
)


@st.composite
def samplings(draw: Any) -> Sampling:
    kind = draw(st.sampled_from(["continuous", "period", "period", "times", "steps"]))
    if kind == "period":
        jitter, dropout = draw(st.sampled_from([(0, 0.0), (0, 0.3), (Fraction(1, 10), 0.0), (Fraction(3, 10), 0.2)]))
        return Sampling(draw(times), draw(or_zero), Fraction(jitter), dropout)
    if kind == "times":
        chosen = draw(st.sets(st.integers(-GRID, 3 * GRID), min_size=1, max_size=12))
        return Sampling(times=tuple(Fraction(n, GRID) for n in sorted(chosen)))
    return Sampling(steps=draw(STEPS)) if kind == "steps" else Sampling()


@st.composite
def noises(draw: Any) -> list[Noise]:
    found = []
    for kind in draw(st.lists(st.sampled_from(["function", "uniform", "gaussian"]), max_size=3)):
        hold = draw(st.one_of(st.none(), times))
        if kind == "function":
            _, text = draw(FUNCTIONS)
            found.append(Noise(Formula(text, lambda t, k, text=text: eval(text, {"sin": math.sin}, {"t": t, "k": k}))))
        elif kind == "uniform":
            found.append(Noise(uniform=(-0.5, 2.0), hold=hold))
        else:
            found.append(Noise(std=0.7, hold=hold))
    return found


def keys(*, delays: st.SearchStrategy[Formula]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({}, optional={"sampling": samplings(), "delay": delays, "noise": noises()})


@st.composite
def cases(
    draw: Any, delays: st.SearchStrategy[Formula]
) -> tuple[list[str], Layer, list[Layer], Fraction, Fraction, int]:
    outputs = draw(st.sampled_from([["y"], ["y1", "y2"]]))
    some = st.dictionaries(st.sampled_from(outputs), keys(delays=delays), max_size=2)
    start = Fraction(draw(st.sampled_from([0, 0, -5, 6])), GRID)
    end = start + Fraction(draw(st.integers(8, 40)), GRID)
    base = Layer(draw(keys(delays=delays)), draw(some))
    cuts = sorted(draw(st.sets(st.integers(1, 39).map(lambda n: start + Fraction(n, GRID)), max_size=3)))
    phases = [Layer(draw(keys(delays=delays)), draw(some), until) for until in [*cuts, start + 3]] if cuts else []
    return outputs, base, phases, start, end, draw(st.integers(0, 3))


def block_of(keys: Mapping[str, Any]) -> dict[str, Any]:
    """Keys as the configuration has them."""
    found: dict[str, Any] = {}
    if "delay" in keys:
        found["delay"] = keys["delay"].text
    if "sampling" in keys:
        s = keys["sampling"]
        found["sampling"] = "continuous"
        if s.period is not None:
            numbers = {"period": s.period, "offset": s.offset, "jitter": s.jitter, "dropout": s.dropout}
            found["sampling"] = {key: float(value) for key, value in numbers.items()}
        elif s.times is not None:
            found["sampling"] = {"times": [float(t) for t in s.times]}
        elif s.steps is not None:
            found["sampling"] = {"steps": s.steps.text}
    if "noise" in keys:
        found["noise"] = [_noise(item) for item in keys["noise"]]
    return found


def _noise(item: Noise) -> dict[str, Any]:
    if item.function is not None:
        text = item.function.text
        if text.startswith("0.5*sin"):
            return {"type": "sinusoids", "terms": [{"amplitude": 0.5, "omega": 7, "phase": 1}]}
        return {"type": "expression", "value": text}
    hold = {} if item.hold is None else {"hold": float(item.hold)}
    if item.uniform:
        return {"type": "uniform", "low": item.uniform[0], "high": item.uniform[1]} | hold
    return {"type": "gaussian", "std": item.std} | hold


def layer_block(layer: Layer) -> dict[str, Any]:
    found = block_of(layer.keys)
    if layer.outputs:
        found["outputs"] = {name: block_of(keys) for name, keys in layer.outputs.items()}
    if layer.until is not None:
        found["until"] = float(layer.until)
    return found


def refused(phases: Sequence[naive.Phase]) -> bool:
    """Whether the configuration means nothing: the reference says what is needed."""
    for p in phases:
        no_k = p.sampling.continuous
        if p.sampling.times is not None and not any(p.start <= t <= p.end for t in p.sampling.times):
            return True  # no sample lies in the phase
        for item in p.noise:
            if no_k and item.function is None and item.hold is None:
                return True  # random noise of a continuous output needs hold
            if no_k and item.function is not None and "k" in item.function.text:
                return True  # it has no samples to number
    return False


def carried_out(case: Any) -> tuple[list[Channel], Schedule, list[list[naive.Phase]]]:
    outputs, base, phases, start, end, seed = case
    expected = [naive.phases_of(name, base, phases, start, end) for name in outputs]
    time = Time(start=float(start), end=float(end), output_step=0.1)
    block = layer_block(base) | ({"phases": [layer_block(p) for p in phases]} if phases else {})
    try:
        resolved = resolve(Measurement.model_validate(block), outputs, time)
        channels = find_channels(resolved, tuple(outputs), time.from_zero, seed, None)
    except Problem:
        event("refused")
        assert any(map(refused, expected))
        assume(False)
        raise
    assert not any(map(refused, expected))
    return channels, build_schedule(channels, time.from_zero, np.zeros(0), 0.01), expected


def near(found: np.ndarray, expected: Sequence[Fraction]) -> None:
    np.testing.assert_allclose(found, [float(t) for t in expected], rtol=0, atol=NEAR)


@pytest.mark.slow
@given(cases(delays=st.one_of(CONSTANT, VARYING)))
@settings(max_examples=150)
def test_samples_are_those_of_the_naive_list(case: Any) -> None:
    outputs, _, _, start, _, seed = case
    channels, _, expected = carried_out(case)
    for name, channel, phases in zip(outputs, channels, expected, strict=True):
        samples = naive.samples_of(phases, seed, name, start)
        found = channel.samples
        assert found.number.tolist() == [s.number for s in samples]
        assert found.stretch.tolist() == [s.phase for s in samples]
        near(found.arrival, [s.arrival - start for s in samples])
        near(found.taken, [s.taken - start for s in samples])
        assert found.used.tolist() == [s.used for s in samples]
        for k, noise in enumerate(channel.noise):
            own = found.stretch == k
            values = [s.noise for s in samples if s.phase == k]
            np.testing.assert_allclose(noise.sampled(found.arrival[own], found.number[own]), values, atol=1e-8)


@pytest.mark.slow
@given(cases(delays=CONSTANT))
@settings(max_examples=150)
def test_events_and_what_holds_between_them(case: Any) -> None:
    outputs, _, _, start, end, seed = case
    channels, schedule, expected = carried_out(case)
    lists = [naive.samples_of(phases, seed, name, start) for name, phases in zip(outputs, expected, strict=True)]
    events = {start, end} | {p.start for phases in expected for p in phases}
    events |= {t for samples in lists for s in samples for t in (s.arrival, s.taken)}
    events |= {t for phases in expected for p in phases if p.sampling.continuous for t in naive.changes_of(p, start)}
    every = naive.come_back(events, [p for phases in expected for p in phases], LEVELS)
    distinct = [t for t in sorted(every) if start <= t <= end]
    near(schedule.events, [t - start for t in distinct])
    for i, (a, b) in enumerate(pairwise(distinct)):
        middle = (a + b) / 2
        variant = schedule.variants[schedule.variant[i]]
        for name, samples, phases, channel, (kind, number) in zip(
            outputs, lists, expected, channels, variant, strict=True
        ):
            word, phase = naive.kind_at(phases, samples, middle)
            assert (kind, number) == (getattr(variants, word), phase)
            (here,) = [p for p in phases if p.start <= middle < p.end]
            if here.sampling.continuous:
                drawn = [item for item in here.noise if item.function is None]
                only = naive.Phase(here.number, here.start, here.end, here.last, here.sampling, here.delay, drawn)
                value = naive.noise_at(only, middle, None, seed, name, start)
                found = channel.noise[phases.index(here)].held(np.array([float(middle - start)]))
                assert found[0] == pytest.approx(value, abs=1e-12)


@given(cases(delays=st.one_of(CONSTANT, VARYING)), st.sampled_from(["additive", "multiplicative"]))
@settings(max_examples=12)
def test_what_the_observers_get(case: Any, mode: str) -> None:
    """A plant that stands still: what is measured is the noise, on 2 or times 2."""
    outputs, base, phases, start, end, seed = case
    expected = [naive.phases_of(name, base, phases, start, end) for name in outputs]
    assume(not any(map(refused, expected)))
    assume(not any(p.sampling.continuous for one in expected for p in one))
    block = layer_block(base) | ({"phases": [layer_block(p) for p in phases]} if phases else {}) | {"mode": mode}
    plant = inline({"x": "0*x"}, outputs[0] if len(outputs) == 1 else "", start=2.0)
    plant["output"] = dict.fromkeys(outputs, "x")
    result = simulated(
        plant, {}, time={"start": float(start), "end": float(end), "output_step": 0.1}, measurement=block, seed=seed
    )
    got = result.measurements
    for i, name in enumerate(outputs):
        samples = naive.samples_of(expected[i], seed, name, start)
        there = np.isfinite(got.y[:, i])
        rows = {round(float(s.arrival), 9): s for s in samples}  # of those at one time the last
        near(got.time[there], [s.arrival for s in rows.values()])
        near(got.taken[there, i], [s.taken for s in rows.values()])
        values = [2 * (1 + s.noise) if mode == "multiplicative" else 2 + s.noise for s in rows.values()]
        np.testing.assert_allclose(got.y[there, i], values, atol=1e-8)


def test_jitter_moves_no_sample_of_the_next_phase_into_this_one() -> None:
    """Both phases start with a sample; the first one's third would be at the start of the second."""
    sampling = {"period": 0.5, "jitter": 0.2}
    block = Measurement.model_validate({"sampling": sampling, "phases": [{"until": 1}, {"until": 2}]})
    time = Time(end=2, output_step=0.1)
    for seed in range(20):
        (channel,) = find_channels(resolve(block, ["y"], time), ("y",), time, seed, None)
        first = channel.samples.stretch == 0
        assert channel.samples.number[first].max() == 1
        assert channel.samples.number[~first].min() == 0


def test_of_two_samples_taken_at_the_same_time_the_later_one_is_used() -> None:
    """0.5 - 0.2 and 0.3 - 0 are one time on paper, and not in binary."""
    fast, slow = {"sampling": {"period": 0.1}}, {"sampling": {"period": 0.1}, "delay": 0.2}
    block = Measurement.model_validate({"phases": [{"until": 0.35, **fast}, {"until": 2, **slow}]})
    for start in (0.0, 0.1, 0.3, 0.7):
        time = Time(start=start, end=start + 1, output_step=0.1)
        shifted = block.model_copy(
            update={"phases": (block.phases[0].model_copy(update={"until": start + 0.3}), block.phases[1])}
        )
        (channel,) = find_channels(resolve(shifted, ["y"], time), ("y",), time.from_zero, 0, None)
        taken = np.round(channel.samples.taken, 9)
        newest = np.maximum.accumulate(np.concatenate([[-np.inf], taken[:-1]]))
        np.testing.assert_array_equal(channel.samples.used, taken >= newest)
        assert np.count_nonzero(taken == 0.2) == 2
        assert channel.samples.used[taken == 0.2].all()


@pytest.mark.parametrize("delay", [0.1, 0.3])
def test_what_comes_back_onto_an_event_is_not_followed_again(delay: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples every 0.1 and a delay of a multiple: beside each event stands its repetition, a rounding error off."""
    block = Measurement.model_validate({"outputs": {"a": {"delay": delay}, "b": {"sampling": {"period": 0.1}}}})
    time = Time(end=20, output_step=0.1)
    channels = find_channels(resolve(block, ["a", "b"], time), ("a", "b"), time, 0, None)
    followed: list[int] = []
    original = irregular.repeated

    def repeated(events: np.ndarray, *others: Any) -> Irregular:
        followed.append(events.size)
        return original(events, *others)

    monkeypatch.setattr(measured, "repeated", repeated)
    found = build_schedule(channels, time, np.zeros(0), 0.01)
    assert followed == [201, 0, 0, 0]
    np.testing.assert_allclose(found.events, 0.1 * np.arange(201), atol=1e-12)


@pytest.mark.parametrize("times", [[0.0, 0.5, 1.0], [0.5, 1.0, 1.5], [1.5, 2.0], [0.4, 1.6], [0.5, 1.5], [2.0], []])
def test_the_nearest_event(times: list[float]) -> None:
    """Whether the times are events one after the other, or not."""
    events = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    expected = [int(np.argmin(np.abs(events - t))) for t in times]
    assert nearest_event(events, np.array(times)).tolist() == expected
