"""Messages from a broker: what is wrong in them is told and left out, and times may be late or far ahead."""

from __future__ import annotations

import json

import pytest
from broker import Broker
from mqtt_follower import Handed, Mortal, a_broker, fill, follow, follower, plant_in, samples, session_at, undisturbed
from shell import Shell

in_folder = pytest.fixture(name="shell")(plant_in)
unreliable = pytest.fixture(name="broker")(a_broker)


def test_messages_that_are_wrong_are_told_and_acknowledged(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], broker: Broker
) -> None:
    lines = samples(6)
    whole = undisturbed(shell, monkeypatch, lines)
    session = session_at(broker.port)
    session._connect()
    for line in lines[:2]:
        broker.publish("plant/a", line)
    for payload in ("17.3", b"\xff", '{"t": 1}', '{"t": 1e300, "y": 1}', '{"t": 1, "signal": "q", "y": 1}'):
        broker.publish("plant/a", payload)
    broker.publish("plant/a", lines[0])  # of a sensor that has not got the broker's answer
    for line in lines[2:]:
        broker.publish("plant/a", line)
    broker.publish("plant/end", "")
    follow(follower(publish=None), Mortal(session))
    out, err = capsys.readouterr()
    assert list(dict.fromkeys(out.splitlines())) == whole
    for said in ("expected an object", "not UTF-8", "key y is missing", "time.start", "'q' is none of a, z"):
        assert said in err
    broker.wait_until(lambda: not broker.unacknowledged)


def test_a_message_with_a_wrong_line_is_left_out_as_a_whole(shell: Shell, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = '{"t": 0.2, "y": 0.2}\n{"t": 0.3, "y": bad}\n{"t": 0.4, "y": 0.4}'
    unknown = '{"t": 0.2, "y": 0.2}\n\n{"t": 0.3, "y": 1, "signal": "q"}'
    follower(publish=None).take_some(Handed(wrong, unknown, '{"t": 0.1, "y": 0.1}'))
    out, err = capsys.readouterr()
    assert [json.loads(line)["t"] for line in out.splitlines()] == [0.1, 0.1]  # of two observers
    assert "plant/a: a message is left out: line 2: not JSON" in err
    assert "plant/a: a message is left out: line 3: the signal 'q' is none of" in err


def test_a_sample_that_is_refused_is_left_out_alone(shell: Shell, capsys: pytest.CaptureFixture[str]) -> None:
    lines = '{"t": 0.1, "y": 0.1}\n{"t": -1, "y": 0.3}\n{"t": 0.2, "y": 0.2}'
    follower(publish=None).take_some(Handed(lines, '{"t": -2, "y": 1}'))
    out, err = capsys.readouterr()
    assert [json.loads(line)["t"] for line in out.splitlines()] == [0.1, 0.1, 0.2, 0.2]
    assert "plant/a: the sample in line 2 of a message is left out: a sample taken at -1 is before 0" in err
    assert "plant/a: a message is left out: a sample taken at -2 is before 0" in err


@pytest.mark.parametrize(("at", "said"), [(9000.0, True), (30.0, False)])
def test_a_time_that_is_far_ahead_is_told(
    shell: Shell, capsys: pytest.CaptureFixture[str], at: float, said: bool
) -> None:
    lines = [json.dumps({"t": round(0.5 * k, 1), "y": 0.1}) for k in range(1, 15)]
    follower(publish=None).take_some(Handed(*lines, json.dumps({"t": at, "y": 0.1}), '{"t": 7.5, "y": 0.1}'))
    assert (f"plant/a: t = {at:g} is far ahead of 7, the time before" in capsys.readouterr().err) == said


def test_samples_that_others_have_overtaken_are_late_ones(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], broker: Broker
) -> None:
    """Two sensors, each in its order."""
    lines = [
        '{"t": 0.1, "signal": "a", "y": 0.1}',
        '{"t": 0.095, "y": 1, "signal": "z"}',
        '{"t":0.2,"y":0.2,"signal":"a"}',
    ]
    as_late = [lines[0], lines[1].replace('"y": 1', '"y": 1, "available": 0.1'), lines[2]]
    whole = undisturbed(shell, monkeypatch, as_late)
    fill(broker, lines)
    follow(follower(publish=None), Mortal(session_at(broker.port)))
    assert capsys.readouterr().out.splitlines() == whole


@pytest.mark.parametrize("first", [0.1, 0.3])
def test_a_sample_that_was_known_before_it_was_taken_is_refused_whatever_the_time(
    shell: Shell, capsys: pytest.CaptureFixture[str], first: float
) -> None:
    wrong = '{"t": 0.25, "y": 0.3, "available": 0.2}'
    follower(publish=None).take_some(Handed(json.dumps({"t": first, "y": 0.1}), wrong))
    out, err = capsys.readouterr()
    assert [json.loads(line)["t"] for line in out.splitlines()] == [first, first]
    assert "a message is left out: taken at 0.25, after it was known at 0.2" in err
