"""``estimate CONFIG mqtt://HOST/TOPIC``: samples from a broker, estimates to standard output or to a broker."""

from __future__ import annotations

import io
import math
import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from typing import NoReturn, Protocol

from hgorun.commands.held import held_alone
from hgorun.commands.mqtt_address import Address, Credentials, client_id_of, require_topic
from hgorun.commands.mqtt_session import Message, Session
from hgorun.commands.outputs import NOT_OK
from hgorun.commands.run_options import Estimate
from hgorun.commands.stream_clock import AGAIN, UTC
from hgorun.commands.stream_lines import INPUT, Block, JsonForm, Sample
from hgorun.commands.stream_progress import Redelivered
from hgorun.commands.stream_samples import (
    REMEMBERED,
    OneByOne,
    Stream,
    Writer,
    refuse_results,
    tell_left_out,
)
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError, HgorunError, printable
from hgorun.process import end_with, say

_TOLD = 20  # messages that are left out and told; of more it is known that there are more
_STEADY, _FAR = 10, 100.0  # steps of time without a jump, and how often the longest of them a jump is at least


class Broker(Protocol):
    """What is asked of a session; see :class:`~hgorun.commands.mqtt_session.Session`."""

    def messages(self) -> list[Message]: ...

    def publish(self, topic: str, payloads: list[str]) -> None: ...

    def acknowledge(self, messages: list[Message]) -> None: ...


def follow_topic(source: Source, name: str, options: Estimate) -> int:
    """Follow a topic until the process is ended; with ``strict`` its exit code says whether all has been well."""
    refuse_results(options)
    if find_spec("paho") is None:
        raise HgorunError("MQTT needs the package paho-mqtt: pip install 'hgorun[mqtt]'")
    address = Address.of(options.data[0])
    if options.checkpoint is None:
        raise ConfigError("with mqtt:// --checkpoint FILE is needed: what has been acknowledged is kept there")
    if options.publish is not None:
        require_topic(options.publish, wildcards=False)
    credentials = Credentials.of(os.environ)
    client_id = options.client_id or client_id_of(name, address.topic, options.checkpoint)
    with held_alone(options.checkpoint):
        session = Session(address, client_id, credentials, _tell, known=os.path.exists(options.checkpoint))
        return _follow_for_ever(session, Stream.of(source, name), options)


def _follow_for_ever(session: Session, stream: Stream, options: Estimate) -> NoReturn:
    stream.tell_what_is_ignored()
    stream.check_lateness()
    follower = Follower.of(stream, options)
    try:
        while True:
            follower.take_some(session)
    except (KeyboardInterrupt, SystemExit):  # a topic has no other end
        if options.strict and not follower.one_by_one.all_ok:
            end_with(NOT_OK)
        raise
    finally:
        tell_left_out(follower.one_by_one, stream)
        with suppress(OSError):
            session.close()


@dataclass(frozen=True, eq=False, repr=False)
class Follower:
    """Takes messages, and acknowledges them when what follows from them is told and kept.

    A process that ends at any moment, and begins again with its checkpoint, gets the messages once more that it has not
    acknowledged. What it had estimated from them and not kept it estimates again, with the same bits; those that it had
    kept it knows.

    Attributes
    ----------
    one_by_one : OneByOne
    progress : Redelivered
    lines : StringIO
        What is to be told.
    topic : str or None
        Where that is published; None for standard output.
    told : list of str
        What has been said of messages that were left out.
    pace : _Pace
        Of the samples.
    """

    one_by_one: OneByOne
    progress: Redelivered
    lines: io.StringIO
    topic: str | None
    told: list[str]
    pace: _Pace

    @classmethod
    def of(cls, stream: Stream, options: Estimate) -> Follower:
        """One that goes on from the checkpoint, if there is one."""
        remembered = options.remembered or REMEMBERED
        estimator, lines = stream.estimator(remembered=remembered), io.StringIO()
        progress = Redelivered(estimator, options.checkpoint, 2 * max(remembered, REMEMBERED), stream.unit)
        writer = Writer(lines, estimator, as_json=True)
        one_by_one = OneByOne.of(stream, estimator, options.every, progress, writer)
        return cls(one_by_one, progress, lines, options.publish, [], _Pace())

    def take_some(self, broker: Broker) -> None:
        """Take those messages that are there, or the next one."""
        messages = broker.messages()
        for message in messages:
            self._take(message)
        lines = self.lines.getvalue()
        self.lines.seek(0)
        self.lines.truncate()
        if self.topic is None:
            sys.stdout.write(lines)
        else:
            broker.publish(self.topic, lines.splitlines())
        self.progress.save()
        broker.acknowledge(messages)

    def _take(self, message: Message) -> None:
        """Take all samples of a message, or none where a line cannot be read; one that is refused is left out alone."""
        what = "a message"
        try:
            samples = self._samples(message)
            for sample in samples:
                if len(samples) > 1:
                    what = f"the sample in line {sample.line} of a message"
                try:
                    self._take_in_time(sample, message.topic)
                except ConfigError as error:
                    self.progress.refused(sample)
                    why = error.message if error.file == INPUT else str(error)
                    self._tell(f"{message.topic}: {what} is left out: {why}")
        except ConfigError as error:
            line = "" if error.line in (None, 1) else f"line {error.line}: "
            self._tell(f"{message.topic}: a message is left out: {line}{error.message}")

    def _take_in_time(self, sample: Sample, topic: str) -> None:
        """Take a sample that has not been taken, as a late one if it is of before the time that has been reached."""
        if self.progress.knows(sample):
            return
        reached, known_at = self.progress.t, sample.t if sample.available is None else sample.available
        if known_at < sample.t:
            raise ConfigError(f"taken at {sample.t:g}, after it was known at {known_at:g}")
        self._require_another_hour(sample, topic)
        self.one_by_one.take(sample if known_at >= reached else sample._replace(available=reached))
        if self.pace.jumps(known_at - reached):
            self._tell(
                f"{topic}: t = {known_at:g} is far ahead of {reached:g}, the time before: all samples of times between "
                "them are late from now on"
            )

    def _require_another_hour(self, sample: Sample, topic: str) -> None:
        """Refuse a sample of an hour that clocks show again; where its night is not known, only tell of it.

        Raises
        ------
        ConfigError
        """
        clock, again = self.progress.clock, AGAIN.format(sample.signal)
        back = clock.back(sample.signal, sample.t)
        if back == "night":
            until = f"samples up to t = {clock.until(sample.signal):.10g} are left out"
            raise ConfigError(f"{again} in this night: {until}; {UTC}")
        if back == "hour":
            self._tell(f"{topic}: t = {sample.t:g}: {again}, and count as those of late samples: if it is that, {UTC}")

    def _samples(self, message: Message) -> list[Sample]:
        """The samples of a message.

        Raises
        ------
        ConfigError
        """
        try:
            lines = message.payload.decode("utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise ConfigError(f"not UTF-8: {error.reason}") from None
        samples = list(JsonForm(message.topic.rpartition("/")[2]).samples(Block(1, lines)))
        for sample in samples:
            if sample.signal not in self.one_by_one.estimator.kinds:
                known = ", ".join(self.one_by_one.estimator.kinds)
                raise ConfigError(f"the signal {sample.signal!r:.50} is none of {known}", line=sample.line)
        return samples

    def _tell(self, text: str) -> None:
        if len(self.told) < _TOLD and text not in self.told:
            self.told.append(text)
            _tell(text)
            if len(self.told) == _TOLD:
                _tell("further messages that are left out are not told")


class _Pace:
    """How time goes on from sample to sample."""

    def __init__(self) -> None:
        self._longest, self._count = 0.0, 0

    def jumps(self, step: float) -> bool:
        """Whether a step of time is far longer than all before it."""
        if not 0.0 < step < math.inf:
            return False
        self._count += 1
        far = self._count > _STEADY and step > _FAR * self._longest
        self._longest = max(self._longest, step)
        return far


def _tell(text: str) -> None:
    say(f"hgorun: {printable(text)}")
