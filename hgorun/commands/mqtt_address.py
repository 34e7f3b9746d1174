"""Where samples are published, and who asks for them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from hgorun.config.nearest import no_file
from hgorun.errors import ConfigError

_ADDRESS = re.compile(r"(?P<scheme>mqtts?)://(?P<host>\[[^\]/]*\]|[^\[\]:/]*)(?::(?P<port>\d+))?/(?P<topic>.*)")
_SCHEME = re.compile(r"mqtts?:", re.IGNORECASE)
_PORTS = {"mqtt": 1883, "mqtts": 8883}
_LONGEST = 65_535  # bytes of a topic
_VARIABLES = {
    "user": "HGORUN_MQTT_USER",
    "password": "HGORUN_MQTT_PASSWORD",
    "authority": "HGORUN_MQTT_CA",
    "certificate": "HGORUN_MQTT_CERT",
    "key": "HGORUN_MQTT_KEY",
}


def is_address(text: str) -> bool:
    """Whether a text is meant as the address of a topic, right or wrong."""
    return _SCHEME.match(text) is not None


@dataclass(frozen=True)
class Address:
    """A topic, or several with wildcards, of a broker: ``mqtt://HOST[:PORT]/TOPIC``, or ``mqtts://`` for TLS."""

    host: str
    port: int
    tls: bool
    topic: str

    @classmethod
    def of(cls, text: str) -> Address:
        """That which is written.

        Raises
        ------
        ConfigError
            Also for an address with a password: command lines are read by others.
        """
        if "@" in text.partition("://")[2].partition("/")[0]:
            names = f"{_VARIABLES['user']} and {_VARIABLES['password']}"
            raise ConfigError(f"user and password are taken from the environment, {names}, not from the address")
        found = _ADDRESS.fullmatch(text)
        if found is None or not found["host"]:
            raise ConfigError(f"{text}: expected mqtt://HOST/TOPIC, mqtt://HOST:PORT/TOPIC or the same with mqtts://")
        port = int(found["port"] or _PORTS[found["scheme"]])
        if not 0 < port < 1 << 16:
            raise ConfigError(f"{text}: expected a port below 65536, found {port}")
        require_topic(found["topic"], wildcards=True)
        return cls(found["host"].strip("[]"), port, found["scheme"] == "mqtts", found["topic"])

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def require_topic(topic: str, *, wildcards: bool) -> None:
    """Refuse what is no topic.

    Raises
    ------
    ConfigError
    """
    levels = topic.split("/")
    if not topic or "\0" in topic or len(topic.encode(errors="replace")) > _LONGEST:
        raise ConfigError(f"expected a topic, found {topic!r:.50}")
    if not wildcards and ("+" in topic or "#" in topic):
        raise ConfigError(f"--publish {topic}: + and # stand for topics that are read; name one to publish to")
    if any(len(one) > 1 and ("+" in one or "#" in one) for one in levels) or "#" in levels[:-1]:
        raise ConfigError(f"topic {topic}: + is a level of its own, and # the last one")


@dataclass(frozen=True, repr=False)
class Credentials:
    """Who asks, and whom to trust; from the environment, for command lines are seen by others.

    Attributes
    ----------
    user, password : str or None
    authority, certificate, key : str or None
        Files: certificates of authorities (of the system where that is None), and the own certificate with its key.
    """

    user: str | None = None
    password: str | None = None
    authority: str | None = None
    certificate: str | None = None
    key: str | None = None

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> Credentials:
        """Those in ``HGORUN_MQTT_USER``, ``_PASSWORD``, ``_CA``, ``_CERT`` and ``_KEY``.

        Raises
        ------
        ConfigError
            For a file that is not there.
        """
        found = cls(**{name: environment.get(variable) or None for name, variable in _VARIABLES.items()})
        for name in ("authority", "certificate", "key"):
            file = getattr(found, name)
            if file is not None and not os.path.isfile(file):
                raise ConfigError(f"{_VARIABLES[name]}: {file}: {no_file(Path(file))}")
        return found


def client_id_of(name: str, topic: str, checkpoint: Path) -> str:
    """A name under which a broker knows this stream again after a restart, and no other.

    At most 23 bytes of letters and digits: more is not taken by every broker.
    """
    place = f"{name}\n{topic}\n{checkpoint.absolute()}"
    return f"hgorun{sha256(place.encode(errors='surrogateescape')).hexdigest()[:16]}"
