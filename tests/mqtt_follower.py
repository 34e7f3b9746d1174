"""What follows a topic in tests: a plant, its samples, and sessions with a broker that end when they are to."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from broker import Broker
from shell import Shell

from hgorun.commands.mqtt import Follower
from hgorun.commands.mqtt_address import Address, Credentials
from hgorun.commands.mqtt_session import Message, Session
from hgorun.commands.run_options import Estimate
from hgorun.commands.stream_samples import Stream
from hgorun.config.reading import read_source

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


def plant_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """A folder with a plant: a fixture of each file."""
    (tmp_path / "plant.yaml").write_text(CONFIG)
    return Shell(tmp_path, monkeypatch, capsys)


def a_broker() -> Iterator[Broker]:
    """Another one."""
    with Broker() as broker:
        yield broker


class Killed(BaseException):
    """The process is gone."""


class Ended(Exception):
    """The last message has been acknowledged."""


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
        broker.publish(f"plant/{json.loads(line.partition(chr(10))[0])['signal']}", line)
    broker.publish("plant/end", "")


class Handed:
    """A broker that has these messages, once."""

    def __init__(self, *payloads: str) -> None:
        self.left = [Message("plant/a", payload.encode(), 1, 1) for payload in payloads]

    def messages(self) -> list[Message]:
        return self.left

    def publish(self, topic: str, payloads: list[str]) -> None: ...

    def acknowledge(self, messages: list[Message]) -> None: ...
