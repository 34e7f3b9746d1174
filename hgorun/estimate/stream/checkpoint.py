"""The state of an estimator as bytes."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from hgorun.engine.plan import Floats
from hgorun.errors import ConfigError, HgorunError
from hgorun.estimate.stream.event import Event

Settings: TypeAlias = Mapping[str, Mapping[str, float] | list[str]]
"""What an estimator was made with beside its configuration, by the names of its arguments."""

_MAGIC = b"hgorun-estimator-1\n"
_END = 22  # bytes of the last record of an archive without a comment


@dataclass(frozen=True, eq=False, repr=False)
class Checkpoint:
    """What an estimator goes on from.

    Attributes
    ----------
    numbers : mapping of str to ndarray
        Of the run, by name: a row of what they are now, then one of what they were before each of the events.
    notes : sequence of sequence
        What is known beside them, as JSON has it.
    events : sequence of Event
        What is remembered for samples that come late.
    """

    numbers: Mapping[str, Floats]
    notes: Sequence[Sequence[Any]]
    events: Sequence[Event]

    def written(self, identity: str, settings: Settings) -> bytes:
        """As bytes; ``identity`` and ``settings`` are what it is of."""
        file = io.BytesIO()
        np.savez(file, **self.numbers)  # type: ignore[arg-type]  # an array is no flag, however it is called
        now, *before = (json.dumps(notes) for notes in self.notes)
        notes = json.dumps([now, before, [one.told() for one in self.events]]).encode()
        head = json.dumps({"of": identity, "notes": len(notes), **settings}).encode()
        return _MAGIC + head + b"\n" + notes + file.getvalue()

    @classmethod
    def read(cls, data: bytes | bytearray, identity: str, settings: Settings) -> Checkpoint:
        """From what :meth:`written` gave.

        Raises
        ------
        ConfigError
            When it is no checkpoint, one of something else or with other settings, or damaged.
        """
        if not data.startswith(_MAGIC):
            raise ConfigError("this is not a checkpoint of an estimator, or one of another version")
        try:
            head, rest = data[len(_MAGIC) :].split(b"\n", 1)
            told = json.loads(head)
            others = {name: told.get(name, wanted) for name, wanted in settings.items()}  # older ones do not tell
            others = {name: found for name, found in others.items() if found != settings[name]}
            another = told["of"] != identity and others.keys() <= {"gates"}  # it follows from the others
            if another and not others:
                raise ConfigError("the checkpoint is of another configuration, or one of another version of hgorun")
            for name, found in others.items():
                raise ConfigError(
                    f"the checkpoint was made with {name} {_said(found)}, and this estimator has "
                    f"{_said(settings[name])}: give it the same {name}, or begin anew"
                    + ("; it is of another configuration" if another else "")
                )
            if not rest[-_END:].startswith(b"PK\x05\x06"):  # the archive of the numbers is read without it
                raise ValueError("it does not end where its numbers end")
            size = int(told["notes"])
            with np.load(io.BytesIO(rest[size:]), allow_pickle=False) as arrays:
                numbers = {name: np.array(arrays[name], dtype=float) for name in arrays.files}
            now, before, events = json.loads(rest[:size])
            return cls(numbers, [json.loads(notes) for notes in (now, *before)], [Event.of(one) for one in events])
        except HgorunError:
            raise
        except Exception as error:
            raise damaged(error) from error


def _said(setting: Mapping[str, float] | Sequence[str]) -> str:
    parts = [f"{name}: {value:g}" for name, value in setting.items()] if isinstance(setting, Mapping) else setting
    return "{" + ", ".join(parts) + "}"


def damaged(error: Exception) -> ConfigError:
    """Of a checkpoint that looks like one."""
    return ConfigError(f"the checkpoint is damaged: {error}")
