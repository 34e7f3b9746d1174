"""What a page shows: values of knobs, observers that are left out. It has a history, and it is an address."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl, urlencode

from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError
from hgorun.explore.knobs import Knob
from hgorun.explore.target import Plain

OFF = "off"
_MOST_STEPS = 500  # that can be undone


@dataclass(frozen=True)
class State:
    """What differs from the file.

    Attributes
    ----------
    values : mapping of str to float
        Of knobs by their names, where they are not the file's.
    off : frozenset of str
        Labels of the observers that are left out.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    off: frozenset[str] = frozenset()

    def with_value(self, knob: Knob, value: object) -> State:
        """The same, but for one knob.

        Raises
        ------
        ConfigError
            When the value is no number that the knob can have.
        """
        found = knob.checked(value)
        others = {name: own for name, own in self.values.items() if name != knob.name}
        return replace(self, values=others if found == knob.start else {**others, knob.name: found})

    def with_observer(self, label: str, *, on: bool) -> State:
        """The same with or without an observer."""
        return replace(self, off=self.off - {label} if on else self.off | {label})

    def changes(self, knobs: Mapping[str, Knob]) -> dict[str, Plain]:
        """What the configuration has by path; None where something is left out."""
        found: dict[str, Plain] = {}
        for name, value in self.values.items():
            if knobs[name].group not in self.off:
                found |= knobs[name].changes(value, found)
        return found | {f"observers.{label}": None for label in sorted(self.off)}

    def query(self) -> str:
        """The part of an address behind the question mark; numbers have all their digits."""
        pairs = [(name, repr(value)) for name, value in sorted(self.values.items())]
        return urlencode([*pairs, *((OFF, label) for label in sorted(self.off))])


def from_query(query: str, knobs: Mapping[str, Knob], labels: Iterable[str]) -> State:
    """The state that an address stands for; names that begin with ``bokeh-`` are not ours.

    Raises
    ------
    ConfigError
        For a name or a value that is not one of the configuration's.
    """
    state, known = State(), tuple(labels)
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name == OFF:
            if value not in known:
                raise ConfigError(f"no observer is called {value[:40]!r}.{nearest(value, known)}", key=OFF)
            state = state.with_observer(value, on=False)
        elif name in knobs:
            state = state.with_value(knobs[name], value)
        elif not name.startswith("bokeh-"):
            raise ConfigError(f"nothing here is called {name[:40]!r}.{nearest(name, knobs)}", key="address")
    return state


@dataclass(frozen=True)
class History:
    """States one after the other: what is shown, what was before, and what has been undone.

    Attributes
    ----------
    past, future : tuple of State
        The latest of the past last, the next of the future first.
    present : State
        What the last finished step has made.
    preview : State or None
        What is shown while a slider is still held.
    """

    present: State
    past: tuple[State, ...] = ()
    future: tuple[State, ...] = ()
    preview: State | None = None

    @property
    def shown(self) -> State:
        return self.present if self.preview is None else self.preview

    def previewed(self, state: State) -> History:
        """Show a state that is no step yet."""
        return replace(self, preview=state)

    def stepped(self, state: State) -> History:
        """A finished step; what had been undone is forgotten. The same state again is no step."""
        if state == self.present:
            return replace(self, preview=None)
        return History(state, (*self.past, self.present)[-_MOST_STEPS:])

    def undone(self) -> History:
        """One step back, where there is one."""
        if not self.past:
            return replace(self, preview=None)
        return History(self.past[-1], self.past[:-1], (self.present, *self.future))

    def redone(self) -> History:
        """One step forward again, where there is one."""
        if not self.future:
            return replace(self, preview=None)
        return History(self.future[0], (*self.past, self.present), self.future[1:])
