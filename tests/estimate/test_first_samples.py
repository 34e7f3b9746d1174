"""Where observers start: from the state that the first samples speak for, in closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import Block, inline
from recordings import held_input, observers, recording, signal, source
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hgorun.data.recording import FirstSamples, Recording, Signal
from hgorun.errors import ConfigError
from hgorun.estimate.completed import completed
from hgorun.estimate.gains.cases import Case
from hgorun.estimate.gains.goal import Split
from hgorun.estimate.start import outliers, starting
from hgorun.estimate.start.first_values import known_far_behind, known_later, known_too_late
from hgorun.estimate.start.fit import Fit, fit
from hgorun.estimate.start.start_task import StartTask

TIMES = np.array([0.0, 0.11, 0.2, 0.32, 0.4, 0.5])


def start_of(plant: Block, recorded: Recording, count: FirstSamples, **more: Any) -> Mapping[str, float]:
    """The initial estimate of an observer of which the configuration says nothing."""
    block = {"type": "shgo", "theta": 2, "poles": -1}
    config = {"plant": plant, "observers": {"o": block}, "solver": {"step": 0.01}, **more}
    found = completed(source(config), replace(recorded, first_samples=count), "start", "")
    return found.observers["o"].initial


def outputs_at(times: np.ndarray, **values: Any) -> list[Signal]:
    return [signal(name, times, value, std=0.01) for name, value in values.items()]


def plant_of(dynamics: Mapping[str, str], output: Any) -> Block:
    return {key: value for key, value in inline(dynamics, output).items() if key != "initial"}


OSCILLATOR = plant_of({"a": "b", "b": "-4*a"}, "a")


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3, 6])
@pytest.mark.parametrize("size", [1.0, 1e-9, 1e9])
def test_exact_samples_give_the_exact_state(count: int, size: float) -> None:
    a = size * (0.3 * np.cos(2 * TIMES) - 0.8 * np.sin(2 * TIMES))
    found = start_of(OSCILLATOR, recording(*outputs_at(TIMES, a=a)), count)
    assert found["a"] == pytest.approx(0.3 * size, rel=1e-6)
    assert found["b"] == pytest.approx(-1.6 * size, rel=1e-6)


def test_one_sample_gives_the_state_that_is_measured() -> None:
    assert start_of(OSCILLATOR, recording(*outputs_at(TIMES, a=TIMES + 0.3)), 1) == {"a": 0.3}


def test_more_samples_than_unknowns_are_met_in_the_least_squares() -> None:
    plant = plant_of({"a": "b", "b": "0"}, "a")
    rng = np.random.default_rng(0)
    a = 1 - 2 * TIMES + 0.01 * rng.standard_normal(TIMES.size)
    found = start_of(plant, recording(*outputs_at(TIMES, a=a)), TIMES.size)
    slope, value = np.polyfit(TIMES, a, 1)
    assert (found["a"], found["b"]) == pytest.approx((value, slope), rel=1e-8)


def ramp(changed: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and noisy samples of a = 1 - 2 t, whose speed changes with the hundredth sample."""
    t = 0.01 * np.arange(300)
    noise = 0.01 * np.random.default_rng(5).standard_normal(t.size)
    return t, 1 - 2 * t + changed * np.maximum(t - 1, 0) + noise


def test_a_fast_mode_between_samples_far_apart_is_followed() -> None:
    """60 of its time constants lie between two samples, which the least squares of the exact solution do not mind."""
    t, random = 60.0 * np.arange(6), np.random.default_rng(4)
    way = np.stack([expm(np.array([[-1.0, 1.0], [0.0, -0.002]]) * time) for time in t])
    a, b = (way @ [6.0, 4.0]).T + 0.05 * random.standard_normal((2, t.size))
    plant = plant_of({"a": "b - a", "b": "-0.002*b"}, {"y": "a", "z": "b"})
    found = start_of(plant, recording(signal("y", t, a, std=0.05), signal("z", t, b, std=0.05)), t.size)
    expected = np.linalg.lstsq(np.concatenate([way[:, 0], way[:, 1]]), np.concatenate([a, b]), rcond=None)[0]
    assert (found["a"], found["b"]) == pytest.approx(tuple(expected), abs=1e-4)


def test_a_start_that_is_nearest_only_beside_it_is_sought_from_fewer_samples() -> None:
    """Of a Lorenz attractor: 20 samples from a guess lead to one that is 74 standard deviations off."""
    t, random = 0.05 * np.arange(20), np.random.default_rng(100)
    truth = np.array([6.7, 1.9, 17.2])

    def lorenz(_: float, x: np.ndarray) -> list[float]:
        return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]

    a = solve_ivp(lorenz, (0, t[-1]), truth, t_eval=t, rtol=1e-10, atol=1e-10).y[0] + 0.1 * random.standard_normal(20)
    plant = plant_of({"a": "10*(b - a)", "b": "a*(28 - c) - b", "c": "a*b - 8/3*c"}, "a")
    found = start_of(plant, recording(signal("a", t, a, std=0.1)), t.size)
    assert list(found.values()) == pytest.approx(truth, abs=1.0)


def test_a_model_that_is_too_fast_for_any_steps_is_refused() -> None:
    plant = plant_of({"a": "-1e9*(a - cos(t))"}, "a")
    with pytest.raises(ConfigError, match="the model or its inputs change too fast"):
        start_of(plant, recording(*outputs_at(TIMES, a=np.cos(TIMES))), 6)


@pytest.mark.costly
def test_as_many_samples_are_used_as_agree() -> None:
    """All of the first 200, beyond which none are tried, where the model is right."""
    plant = plant_of({"a": "b", "b": "0"}, "a")
    t, a = ramp()
    found = start_of(plant, recording(signal("a", t, a, std=0.01)), "auto")
    slope, value = np.polyfit(t[:200], a[:200], 1)
    assert (found["a"], found["b"]) == pytest.approx((value, slope), rel=1e-8)


@pytest.mark.costly
def test_an_exact_model_is_not_left_for_its_noise() -> None:
    """Within two standard deviations half of such records do not stay over all fits, within three one in twenty (this
    one would be left with the twelfth sample), within four one in a thousand.

    Nested fits of a line differ by gaussian numbers of variance s_j^2 - s_k^2 alone, so that this holds for any model.
    """
    plant = plant_of({"a": "b", "b": "0"}, "a")
    t = 0.02 * np.arange(200)
    a = 1 - 2 * t + 0.03 * np.random.default_rng(26).standard_normal(t.size)
    found = start_of(plant, recording(signal("a", t, a, std=0.03)), "auto")
    slope, value = np.polyfit(t, a, 1)
    assert (found["a"], found["b"]) == pytest.approx((value, slope), rel=1e-8)


def test_samples_that_the_model_does_not_describe_are_not_used_for_the_start() -> None:
    """A line through 100 samples has a slope with a standard deviation of 0.01 sqrt(12/100^3)/0.01 = 0.0035."""
    plant = plant_of({"a": "b", "b": "0"}, "a")
    t, a = ramp(changed=0.5)
    found = start_of(plant, recording(signal("a", t, a, std=0.01)), "auto")
    assert abs(np.polyfit(t[:200], a[:200], 1)[0] + 2) > 0.1
    assert abs(found["b"] + 2) < 4 * 0.0035


def test_what_agrees_is_a_matter_of_the_noise() -> None:
    """Also where the same samples with a std of 1, which is taken where none is needed, have been fitted before."""
    start_of(OSCILLATOR, recording(signal("a", TIMES, TIMES, std=1.0)), "auto")
    with pytest.raises(ConfigError, match="first_samples: auto needs the noise of the samples: a has no std"):
        start_of(OSCILLATOR, recording(signal("a", TIMES, TIMES)), "auto")


def test_a_nonlinear_model_across_the_end_of_a_period() -> None:
    """x' = v, v' = v^2: x = x_0 - ln(1 - v_0 t)."""
    plant = plant_of({"x": "v", "v": "v**2"}, {"x": {"value": "x", "period": 2 * np.pi}})
    x = 3.0 - np.log(1 - 0.9 * TIMES)
    found = start_of(plant, recording(*outputs_at(TIMES, x=np.remainder(x + np.pi, 2 * np.pi) - np.pi)), 6)
    assert np.max(x) > np.pi
    assert (found["x"], found["v"]) == pytest.approx((3.0, 0.9), rel=1e-5)


@pytest.mark.parametrize("count", [3, "auto"])
def test_what_is_not_told_stays_where_the_plant_begins(count: FirstSamples) -> None:
    plant = plant_of({"a": "b", "b": "-4*a", "c": "-c"}, "a")
    a = 0.3 * np.cos(2 * TIMES)
    blocks = {"o": {"type": "ekf", "Q": {"b": 1}}}
    config = {"plant": {**plant, "initial": {"a": 0, "b": 0, "c": 5}}, "observers": blocks, "solver": {"step": 0.01}}
    recorded = replace(recording(*outputs_at(TIMES, a=a)), first_samples=count)
    initial = completed(source(config), recorded, "start", "").observers["o"].initial
    assert initial == pytest.approx(
        {"a": 0.3, "b": 0.0, "c": 5.0}, abs=1e-8
    )  # six samples: steps of 0.014, of fourth order


def test_an_input_that_is_recorded_acts_from_the_start() -> None:
    plant = plant_of({"a": "b", "b": "u"}, "a")
    ramp = held_input("u", [0.0, 1.0], [1.0, 3.0], hold="linear")
    a = 0.5 - TIMES + TIMES**2 / 2 + TIMES**3 / 3
    found = start_of(plant, recording(*outputs_at(TIMES, a=a), u=ramp), 4)
    assert (found["a"], found["b"]) == pytest.approx((0.5, -1.0), abs=1e-9)


def test_several_outputs_at_times_of_their_own() -> None:
    plant = plant_of({"a": "b", "b": "-4*a", "c": "d", "d": "-c"}, ["a", "c"])
    late = TIMES[1:] + 0.05
    signals = [*outputs_at(TIMES, a=np.sin(2 * TIMES)), *outputs_at(late, c=2 * np.cos(late))]
    found = start_of(plant, recording(*signals), 3)
    assert found == pytest.approx({"a": 0.0, "b": 2.0, "c": 2.0, "d": 0.0}, abs=1e-6)


def test_a_start_that_is_given_is_kept() -> None:
    config = {"plant": OSCILLATOR, "observers": observers("shgo"), "solver": {"step": 0.01}}
    recorded = replace(recording(*outputs_at(TIMES, a=TIMES)), first_samples=3)
    initial = completed(source(config), recorded, "start", "").observers["shgo"].initial
    assert initial == {"a": 0.0, "b": 1.0}


def test_of_a_start_that_is_given_in_part_the_rest_is_fitted() -> None:
    blocks = {"o": {"type": "shgo", "theta": 2, "initial": {"b": 5.0}}}
    config = {"plant": OSCILLATOR, "observers": blocks, "solver": {"step": 0.01}}
    recorded = replace(recording(*outputs_at(TIMES, a=np.cos(2 * TIMES))), first_samples=3)
    initial = completed(source(config), recorded, "start", "").observers["o"].initial
    assert initial == pytest.approx({"a": 1.0, "b": 5.0})


@pytest.mark.parametrize("count", [6, "auto"])
def test_a_model_that_leaves_all_bounds_is_refused(count: FirstSamples) -> None:
    plant = plant_of({"a": "b", "b": "exp(50*a)"}, "a")
    with pytest.raises(ConfigError, match="leaves all bounds"):
        start_of(plant, recording(*outputs_at(TIMES, a=5 + TIMES)), count)


@pytest.mark.parametrize(
    ("known", "given", "told"),
    [
        ([1.5, 2.0, 3.0], {}, ["o: a starts from the first sample, taken at 0 and known at 1.5 only"]),
        ([1.5, 2.0, 3.0], {"b": 0.7}, ["o: a starts from the first sample, taken at 0 and known at 1.5 only"]),
        ([1.5, 2.0, 3.0], {"a": 0.4}, []),
        ([1.5, 2.0, 3.0], {"a": 0.7}, []),  # which is the number of that sample
        ([0.0, 1.0, 2.0], {}, []),
    ],
)
def test_a_start_from_a_sample_that_is_known_later_is_told(
    known: list[float], given: dict[str, float], told: list[str]
) -> None:
    recorded = recording(signal("a", [0.0, 1.0, 2.0], [0.7, 0.6, 0.5], known))
    block = {"type": "shgo", "theta": 2, "poles": -1, "initial": given}
    config = source({"plant": OSCILLATOR, "observers": {"o": block}, "solver": {"step": 0.01}})
    found = list(known_later(completed(config, recorded, "start", ""), recorded))
    assert [words.partition(":")[0] + ":" + words.split(":")[1] for words in found] == told


def test_a_fitted_start_is_no_first_sample_though_it_has_its_number() -> None:
    known = np.array([1.5, 2.0, 3.0])
    recorded = replace(recording(signal("a", [0.0, 1.0, 2.0], [0.7, 0.7, 0.7], known)), first_samples=3)
    plant = plant_of({"a": "0", "b": "0"}, "a")
    config = source(
        {"plant": plant, "observers": {"o": {"type": "ekf", "Q": {"a": 1}, "R": 1}}, "solver": {"step": 0.01}}
    )
    found = completed(config, recorded, "start", "")
    assert found.observers["o"].initial["a"] == 0.7
    assert not list(known_later(found, recorded))


def test_what_is_given_later_was_not_taken_from_the_log() -> None:
    config = source({"plant": OSCILLATOR, "observers": {"o": {"type": "shgo", "theta": 2}}, "solver": {"step": 0.01}})
    recorded = replace(recording(*outputs_at(TIMES, a=np.cos(2 * TIMES))), first_samples=3)
    found = completed(config, recorded, "start", "")
    assert found.begun == {"o": {"a": "model", "b": "model"}}
    assert found.varied({"observers.o.theta": 3.0}).begun == found.begun
    assert found.varied({"observers.o.initial.b": 1.0}).begun == {"o": {"a": "model"}}
    assert found.varied({"observers.o.initial": {"a": 1.0}}).begun == {"o": {}}


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ([0.0, 1.0, 9.0], []),
        ([0.0, 8.0, 9.0], ["a: 2 of 3 samples become known only after the last of the log is taken"]),
    ],
)
def test_samples_most_of_which_are_known_too_late_are_told(known: list[float], told: list[str]) -> None:
    found = known_too_late(recording(signal("a", [0.0, 1.0, 2.0], [0.7, 0.6, 0.5], known)))
    assert [words.partition(", at")[0] for words in found] == told


def test_one_sample_that_is_known_too_late_is_told_of_as_one() -> None:
    (words,) = known_too_late(recording(signal("a", [0.0], [0.7], [9.0])))
    said = "a: its one sample becomes known only after the last of the log is taken, at t = 0, at 9: is data.outputs.a"
    assert words.startswith(said)


@pytest.mark.parametrize(
    ("known", "end", "told"),
    [
        ([0.0, 1.0, 4.0], None, []),
        ([0.0, 1.0, 50000.0], None, ["log.csv:4: a: a sample becomes known at t = 50000 only"]),
        ([0.0, 1.0, 50000.0], 3.0, []),
        ([8.0, 8.0, 9.0], None, []),  # which is told otherwise
    ],
)
def test_a_sample_that_makes_the_run_much_longer_is_told(
    known: list[float], end: float | None, told: list[str]
) -> None:
    recorded = recording(signal("a", [0.0, 1.0, 2.0], [0.7, 0.6, 0.5], known))
    time = {} if end is None else {"time": {"end": end}}
    config = source({"plant": OSCILLATOR, "observers": {}, "solver": {"step": 0.01}, **time})
    found = list(known_far_behind(completed(config, recorded, "start", ""), recorded))
    assert [words.partition(", and")[0] for words in found] == told


def test_a_sample_that_becomes_known_beyond_all_times_is_refused_with_its_line() -> None:
    recorded = recording(signal("a", [0.0, 1.0, 2.0], [0.7, 0.6, 0.5], [0.0, 1e300, 2.0]))
    config: Block = {"plant": OSCILLATOR, "observers": {}, "solver": {"step": 0.01}}
    with pytest.raises(ConfigError, match=r"a: the sample taken at 1 becomes known 1e\+300 later") as refused:
        completed(source(config), recorded, "start", "")
    assert (refused.value.file, refused.value.line) == ("log.csv", 3)
    files, part = (Path("log.csv"), Path("next.csv")), np.array([0, 1, 1])
    in_parts = recording(replace(recorded.outputs["a"], sources=files, part=part))
    with pytest.raises(ConfigError, match="becomes known") as refused:
        completed(source(config), in_parts, "start", "")
    assert refused.value.file == "next.csv"
    assert completed(source({**config, "time": {"end": 2.0}}), recorded, "start", "").time.end == 2.0


def test_a_fit_is_made_again_only_where_what_it_depends_on_is_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gains of an observer are not; samples, their noise, parameters and inputs are."""
    made: list[int] = []

    def counted(task: StartTask, x: np.ndarray) -> Fit | None:
        made.append(1)
        return fit(task, x)

    monkeypatch.setattr(starting, "fit", counted)
    monkeypatch.setattr(outliers, "fit", counted)

    def again(a: np.ndarray, theta: float, k: float = 4.0, std: float = 0.01, **more: Any) -> bool:
        made.clear()
        plant = plant_of({"a": "b", "b": "-k*a + u"}, "a") | {
            "parameters": {"k": k},
            "inputs": {"u": more.get("u", "0")},
        }
        config = {"plant": plant, "observers": {"o": {"type": "shgo", "theta": theta}}, "solver": {"step": 0.01}}
        recorded = replace(recording(signal("a", TIMES, a, std=std)), first_samples=more.get("count", 6))
        completed(source(config), recorded, "start", "")
        return bool(made)

    a = np.cos(2 * TIMES)
    starting._FITS.clear()
    assert again(a, 2)
    assert not again(a, 3)
    assert again(a, 3, k=5)
    assert again(a, 3, std=0.02)
    assert again(2 * a, 3)
    assert again(a, 3, u="sin(t)")
    assert again(a, 3, count=5)
    assert again(a, 3, count="auto")
    assert not again(a, 4, count="auto")


def line_of(count: int, outliers: Mapping[int, float], gate: float | None, bend: float = 0.0) -> tuple[float, float]:
    """The start of a line from noisy samples of 1 - 2 t + bend t^2, some of them off by standard deviations."""
    t = 0.1 * np.arange(count)
    a = 1 - 2 * t + bend * t**2 + 0.01 * np.random.default_rng(0).standard_normal(count)
    for k, size in outliers.items():
        a[k] += 0.01 * size
    found = start_of(plant_of({"a": "b", "b": "0"}, "a"), recording(signal("a", t, a, std=0.01, gate=gate)), count)
    return found["a"], found["b"]


@pytest.mark.parametrize("outliers", [{0: 1000.0}, {1: -20.0}, {5: 300.0, 9: 40.0}])
def test_a_gate_leaves_outliers_out_of_the_first_samples(outliers: Mapping[int, float]) -> None:
    """What is found is the line through the others."""
    t = 0.1 * np.arange(10)
    a = 1 - 2 * t + 0.01 * np.random.default_rng(0).standard_normal(10)
    kept = np.setdiff1d(np.arange(10), list(outliers))
    slope, value = np.polyfit(t[kept], a[kept], 1)
    np.testing.assert_allclose(line_of(10, outliers, 5.0), [value, slope], rtol=0, atol=1e-7)


def test_a_gate_changes_no_start_where_samples_agree_or_are_too_few() -> None:
    assert line_of(10, {}, 5.0) == line_of(10, {}, None)
    assert line_of(3, {1: 100.0}, 5.0) == line_of(3, {1: 100.0}, None)
    assert line_of(10, {}, 5.0, bend=4.0) == line_of(10, {}, None, bend=4.0)  # the model is wrong, no sample is


@pytest.mark.one_in(3)
@pytest.mark.parametrize("outlier", [0, 1, 2])
def test_of_few_samples_an_outlier_shows_beside_those_that_follow(outlier: int) -> None:
    """What is found is the line through as many others."""
    t = 0.1 * np.arange(12)
    a = 1 - 2 * t + 0.01 * np.random.default_rng(1).standard_normal(12)
    kept = np.delete(np.arange(12), outlier)[:3]
    log = recording(signal("a", t, a + 0.5 * (np.arange(12) == outlier), std=0.01, gate=5))
    found = start_of(plant_of({"a": "b", "b": "0"}, "a"), log, 3)
    slope, value = np.polyfit(t[kept], a[kept], 1)
    np.testing.assert_allclose([found["a"], found["b"]], [value, slope], rtol=0, atol=1e-7)


@pytest.mark.parametrize("outlier", [0, 7])
def test_an_outlier_at_an_end_shows_though_the_fit_follows_it(outlier: int) -> None:
    """Of a parabola through eight samples the error of the first is 0.54 standard deviations, so that 12 show as 6.5.

    What is found is the parabola through the others; without an outlier it is the one through all.
    """
    t = 0.1 * np.arange(8)
    plant = plant_of({"a": "b", "b": "c", "c": "0"}, "a")
    a = 1 - 2 * t + 3 * t**2 + 0.01 * np.random.default_rng(1).standard_normal(8)
    for size, kept in ((12.0, np.delete(np.arange(8), outlier)), (0.0, np.arange(8))):
        y = a + 0.01 * size * (np.arange(8) == outlier)
        found = start_of(plant, recording(signal("a", t, y, std=0.01, gate=5)), 8)
        bend, slope, value = np.polyfit(t[kept], y[kept], 2)
        np.testing.assert_allclose([found[name] for name in "abc"], [value, slope, 2 * bend], rtol=0, atol=1e-6)


def test_a_start_that_is_sought_stays_where_the_others_follow_from_the_model() -> None:
    """As does one that is given; what is fitted is so to each model that is tried."""
    plant = plant_of({"a": "b", "b": "-k*a"}, "a") | {"parameters": {"k": 4.0}}
    config = source({"plant": plant, "observers": {"o": {"type": "shgo", "theta": 2}}, "solver": {"step": 0.01}})
    recorded = replace(recording(*outputs_at(TIMES, a=np.cos(2 * TIMES))), first_samples=3)
    case = Case(completed(config, recorded, "start", ""), Split(recorded, {}, {}), refitted=True)
    starts = [
        case.with_gains({"plant.parameters.k": k, **sought}).experiment.observers["o"].initial
        for k, sought in ((4.0, {}), (9.0, {}), (9.0, {"observers.o.initial.b": 0.75}))
    ]
    assert starts[0] == pytest.approx({"a": 1.0, "b": 0.0}, abs=1e-6)
    assert abs(starts[1]["a"] - 1.0) > 1e-3
    assert starts[2] == {"a": starts[1]["a"], "b": 0.75}
