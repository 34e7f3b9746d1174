"""A broker that speaks enough of MQTT 3.1.1 to be unreliable: it can be cut off, or do something, at any packet."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

CONNECT, CONNACK, PUBLISH, PUBACK, SUBSCRIBE, SUBACK, PINGREQ, PINGRESP, DISCONNECT = 1, 2, 3, 4, 8, 9, 12, 13, 14


@dataclass
class Session:
    """What is kept of a client while it is away."""

    topics: list[str] = field(default_factory=list)
    sent: OrderedDict[int, tuple[str, bytes]] = field(default_factory=OrderedDict)  # and not acknowledged
    waiting: deque[tuple[str, bytes]] = field(default_factory=deque)
    connection: Connection | None = None
    number: int = 0


class Broker:
    """Listens at a port of its own on this machine; to be used in a ``with`` statement.

    Attributes
    ----------
    received : list of (topic, payload)
        All that clients have published, in its order.
    at : mapping of int to callable
        What is done before the packet with a number, counted over all connections and both directions, is read or
        written; a ``ConnectionError`` cuts that connection before the packet.
    """

    def __init__(
        self, *, port: int = 0, window: int = 5, user: tuple[str, str] | None = None, granted: int = 1
    ) -> None:
        self.received: list[tuple[str, str]] = []
        self.at: dict[int, Callable[[], None]] = {}
        self.packets = self.connections = 0
        self.sessions: dict[str, Session] = {}
        self.window, self.user, self.granted = window, user, granted
        self.changed = threading.Condition(threading.RLock())
        self._listening = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listening.getsockname()[1]

    def __enter__(self) -> Broker:
        threading.Thread(target=self._listen, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.cut()

    def cut(self) -> None:
        """Cut all connections."""
        with self.changed:
            for session in self.sessions.values():
                if session.connection is not None:
                    session.connection.cut()

    def publish(self, topic: str, payload: str | bytes) -> None:
        """Send a message to all sessions that have asked for it."""
        with self.changed:
            for session in self.sessions.values():
                if any(matches(one, topic) for one in session.topics):
                    session.waiting.append((topic, payload.encode() if isinstance(payload, str) else payload))
                    self.send_waiting(session)

    def send_waiting(self, session: Session) -> None:
        """Send as many messages as may be on their way at once."""
        while session.connection is not None and session.waiting and len(session.sent) < self.window:
            session.number = session.number % 65535 + 1
            session.sent[session.number] = session.waiting.popleft()
            session.connection.send_message(session.number, *session.sent[session.number], again=False)

    def wait_until(self, condition: Callable[[], bool], seconds: float = 30.0) -> None:
        """Wait for something that follows from packets."""
        until = time.monotonic() + seconds
        with self.changed:
            while not condition():
                assert time.monotonic() < until, "the broker has waited in vain"
                self.changed.wait(0.05)

    @property
    def unacknowledged(self) -> int:
        """How many messages clients have not acknowledged."""
        return sum(len(one.sent) + len(one.waiting) for one in self.sessions.values())

    def count(self) -> None:
        """A packet is about to be read or written."""
        self.packets += 1
        action = self.at.pop(self.packets, None)
        if action is not None:
            action()

    def _listen(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._listening.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=Connection(self, connection).serve, daemon=True).start()


class Connection:
    """A connection of a client."""

    def __init__(self, broker: Broker, stream: socket.socket) -> None:
        self.broker, self.stream, self.session = broker, stream, Session()

    def cut(self) -> None:
        """End it without a word."""
        if self.session.connection is self:
            self.session.connection = None
        with suppress(OSError):
            self.stream.shutdown(socket.SHUT_RDWR)
        self.stream.close()

    def serve(self) -> None:
        """Answer packets until the connection ends."""
        broker = self.broker
        try:
            while True:
                head = self._read(1)[0]
                size, place = 0, 0
                while (byte := self._read(1)[0]) & 128:
                    size, place = size | (byte & 127) << place, place + 7
                body = self._read(size | byte << place)
                with broker.changed:
                    broker.count()
                    self._answer(head >> 4, head & 15, body)
                    broker.changed.notify_all()
        except OSError:
            pass
        finally:
            with broker.changed:
                self.cut()
                broker.changed.notify_all()

    def _read(self, size: int) -> bytes:
        found = b""
        while len(found) < size:
            part = self.stream.recv(size - len(found))
            if not part:
                raise ConnectionError
            found += part
        return found

    def _send(self, head: int, body: bytes) -> None:
        self.broker.count()
        length, size = b"", len(body)
        while size > 127:
            length, size = length + bytes([size & 127 | 128]), size >> 7
        self.stream.sendall(bytes([head]) + length + bytes([size]) + body)

    def _answer(self, kind: int, flags: int, body: bytes) -> None:
        if kind == CONNECT:
            self._welcome(body)
        elif kind == SUBSCRIBE:
            topic, _ = text_of(body[2:])
            if topic not in self.session.topics:
                self.session.topics.append(topic)
            self._send(SUBACK << 4, body[:2] + bytes([self.broker.granted]))
        elif kind == PUBLISH:
            topic, rest = text_of(body)
            qos = flags >> 1 & 3
            number, payload = (rest[:2], rest[2:]) if qos else (b"", rest)
            self.broker.received.append((topic, payload.decode()))
            self.broker.publish(topic, payload)
            if qos:
                self._send(PUBACK << 4, number)
        elif kind == PUBACK:
            self.session.sent.pop(struct.unpack(">H", body)[0], None)
            self.broker.send_waiting(self.session)
        elif kind == PINGREQ:
            self._send(PINGRESP << 4, b"")
        elif kind == DISCONNECT:
            raise ConnectionError

    def _welcome(self, body: bytes) -> None:
        """Let a client in, and send again what it has not acknowledged."""
        broker = self.broker
        name, rest = text_of(body)
        assert (name, rest[0]) == ("MQTT", 4)
        flags, rest = rest[1], rest[4:]
        client, rest = text_of(rest)
        user, rest = text_of(rest) if flags & 128 else ("", rest)
        password, rest = text_of(rest) if flags & 64 else ("", rest)
        if broker.user is not None and broker.user != (user, password):
            self._send(CONNACK << 4, b"\0\5")
            raise ConnectionError
        broker.connections += 1
        known = client in broker.sessions and not flags & 2
        if not known:
            broker.sessions[client] = Session()
        self.session = broker.sessions[client]
        if self.session.connection is not None:
            self.session.connection.cut()
        self.session.connection = self
        self._send(CONNACK << 4, bytes([known, 0]))
        for number, message in self.session.sent.items():
            self.send_message(number, *message, again=True)
        broker.send_waiting(self.session)

    def send_message(self, number: int, topic: str, payload: bytes, *, again: bool) -> None:
        """Send a message, with quality of service 1."""
        name = topic.encode()
        body = struct.pack(">H", len(name)) + name + struct.pack(">H", number) + payload
        try:
            self._send(PUBLISH << 4 | again << 3 | 2, body)
        except OSError:
            self.cut()


def text_of(body: bytes) -> tuple[str, bytes]:
    """A text that stands at the beginning, and what follows."""
    size = struct.unpack(">H", body[:2])[0]
    return body[2 : 2 + size].decode(), body[2 + size :]


def matches(asked: str, topic: str) -> bool:
    """Whether a topic is one of those that are asked for."""
    one, two = asked.split("/"), topic.split("/")
    if one[-1] == "#":
        one, two = one[:-1], two[: len(one) - 1]
    return len(one) == len(two) and all(a in ("+", b) for a, b in zip(one, two, strict=True))
