"""``hgorun estimate CONFIG mqtt://HOST/TOPIC``: nothing that was acknowledged is lost, whatever is cut or killed."""

from __future__ import annotations

import io
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from broker import Broker
from shell import Shell

from hgorun.commands.mqtt import Follower
from hgorun.commands.mqtt_address import Address, Credentials, client_id_of, require_topic
from hgorun.commands.mqtt_session import Message, Session
from hgorun.commands.run_options import Estimate
from hgorun.commands.stream_samples import Stream
from hgorun.config.reading import read_source
from hgorun.errors import ConfigError

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: -sin(a) - 0.1*b}
  output: {a: a, z: b}
solver: {step: 0.02}
data:
  file: log.csv
  time: t
  outputs: {a: {column: angle, std: 0.02, gate: 6}, z: speed}
observers:
  o: {type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}
  p: {type: shgo, theta: 4, poles: -1, initial: {a: 0, b: 1}}
"""
STATE = "state"


class Killed(BaseException):
    """The process is gone."""


class Ended(Exception):
    """The last message has been acknowledged."""


@pytest.fixture(name="shell")
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "plant.yaml").write_text(CONFIG)
    return Shell(tmp_path, monkeypatch, capsys)


def samples(count: int = 60) -> list[str]:
    """Of two sensors; some late, and some of one time."""
    found = []
    for k in range(1, count):
        late = {"available": round(0.1 * k + 0.05, 3)} if k % 7 == 0 else {}
        found.append({"t": round(0.1 * k, 3), "signal": "a", "y": round(float(np.sin(0.1 * k)), 4)} | late)
        if k % 3 == 0:
            found.append({"t": round(0.1 * k + 0.05, 3), "signal": "z", "y": round(float(np.cos(0.1 * k)), 4)})
    return [json.dumps(one) for one in found]


def undisturbed(shell: Shell, monkeypatch: pytest.MonkeyPatch, lines: Sequence[str], *more: str) -> list[str]:
    """What a stream from standard input gives; two samples that are known at one time may give the same line."""
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n".join(lines)))
    code, out, err = shell("estimate", "plant.yaml", "-", *more)
    assert (code, err) == (0, "")
    return list(dict.fromkeys(out.splitlines()))


def once(broker: Broker) -> list[str]:
    """What has been published to ``estimates``; what was published again is the same, and left out."""
    return list(dict.fromkeys(payload for topic, payload in broker.received if topic == "estimates"))


def follower(publish: str | None = "estimates", every: float | None = None) -> Follower:
    """One that begins, or goes on from the checkpoint, as a new process."""
    _, source = read_source(Path("plant.yaml"), [], seed=None)
    options = Estimate(config=Path("plant.yaml"), checkpoint=Path(STATE), publish=publish, every=every)
    return Follower.of(Stream.of(source, "plant"), options)


def session_at(port: int, tell: Callable[[str], None] = lambda _: None, *, known: bool = False) -> Session:
    return Session(Address("127.0.0.1", port, False, "plant/#"), "test", Credentials(), tell, known=known)


class Mortal:
    """A session that ends after the message ``plant/end``, or before or after the call with some number."""

    def __init__(self, session: Session, dies_at: float = np.inf) -> None:
        self.session, self.left = session, dies_at

    def _call(self) -> None:
        self.left -= 0.5
        if self.left <= 0:
            raise Killed

    def messages(self) -> list[Message]:
        self._call()
        found = self.session.messages()
        self._call()
        return found

    def publish(self, topic: str, payloads: list[str]) -> None:
        self._call()
        self.session.publish(topic, payloads)
        self._call()

    def acknowledge(self, messages: list[Message]) -> None:
        self._call()
        self.session.acknowledge(messages)
        self._call()
        if any(one.topic == "plant/end" for one in messages):
            raise Ended


def follow(to: Follower, broker: Mortal) -> None:
    try:
        while True:
            to.take_some(broker)
    except Ended:
        broker.session.close()


def fill(broker: Broker, lines: Sequence[str]) -> None:
    """Publish when the client has subscribed once: the rest is the broker's."""
    session = session_at(broker.port)
    session._connect()
    session.close()
    for line in lines:
        broker.publish(f"plant/{json.loads(line)['signal']}", line)
    broker.publish("plant/end", "")


@pytest.fixture(name="broker")
def unreliable() -> Iterator[Broker]:
    with Broker() as broker:
        yield broker


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


@pytest.mark.parametrize(("soon", "hints"), [(60.0, 1), (0.0, 0)])
def test_clients_of_one_name_are_told_of_each_other(
    monkeypatch: pytest.MonkeyPatch, broker: Broker, soon: float, hints: int
) -> None:
    """Each takes the session from the other; but not from one whose connection is lost now and then."""
    told = list[str]()
    session, other = session_at(broker.port, told.append), session_at(broker.port)
    monkeypatch.setattr("hgorun.commands.mqtt_session._SOON", soon)
    for _ in range(4):
        session._connect()
        other._connect()
        while session._client is not None:
            session._step(1.0)
        other.close()
    assert ["another client may use the id test" in one for one in told] == [False] + [True] * hints


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


def started(shell: Shell, broker: Broker, *more: str) -> subprocess.Popen[bytes]:
    """The command in a process of its own."""
    address = f"mqtt://127.0.0.1:{broker.port}/plant/+"
    words = ["estimate", "plant.yaml", address, "--checkpoint", STATE, "--publish", "estimates", *more]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen(
        [sys.executable, "-m", "hgorun", *words], cwd=shell.folder, env=environment, stderr=subprocess.DEVNULL
    )


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


class Handed:
    """A broker that has these messages, once."""

    def __init__(self, *payloads: str) -> None:
        self.left = [Message("plant/a", payload.encode(), 1, 1) for payload in payloads]

    def messages(self) -> list[Message]:
        return self.left

    def publish(self, topic: str, payloads: list[str]) -> None: ...

    def acknowledge(self, messages: list[Message]) -> None: ...


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


def test_a_broker_may_come_later_and_may_have_forgotten(shell: Shell) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    told = list[str]()
    session = session_at(port, told.append, known=True)
    session._try_to_connect()
    session._try_to_connect()
    assert [one.partition(": ")[2] for one in told] == ["[Errno 111] Connection refused; trying again"] or len(
        told
    ) == 1
    told.clear()
    with Broker(granted=0, port=port) as broker:
        session._connect()
        broker.publish("plant/a", "x")
        assert [one.payload for one in session.messages()] == [b"x"]
        session.close()
    assert "does not grant quality of service 1" in told[0]
    assert "does not know this client" in told[1]


@pytest.mark.parametrize(
    ("user", "granted", "said"), [(("a", "b"), 1, "Not authorized"), (None, 128, "subscription to plant/a")]
)
def test_a_broker_that_refuses_ends_the_command(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, user: tuple[str, str] | None, granted: int, said: str
) -> None:
    monkeypatch.setenv("HGORUN_MQTT_USER", "a")
    monkeypatch.setenv("HGORUN_MQTT_PASSWORD", "c")
    with Broker(user=user, granted=granted) as broker:
        code, out, err = shell(
            "estimate", "plant.yaml", f"mqtt://127.0.0.1:{broker.port}/plant/a", "--checkpoint", STATE
        )
    assert (code, out) == (2, "")
    assert "refuses" in err
    assert said in err
    assert "trying again" not in err


def test_credentials_are_those_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Credentials.of({"HGORUN_MQTT_USER": "a", "HGORUN_MQTT_PASSWORD": "b", "HGORUN_MQTT_KEY": ""})
    assert (found.user, found.password, found.key) == ("a", "b", None)
    assert "b" not in repr(found).split("object")[0]
    with pytest.raises(ConfigError, match="HGORUN_MQTT_CA: nowhere: there is no such file"):
        Credentials.of({"HGORUN_MQTT_CA": "nowhere"})
    with Broker(user=("a", "b")) as broker:
        session = Session(Address("127.0.0.1", broker.port, False, "t"), "c", found, lambda _: None)
        session._connect()
        session.close()


@pytest.mark.parametrize(
    ("text", "host", "port", "topic"),
    [
        ("mqtt://broker/plant/tank/+", "broker", 1883, "plant/tank/+"),
        ("mqtts://10.0.0.7/#", "10.0.0.7", 8883, "#"),
        ("mqtt://[::1]:99/a//b", "::1", 99, "a//b"),
    ],
)
def test_addresses(text: str, host: str, port: int, topic: str) -> None:
    found = Address.of(text)
    assert (found.host, found.port, found.topic, found.tls) == (host, port, topic, text.startswith("mqtts"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mqtt:/broker/a", "expected mqtt://HOST/TOPIC"),
        ("mqtt://broker", "expected mqtt://HOST/TOPIC"),
        ("mqtt:///a", "expected mqtt://HOST/TOPIC"),
        ("mqtt://broker/", "expected a topic"),
        ("mqtt://broker:99999/a", "below 65536"),
        ("mqtt://me:secret@broker/a", "HGORUN_MQTT_USER and HGORUN_MQTT_PASSWORD"),
        ("mqtt://broker/a+/b", r"\+ is a level"),
        ("mqtt://broker/#/b", "# the last one"),
    ],
)
def test_what_is_no_address(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said) as error:
        Address.of(text)
    assert "secret" not in str(error.value)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("mqtt://h/a",), "--checkpoint FILE is needed"),
        (("mqtt://h/a", "--checkpoint", STATE, "--publish", "a/#"), "name one to publish to"),
        (("mqtt://h/a", "log.csv", "--checkpoint", STATE), "no files beside it"),
        (("log.csv", "--publish", "a"), "are for streams"),
        (("-", "--client-id", "a"), "are for brokers"),
    ],
)
def test_what_does_not_go_with_a_broker(shell: Shell, words: tuple[str, ...], said: str) -> None:
    code, _, err = shell("estimate", "plant.yaml", *words)
    assert code == 2
    assert said in err


def test_what_is_missing_is_named(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hgorun.commands.mqtt.find_spec", lambda _: None)
    code, _, err = shell("estimate", "plant.yaml", "mqtt://h/a", "--checkpoint", STATE)
    assert code == 1
    assert "pip install 'hgorun[mqtt]'" in err


def test_names_at_a_broker_are_short_and_differ(tmp_path: Path) -> None:
    places = [("plant", "a", tmp_path / "x"), ("plant", "a", tmp_path / "y"), ("plant", "b", tmp_path / "x")]
    names = {client_id_of(*place) for place in places}
    assert len(names) == 3
    assert all(len(one) <= 23 and one.isalnum() for one in names)
    require_topic("a/b", wildcards=False)
