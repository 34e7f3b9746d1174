"""``hgorun estimate CONFIG mqtt://HOST/TOPIC``: nothing that was acknowledged is lost, whatever is cut or killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from broker import Broker
from mqtt_follower import (
    STATE,
    Killed,
    Mortal,
    a_broker,
    fill,
    follow,
    follower,
    once,
    plant_in,
    samples,
    session_at,
    undisturbed,
)
from shell import Shell

from hgorun.commands.mqtt_session import Message

in_folder = pytest.fixture(name="shell")(plant_in)
unreliable = pytest.fixture(name="broker")(a_broker)


def started(shell: Shell, broker: Broker, *more: str) -> subprocess.Popen[bytes]:
    """The command in a process of its own."""
    address = f"mqtt://127.0.0.1:{broker.port}/plant/+"
    words = ["estimate", "plant.yaml", address, "--checkpoint", STATE, "--publish", "estimates", *more]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen(
        [sys.executable, "-m", "hgorun", *words], cwd=shell.folder, env=environment, stderr=subprocess.DEVNULL
    )


def test_connections_that_are_cut_lose_nothing(shell: Shell, monkeypatch: pytest.MonkeyPatch, broker: Broker) -> None:
    whole = undisturbed(shell, monkeypatch, samples())
    fill(broker, samples())

    def cut() -> None:
        raise ConnectionError

    for k in range(25):
        broker.at[10 + 17 * k] = cut
    told = list[str]()
    follow(follower(), Mortal(session_at(broker.port, told.append, known=True)))
    assert broker.connections > 20
    assert once(broker) == whole
    (hint,) = [one for one in told if "trying again" not in one]
    assert told.index(hint) > 0
    assert "was lost 3 times soon after it was made: another client may use the id test; each needs its own" in hint


@pytest.mark.measured("None")
@pytest.mark.costly
@pytest.mark.parametrize("every", [None, 0.07])
def test_processes_that_are_killed_lose_nothing(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, broker: Broker, every: float | None
) -> None:
    more = () if every is None else ("--every", str(every))
    whole = undisturbed(shell, monkeypatch, samples(), *more)
    fill(broker, samples())
    for life in range(24):  # dies before or after messages come, are published, are acknowledged
        with pytest.raises(Killed):
            follow(follower(every=every), Mortal(session_at(broker.port), dies_at=0.5 * (1 + life % 11)))
        broker.cut()
    follow(follower(every=every), Mortal(session_at(broker.port)))
    assert once(broker) == whole


@pytest.mark.costly
def test_batches_with_lines_that_are_refused_lose_no_other_line_and_use_none_twice(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], broker: Broker
) -> None:
    """Wherever the process dies; what is refused would pass when it comes again, since time has gone on."""
    lines = [line for line in samples(30) if "available" not in line]
    whole = undisturbed(shell, monkeypatch, lines)
    batches = [lines[k : k + 4] for k in range(0, len(lines), 4)]
    for k, batch in enumerate(batches):
        farthest = json.loads(batch[0])["t"] + 1e8 * 0.02  # steps
        batch.insert(1, json.dumps({"t": farthest + 0.03, "signal": "a", "y": 9.0 + k}))
        batch.insert(3, json.dumps({"t": -1.0, "signal": "z", "y": 9.0 + k}))
    fill(broker, ["\n".join(batch) for batch in batches])
    for life in range(6):  # dies before or after each call once, among them between checkpoint and acknowledgement
        with pytest.raises(Killed):
            follow(follower(), Mortal(session_at(broker.port), dies_at=0.5 * (1 + life)))
        broker.cut()
    follow(follower(), Mortal(session_at(broker.port)))
    assert once(broker) == whole
    err = capsys.readouterr().err
    assert "the sample in line 2 of a message is left out: t = 2000000.13 is more than 1e+08 steps after 0.1" in err
    assert "the sample in line 4 of a message is left out: a sample taken at -1 is before 0" in err
    broker.wait_until(lambda: not broker.unacknowledged)


@pytest.mark.slow
def test_kills_at_any_packet_lose_nothing(shell: Shell, monkeypatch: pytest.MonkeyPatch, broker: Broker) -> None:
    """Of the command itself, by SIGKILL."""
    lines = samples(200)
    whole = undisturbed(shell, monkeypatch, lines)
    process = started(shell, broker)
    broker.wait_until(lambda: any(one.topics for one in broker.sessions.values()))
    for line in lines:
        broker.publish("plant/any", line)
    kills = int(os.environ.get("HGORUN_KILLS", "2"))
    for k in range(kills):  # some die before they have acknowledged anything
        broker.at[broker.packets + 20 + 60 * k // kills] = process.kill
        assert process.wait(timeout=60) == -signal.SIGKILL
        process = started(shell, broker)
    broker.wait_until(lambda: not broker.unacknowledged)
    assert once(broker) == whole
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 143


@pytest.mark.parametrize(("theta", "strict", "wanted"), [(4000, True, 3), (4000, False, 143), (2, True, 143)])
def test_a_topic_that_is_followed_no_more_says_whether_all_was_well(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, theta: float, strict: bool, wanted: int
) -> None:
    """Its only end is that of the process."""

    class Stopped:
        def __init__(self, *_: object, **__: object) -> None:
            self.left = [[Message("plant/any", line.encode(), 1, 1) for line in samples(30)]]

        def messages(self) -> list[Message]:
            if not self.left:
                raise SystemExit(143)
            return self.left.pop()

        def acknowledge(self, messages: list[Message]) -> None: ...

        def close(self) -> None: ...

    monkeypatch.setattr("hgorun.commands.mqtt.Session", Stopped)
    monkeypatch.setattr("hgorun.process._instead", [])  # the process of the tests ends as it would
    more = ["--strict"] if strict else []
    words = ("estimate", "plant.yaml", "mqtt://h/plant/+", "--checkpoint", STATE, "--set", f"observers.o.theta={theta}")
    code, out, _ = shell(*words, *more)
    assert code == wanted
    assert ('"diverged"' in out) == (theta > 2)


@pytest.mark.slow
def test_a_signal_that_ends_a_topic_ends_with_the_code_of_strict(shell: Shell, broker: Broker) -> None:
    process = started(shell, broker, "--strict", "--set", "observers.o.theta=4000")
    broker.wait_until(lambda: any(one.topics for one in broker.sessions.values()))
    for line in samples(30):
        broker.publish("plant/any", line)
    broker.wait_until(lambda: len(broker.received) > 0 and not broker.unacknowledged)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=60) == 3
