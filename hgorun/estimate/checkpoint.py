"""The state of an estimator as bytes."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hgorun.engine.plan import Floats
from hgorun.errors import ConfigError, HgorunError
from hgorun.estimate.event import Event

_MAGIC = b"hgorun-estimator-1\n"


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

    def written(self, identity: str, gates: Mapping[str, float]) -> bytes:
        """As bytes; ``identity`` is what it is of, and ``gates`` are those that judged its samples."""
        file = io.BytesIO()
        np.savez(file, **self.numbers)  # type: ignore[arg-type]  # an array is no flag, however it is called
        now, *before = (json.dumps(notes) for notes in self.notes)
        notes = json.dumps([now, before, [one.told() for one in self.events]]).encode()
        head = json.dumps({"of": identity, "notes": len(notes), "gates": dict(sorted(gates.items()))}).encode()
        return _MAGIC + head + b"\n" + notes + file.getvalue()

    @classmethod
    def read(cls, data: bytes | bytearray, identity: str, gates: Mapping[str, float]) -> Checkpoint:
        """From what :meth:`written` gave.

        Raises
        ------
        ConfigError
            When it is no checkpoint, one of something else or with other gates, or damaged.
        """
        if not data.startswith(_MAGIC):
            raise ConfigError("this is not a checkpoint of an estimator, or one of another version")
        try:
            head, rest = data[len(_MAGIC) :].split(b"\n", 1)
            told = json.loads(head)
            if told["of"] != identity:
                raise ConfigError("the checkpoint is of another configuration")
            judged = told.get("gates", gates)  # older ones do not tell
            if judged != gates:
                raise ConfigError(
                    f"the checkpoint was made with gates {_said(judged)}, and this estimator has {_said(gates)}: "
                    "give it the same gates, or begin anew"
                )
            size = int(told["notes"])
            with np.load(io.BytesIO(rest[size:]), allow_pickle=False) as arrays:
                numbers = {name: np.array(arrays[name], dtype=float) for name in arrays.files}
            now, before, events = json.loads(rest[:size])
            return cls(numbers, [json.loads(notes) for notes in (now, *before)], [Event.of(one) for one in events])
        except HgorunError:
            raise
        except Exception as error:
            raise damaged(error) from error


def _said(gates: Mapping[str, float]) -> str:
    return "{" + ", ".join([f"{name}: {value:g}" for name, value in gates.items()]) + "}"


def damaged(error: Exception) -> ConfigError:
    """Of a checkpoint that looks like one."""
    return ConfigError(f"the checkpoint is damaged: {error}")
