"""Configurations that would exhaust memory or time are refused at once, or run in bounded memory."""

import time
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import load, prepared, run

from hgorun import simulate
from hgorun.cli import main
from hgorun.engine.history_room import history_pieces
from hgorun.errors import ConfigError
from hgorun.measurement.chance import generator
from hgorun.simulation.simulate import prepare
from hgorun.simulation.timeline import steps as of_steps
from hgorun.simulation.timeline.steps import count_steps, in_pieces
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.shares import chain_lengths

CONFIG: dict[str, Any] = {
    "title": "limits",
    "time": {"end": 10, "output_step": 0.1},
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0},
    },
    "measurement": {},
    "observers": {"S": {"type": "shgo", "theta": 2, "initial": {"x1": 0, "x2": 0}}},
    "solver": {"method": "rk4", "step": 0.01},
}
DRAWN = {"type": "uniform", "low": -1, "high": 1}


def with_measurement(**measurement: Any) -> dict[str, Any]:
    return CONFIG | {"measurement": measurement}


def refused(folder: Path, config: dict[str, Any], *overrides: str) -> str:
    """The message, after little time."""
    began = time.perf_counter()
    with pytest.raises(ConfigError) as error:
        simulate(load(folder, config, *overrides))
    assert time.perf_counter() - began < 5
    assert error.value.exit_code == 2
    assert "experiment.yaml:" in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("step", ["5e-324", "1e-300", "1e-20", "1e-11"])
@pytest.mark.parametrize("noise", [[], [{"type": "gaussian", "snr_db": 20}]], ids=["plain", "snr"])
def test_a_step_with_too_many_steps(step: float, noise: list[Any], tmp_path: Path) -> None:
    message = refused(tmp_path, with_measurement(noise=noise, sampling={"period": 0.5}) | {"solver": {"step": step}})
    assert "solver.step: the run takes" in message
    assert "increase solver.step" in message


def test_the_longest_adaptive_step(tmp_path: Path) -> None:
    solver = {"method": "dopri5", "rtol": 1e-6, "max_step": 1e-20}
    assert "solver.max_step: the run takes 1e+21 steps" in refused(tmp_path, CONFIG | {"solver": solver})


def test_the_pieces_of_a_long_run_are_bounded() -> None:
    steps = count_steps(np.array([5.0, 0.0001, 4.9]), 1.1e-9)
    spans = np.zeros((3, 4))
    counts = np.column_stack([steps, 0 * steps, steps, *[0 * steps] * 4])
    _, pieces = in_pieces(spans, counts)
    made = pieces[:, 2] - pieces[:, 1]
    assert made.sum() == steps.sum()
    assert len(pieces) <= of_steps._MAX_PIECES + 3
    assert made.max() <= of_steps._MAX_STEPS / of_steps._MAX_PIECES


@pytest.mark.parametrize(
    ("sampling", "key"),
    [({"period": 1e-6, "jitter": 1e-7}, "period"), ({"period": 5e-324}, "period"), ({"steps": "1e-6"}, "steps")],
)
def test_too_many_samples(sampling: Any, key: str, tmp_path: Path) -> None:
    message = refused(tmp_path, with_measurement(sampling=sampling), "time.max_memory=2e8")
    assert f"measurement.sampling.{key}: " in message
    assert "time.max_memory leaves 0.186 GiB" in message


def test_samples_are_counted_over_outputs_and_phases(tmp_path: Path) -> None:
    phases = [{"until": 5, "sampling": {"period": 1e-3}}, {"until": 10, "sampling": {"period": 2e-3}}]
    run(tmp_path, with_measurement(phases=phases), "time.max_memory=2e6")
    assert "measurement.phases.1.sampling.period: " in refused(
        tmp_path, with_measurement(phases=phases), "time.max_memory=1.75e6"
    )
    plant = CONFIG["plant"] | {"output": {"a": "x1", "b": "x2"}}
    several = with_measurement(sampling={"period": 1e-3, "jitter": 1e-5}) | {"plant": plant}
    run(tmp_path, several, "time.max_memory=5.25e6")
    assert "measurement.sampling.period: " in refused(tmp_path, several, "time.max_memory=4.75e6")


def test_too_many_draws(tmp_path: Path) -> None:
    message = refused(tmp_path, with_measurement(noise=[DRAWN | {"hold": 5e-324}]))
    assert "measurement.noise.0.hold: " in message
    message = refused(tmp_path, with_measurement(noise=[DRAWN | {"hold": 1e-8}], sampling={"period": 0.1}))
    assert "measurement.noise.0.hold: " in message
    assert "time.max_memory leaves 2 GiB" in message


def test_a_phase_keeps_only_its_own_draws(tmp_path: Path) -> None:
    """And they are those of a run that has only this phase's noise."""
    noise = [DRAWN | {"hold": 0.01}, {"type": "gaussian", "std": 1, "hold": 0.03}]
    phases = [{"until": 10 * (i + 1) / 5} for i in range(5)]
    channel = prepared(tmp_path, with_measurement(noise=noise, phases=phases)).channels[0]
    for k, (stretch, kept_noise) in enumerate(zip(channel.stretches, channel.noise, strict=True)):
        assert len(kept_noise._held) == 2
        assert all(kept.size <= 2 / hold + 4 for hold, _, kept in kept_noise._held)
        times = np.linspace(stretch.start, stretch.end, 997)
        expected = np.zeros(times.size)
        for j, item in enumerate(kept_noise.random):
            assert item.hold is not None
            draws = generator(0, "noise", f"{channel.name}/{k}", j)
            whole = item.draw(draws, int(10 / item.hold * (1 + 1e-12)) + 1)
            index = np.floor(times / item.hold * (1 + 1e-12) + 1e-9).astype(int)
            expected += whole[np.clip(index, 0, whole.size - 1)]
        np.testing.assert_array_equal(kept_noise.held(times), expected)


def test_the_history_of_a_long_delay(tmp_path: Path) -> None:
    message = refused(tmp_path, with_measurement(delay=5), "solver.step=1e-7")
    assert "measurement.delay: with steps of 1e-07 the history of a delay of 5 takes" in message
    assert "time.max_memory allows 2 GiB" in message


def test_the_history_is_as_long_as_the_delay() -> None:
    ends = np.array([[0.0, 1.0], [1.0, 1.0 + 1e-3], [1.0 + 1e-3, 100.0], [1.0 + 1e-3, 100.0]])
    steps = np.array([100, 50, 5000, 4900])
    spanned = 0.1 * 100 + 50 + 1
    assert spanned < history_pieces(ends, steps, 0.1) <= 2 * (1.1 * spanned + 5)
    assert history_pieces(ends, steps, 1000.0) > steps.sum()


def test_events_that_delays_repeat(tmp_path: Path) -> None:
    config = with_measurement(delay=0.001, noise=[DRAWN | {"hold": 0.01}])
    run(tmp_path, config, "time.max_memory=6e6")
    assert "measurement.delay: " in refused(tmp_path, config, "time.max_memory=3e6")


@pytest.mark.parametrize(("n", "outputs"), [(1, 1), (4, 2), (7, 3), (6, 6), (8, 4)])
def test_few_shares_of_states_are_all_tried(n: int, outputs: int) -> None:
    every = [s for s in product(range(1, n + 1), repeat=outputs) if sum(s) == n]
    found = list(chain_lengths(tuple("abcdef"[:outputs]), n))
    assert sorted(found) == sorted(every)
    assert found == sorted(found, key=lambda s: (max(s) - min(s), sorted(s), [-k for k in s]))


def test_equally_even_shares_give_more_to_the_first_in_the_alphabet() -> None:
    assert list(chain_lengths(("b", "a"), 3)) == [(1, 2), (2, 1)]


def test_many_shares_of_states() -> None:
    began = time.perf_counter()
    for n, outputs in ((20, 10), (25, 10), (60, 20)):
        shares = list(chain_lengths(tuple(map(str, range(outputs))), n))
        assert 20 < len(shares) < 1000
        assert len(set(shares)) == len(shares)
        assert {sum(s) for s in shares} == {n}
        assert max(shares[0]) - min(shares[0]) <= 1
    assert list(islice(chain_lengths(tuple("abcdefghij"), 20), 1)) == [(2,) * 10]
    assert time.perf_counter() - began < 2


def test_many_states_and_outputs(tmp_path: Path) -> None:
    """Ten oscillators, each measured."""
    names = [f"{kind}{i}" for i in range(10) for kind in "xv"]
    dynamics = {f"x{i}": f"v{i}" for i in range(10)} | {f"v{i}": f"-x{i}" for i in range(10)}
    plant = {
        "states": names,
        "dynamics": dynamics,
        "output": {f"y{i}": f"x{i}" for i in range(10)},
        "initial": dict.fromkeys(names, 1),
    }
    observers = {"S": {"type": "shgo", "theta": 2, "initial": dict.fromkeys(names, 0)}}
    experiment = load(tmp_path, CONFIG | {"plant": plant, "observers": observers})
    form = experiment.forms["S"]
    assert isinstance(form, CanonicalForm)
    assert form.chains == (2,) * 10


@pytest.mark.parametrize("more", [{}, {"jitter": 0.05}, {"dropout": 0.3}, {"jitter": 0.05, "dropout": 0.3}])
def test_a_longer_run_begins_with_the_same_samples(more: dict[str, Any], tmp_path: Path) -> None:
    config = with_measurement(sampling={"period": 0.1, **more}, noise=[DRAWN])
    short, long = (prepare(load(tmp_path, config, f"time.end={end}")).channels[0].samples for end in (5, 10))
    inside = short.arrival < 4.9
    count = int(inside.sum())
    assert count > 20
    np.testing.assert_array_equal(short.arrival[inside], long.arrival[:count])
    np.testing.assert_array_equal(short.number[inside], long.number[:count])


def test_running_out_of_memory_names_the_causes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def exhausted(*_: Any, **__: Any) -> None:
        raise MemoryError

    monkeypatch.setattr("typer.Typer.__call__", exhausted)
    monkeypatch.setattr("sys.argv", ["hgorun", "list"])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 1
    message = capsys.readouterr().err
    for cause in ("output_step", "sampling", "holds", "delays"):
        assert cause in message
