"""A session with an MQTT broker that outlasts connections: messages in their order, acknowledged by hand."""

from __future__ import annotations

import math
import socket
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hgorun.commands.mqtt_address import Address, Credentials
from hgorun.errors import ConfigError

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage, SocketLike

KEEPALIVE = 30
"""Seconds after which a broker that is not heard is taken to be gone."""

_FIRST_PAUSE, _LONGEST_PAUSE = 0.1, 60.0  # seconds between attempts to connect
_MOST = 1000  # messages that are taken together
_QOS = 1
_SOON, _AGAIN = 5.0, 3  # seconds in which a connection is lost, and times in a row, that hint at another client
_BUSY = 136  # a broker that cannot be used now; other refusals are for good


@dataclass(frozen=True, eq=False)
class Message:
    """What was published to a topic.

    Attributes
    ----------
    topic : str
    payload : bytes
    number : int
        Of the message in its connection; 0 where nothing is to be acknowledged.
    connection : int
        In which it came: its number means something else in another one.
    """

    topic: str
    payload: bytes
    number: int
    connection: int


class Session:
    """Subscribes to a topic, publishes to another, and connects again whenever the connection is lost.

    The broker keeps the session while there is no connection (MQTT 3.1.1, ``clean_session`` false, quality of service
    1), and sends again, in their order, all messages that have not been acknowledged. Each connection has a client of
    its own: what is sent again is decided here alone. Nothing runs in the background.

    Parameters
    ----------
    address : Address
    client_id : str
        By which the broker knows the session.
    credentials : Credentials
    tell : callable
        Is told what the person at the terminal should know.
    known : bool
        Whether the session is thought to exist already.
    """

    def __init__(
        self,
        address: Address,
        client_id: str,
        credentials: Credentials,
        tell: Callable[[str], None],
        *,
        known: bool = False,
    ) -> None:
        self._address, self._id, self._credentials, self._tell = address, client_id, credentials, tell
        self._known, self._told_of_loss, self._pause = known, False, _FIRST_PAUSE
        self._client: Client | None = None
        self._connection = 0
        self._welcomed = math.nan  # when the broker has taken the client that stands
        self._soon_lost = 0  # connections in a row
        self._inbox: list[Message] = []
        self._unpublished: set[int] = set()
        self._subscribed: list[bool] = []  # in this connection: whether with the quality of service asked for
        self._present: bool | None = None  # whether the broker knew the session; None before it has answered
        self._refusal: tuple[int, str] | None = None

    def messages(self) -> list[Message]:
        """Those that have come; waits for the first one."""
        while not self._inbox:
            self._connect()
            if not self._inbox:  # messages of a known session come before its subscription is confirmed
                self._step(1.0)
        while self._client is not None and len(self._inbox) < _MOST:
            before = len(self._inbox)
            self._step(0.0)
            if len(self._inbox) <= before:
                break
        found, self._inbox = self._inbox[:_MOST], self._inbox[_MOST:]
        return found

    def publish(self, topic: str, payloads: Sequence[str]) -> None:
        """Publish some messages in their order; returns when the broker has acknowledged each."""
        left = list(payloads)
        while left:
            client, connection = self._connect(), self._connection
            numbers = [client.publish(topic, text, qos=_QOS).mid for text in left]
            self._unpublished = set(numbers)
            while self._unpublished and self._client is not None and connection == self._connection:
                self._step(1.0)
            # in order: what lies behind one that has not been acknowledged is published again
            first = next((k for k, number in enumerate(numbers) if number in self._unpublished), len(numbers))
            left = left[first:]

    def acknowledge(self, messages: Sequence[Message]) -> None:
        """Tell the broker that messages need not be sent again; not those of an earlier connection, which will be."""
        for one in messages:
            if one.number and one.connection == self._connection and self._client is not None:
                self._client.ack(one.number, _QOS)
        self._pause, self._told_of_loss = _FIRST_PAUSE, False

    def close(self) -> None:
        """Leave; the broker keeps the session."""
        if self._client is not None:
            self._client.disconnect()
            self._client = None

    def _connect(self) -> Client:
        """The client of a connection that stands, with the topic subscribed to."""
        while self._client is None:
            self._try_to_connect()
            if self._client is None:
                clock.sleep(self._pause)
                self._pause = min(2 * self._pause, _LONGEST_PAUSE)
        return self._client

    def _try_to_connect(self) -> None:
        client = self._new_client()
        self._inbox, self._subscribed, self._present, self._refusal = [], [], None, None
        self._connection += 1
        try:
            client.connect(self._address.host, self._address.port, KEEPALIVE)
        except (OSError, ValueError) as error:  # an unknown host, TLS, no answer
            self._lose(str(error))
            return
        self._client = client
        until = clock.monotonic() + KEEPALIVE
        while self._client is not None and not self._subscribed:
            self._step(1.0)
            if clock.monotonic() > until:
                self.close()
                self._lose("no answer")
        self._require_welcome()

    def _require_welcome(self) -> None:
        """Go on only where the broker has taken the client and the subscription.

        Raises
        ------
        ConfigError
        """
        if self._refusal is not None and self._refusal[0] != _BUSY:
            self.close()
            raise ConfigError(f"the broker {self._address} refuses: {self._refusal[1]}")
        if self._client is None:
            self._refusal = None
            self._lose("it is busy")
            return
        if not self._subscribed[0]:
            self._tell(f"{self._address} does not grant quality of service 1: what gets lost is not sent again")
        if self._known and self._present is False:
            self._tell(f"{self._address} does not know this client any more: what was published meanwhile may be lost")
        self._known = True

    def _new_client(self) -> Client:
        from paho.mqtt.client import Client, MQTTv311
        from paho.mqtt.enums import CallbackAPIVersion

        client = Client(
            CallbackAPIVersion.VERSION2,
            client_id=self._id,
            clean_session=False,
            protocol=MQTTv311,
            manual_ack=True,
            reconnect_on_failure=False,
        )
        one = self._credentials
        if one.user is not None or one.password is not None:
            client.username_pw_set(one.user or "", one.password)
        if self._address.tls:
            client.tls_set(ca_certs=one.authority, certfile=one.certificate, keyfile=one.key)

        def on_connect(client: Client, _: object, flags: Any, reason: Any, _more: object) -> None:
            if reason.is_failure:
                self._refusal = (reason.value, str(reason))
            else:
                self._present, self._welcomed = flags.session_present, clock.monotonic()
                client.subscribe(self._address.topic, qos=_QOS)

        def on_subscribe(_client: Client, _: object, _number: int, granted: list[Any], _more: object) -> None:
            if granted[0].is_failure:
                self._refusal = (granted[0].value, f"subscription to {self._address.topic}: {granted[0]}")
            self._subscribed.append(granted[0].value == _QOS)

        def on_message(_client: Client, _: object, message: MQTTMessage) -> None:
            number = message.mid if message.qos else 0
            self._inbox.append(Message(message.topic, bytes(message.payload), number, self._connection))

        def on_publish(_client: Client, _: object, number: int, _reason: object, _more: object) -> None:
            self._unpublished.discard(number)

        def on_socket_open(_client: Client, _: object, opened: SocketLike) -> None:
            if isinstance(opened, socket.socket):  # acknowledgements are small, and not to be held back
                opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        client.on_socket_open = on_socket_open
        client.on_connect, client.on_subscribe = on_connect, on_subscribe
        client.on_message, client.on_publish = on_message, on_publish
        return client

    def _step(self, seconds: float) -> None:
        """Send and receive what there is; wait so long for it."""
        if self._client is not None and self._client.loop(seconds):
            self._lose("the connection is lost")

    def _lose(self, why: str) -> None:
        self._client, self._inbox = None, []  # what has not been taken will come again
        if self._refusal is None and not self._told_of_loss:
            self._tell(f"{self._address}: {why}; trying again")
            self._told_of_loss = True
        lasted, self._welcomed = clock.monotonic() - self._welcomed, math.nan
        if not math.isnan(lasted):  # it stood
            self._soon_lost = self._soon_lost + 1 if lasted < _SOON else 0
            if self._soon_lost == _AGAIN:
                self._tell(
                    f"{self._address}: the connection was lost {_AGAIN} times soon after it was made: another client "
                    f"may use the id {self._id}; each needs its own, see --client-id"
                )
