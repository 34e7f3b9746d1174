"""Sessions with a broker: addresses, names, credentials, and what ends the command."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from broker import Broker
from mqtt_follower import STATE, a_broker, plant_in, session_at
from shell import Shell

from hgorun.commands.mqtt_address import Address, Credentials, client_id_of, require_topic
from hgorun.commands.mqtt_session import Session
from hgorun.errors import ConfigError

in_folder = pytest.fixture(name="shell")(plant_in)
unreliable = pytest.fixture(name="broker")(a_broker)


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
