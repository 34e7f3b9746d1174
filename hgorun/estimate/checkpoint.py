"""The state of an estimator as bytes."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.engine.plan import Floats
from hgorun.errors import ConfigError, HgorunError
from hgorun.estimate.event import Event
from hgorun.estimate.following import State

_MAGIC = b"hgorun-estimator-1\n"


@dataclass(frozen=True, eq=False, repr=False)
class Checkpoint:
    """What an estimator goes on from.

    Attributes
    ----------
    now : State
        Of the run.
    before : sequence of State
        Before each of the events.
    events : sequence of Event
        What is remembered for samples that come late.
    """

    now: State
    before: Sequence[State]
    events: Sequence[Event]

    def written(self, identity: str) -> bytes:
        """As bytes; ``identity`` is what it is of."""
        every = [self.now, *self.before]
        file = io.BytesIO()
        arrays: dict[str, Any] = {name: np.stack([state[name] for state, _ in every]) for name in self.now[0]}
        np.savez(file, **arrays)
        now, *before = (json.dumps(notes) for _, notes in every)
        notes = json.dumps([now, before, [one.told() for one in self.events]]).encode()
        head = json.dumps({"of": identity, "notes": len(notes)}).encode()
        return _MAGIC + head + b"\n" + notes + file.getvalue()

    @classmethod
    def read(cls, data: bytes | bytearray, identity: str) -> Checkpoint:
        """From what :meth:`written` gave.

        Raises
        ------
        ConfigError
            When it is no checkpoint, one of something else, or damaged.
        """
        if not data.startswith(_MAGIC):
            raise ConfigError("this is not a checkpoint of an estimator, or one of another version")
        try:
            head, rest = data[len(_MAGIC) :].split(b"\n", 1)
            told = json.loads(head)
            if told["of"] != identity:
                raise ConfigError("the checkpoint is of another configuration")
            size = int(told["notes"])
            with np.load(io.BytesIO(rest[size:]), allow_pickle=False) as arrays:
                states = {name: np.array(arrays[name], dtype=float) for name in arrays.files}
            now, before, events = json.loads(rest[:size])
            every = [_state(states, k, notes) for k, notes in enumerate([now, *before])]
            return cls(every[0], every[1:], [Event.of(one) for one in events])
        except HgorunError:
            raise
        except Exception as error:
            raise damaged(error) from error


def damaged(error: Exception) -> ConfigError:
    """Of a checkpoint that looks like one."""
    return ConfigError(f"the checkpoint is damaged: {error}")


def _state(states: dict[str, Floats], k: int, notes: str) -> State:
    return {name: values[k] for name, values in states.items()}, json.loads(notes)
