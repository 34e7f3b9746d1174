"""One open page: what it asks for, what is computed of that, and what it is told."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError, HgorunError
from hgorun.explore.bench import Bench, Shown
from hgorun.explore.keeping import Keeper, command
from hgorun.explore.picture import Bound, Picture, bounds_of, picture_of
from hgorun.explore.promises import LATER as SLOW
from hgorun.explore.promises import Promise
from hgorun.explore.state import History, State
from hgorun.explore.telling import Page, Theory, Told, told_of_limits, told_of_picture, told_of_theories
from hgorun.explore.worker import AT_ONCE, LATER, SOON, Job, Worker

_OUR_FAULT = "this could not be computed, by a fault of hgorun that the terminal shows: the values before are shown"


class Superseded(Exception):
    """What is being computed is no longer wanted."""


@dataclass(eq=False)
class Session:
    """One open page.

    Parameters
    ----------
    bench : Bench
    keeper : Keeper
    worker : Worker
    post : callable
        Has a function called by the server's thread.
    page : Page
    query : str
        Of the address that it was opened with.
    patience : float
        Seconds that curves wait for bounds, so that a browser draws both at once: a frame of its own takes it longer.
    """

    bench: Bench
    keeper: Keeper
    worker: Worker
    post: Callable[[Job], None]
    page: Page
    query: str = ""
    patience: float = 0.02
    history: History = field(default_factory=lambda: History(State()))
    closed: bool = False
    _shown: Shown | None = None
    _latest: int = 0  # of the questions
    _wanted: int = 0  # the latest question that something is computed for
    _drawn: int = 0  # the question whose run is shown
    _pace: float = math.inf  # seconds that the bounds of an observer took last

    def close(self) -> None:
        """The page is gone: what is still asked for is not computed."""
        self.closed = True

    def _begin(self, number: int) -> None:
        """Show what an address stands for; what is wrong with it is told, and the file as it is shown."""
        error = ""
        try:
            self.history = History(self.bench.state_of(self.query))
        except ConfigError as problem:
            error = f"{problem}: the file's own values are shown"
        self._compute(self.history, number, error)

    def ask(self, text: str) -> None:
        """Answer a question of the page."""
        question = json.loads(text)
        self._latest = number = int(question["number"])
        try:
            if question["do"] == "begin":
                self._begin(number)
                return
            if question["do"] == "write":
                self._write(number, str(question["file"]))
                return
            history = self._after(question)
        except HgorunError as error:
            self._tell(number, error=str(error))
            return
        if self._shown is not None and history.shown == self._shown.state:
            let_go = self.history.preview is not None and history.preview is None
            self.history = history
            self._wanted = self._drawn = number
            self._tell(number)
            if let_go:
                self._later(self._shown)
        else:
            self._compute(history, number)

    def _after(self, question: Mapping[str, Any]) -> History:
        """The history once a question has been answered.

        Raises
        ------
        ConfigError
        """
        history, shown = self.history, self.history.shown
        match question["do"]:
            case "set":
                knob = self.bench.knobs.get(str(question["name"]))
                if knob is None:
                    raise ConfigError("there is no such value", key=str(question["name"])[:80])
                state = shown.with_value(knob, question["value"])
                return history.stepped(state) if question["final"] else history.previewed(state)
            case "observer":
                label = str(question["label"])
                if label not in self.bench.labels:
                    raise ConfigError(f"no observer is called {label[:40]!r}.{nearest(label, self.bench.labels)}")
                return history.stepped(shown.with_observer(label, on=bool(question["on"])))
            case "undo":
                return history.undone()
            case "redo":
                return history.redone()
            case "reset":
                return history.stepped(State())
        raise ConfigError(f"there is no question {str(question['do'])[:40]!r}")

    def _compute(self, history: History, number: int, error: str = "") -> None:
        """Have a state computed; the page keeps what it has where that fails."""
        self._wanted = number

        def go_on(_: float = 0.0) -> None:
            if self.closed or number < self._wanted:
                raise Superseded

        def job() -> None:
            try:
                go_on()
                ready = self.bench.ready(history.shown)
                if not ready.compiled:
                    self.post(lambda: self._tell(number, busy="compiling new equations"))
                shown = ready.carry_out(go_on)
                picture = picture_of(shown)
                theories = self._with_curves(shown, go_on)
            except Superseded:
                return
            except HgorunError as problem:
                words = f"{problem}" + ("" if self._shown is None else ": the values before are shown")
                self.post(lambda: self._failed(number, words))
                return
            except Exception:  # the page would wait for an answer that does not come
                self.post(lambda: self._failed(number, _OUR_FAULT))
                raise
            self.post(lambda: self._arrived(history, number, shown, picture, theories, error))

        self.worker.submit(job, AT_ONCE)

    def _failed(self, number: int, words: str) -> None:
        self._drawn = max(self._drawn, number)  # what is shown stays
        self._tell(number, error=words)

    def _with_curves(self, shown: Shown, go_on: Callable[[], None]) -> list[Theory]:
        """The bounds that come with the curves: those that are known, or will be soon. The others follow."""
        labels = tuple(shown.result.observers) if self.bench.theory else ()
        known = [label for label in labels if self.bench.known(shown, label)]
        if len(labels) > len(known) and (len(labels) - len(known)) * self._pace > self.patience:
            return [self._theory(shown, label) for label in known]
        found = []
        for label in labels:
            go_on()
            found.append(self._theory(shown, label))
        return found

    def _theory(self, shown: Shown, label: str) -> Theory:
        observer, known, begun = shown.result.observers[label], self.bench.known(shown, label), perf_counter()
        promise = self.bench.promise(shown, label)
        if observer.lost and promise.transient is not None:
            unit = shown.result.units.get("time", "")
            promise = replace(promise, transient=None, reason=f"its estimate is lost: {observer.verdict.text(unit)}")
        found = Theory(label, promise, bounds_of(label, promise, shown.result))
        if not known:
            self._pace = perf_counter() - begun
        return found

    def _arrived(
        self,
        history: History,
        number: int,
        shown: Shown,
        picture: Picture,
        theories: list[Theory],
        error: str,
    ) -> None:
        if number < self._wanted:
            return
        self.history, self._shown, self._drawn = history, shown, number
        gone: dict[str, list[Bound]] = {label: [] for label in self.bench.labels if label not in shown.result.observers}
        self.page.draw(picture, {**gone, **{one.label: one.bounds for one in theories}})
        self._tell(
            number,
            error=error,
            picture=told_of_picture(picture),
            theories=told_of_theories(theories, shown.result.states),
        )
        told = {one.label for one in theories}
        if self.bench.theory:
            further = [label for label in shown.result.observers if label not in told]
            self.worker.submit(lambda: self._promises(shown, further), SOON)
        self._later(shown)

    def _later(self, shown: Shown) -> None:
        """Have the numbers computed that take longest."""
        for label in shown.result.observers if self.bench.theory else ():
            self._limit(shown, label, SLOW, Promise())
        self.worker.submit(lambda: self._finish(shown), LATER)
        self.worker.submit(lambda: self._look_ahead(shown), LATER)

    def _promises(self, shown: Shown, labels: list[str]) -> None:
        """The bounds of observers, drawn together, unless something newer has been asked for."""
        theories: list[Theory] = []
        for label in labels:
            if self._stale(shown):
                return
            theories.append(self._theory(shown, label))
        if theories:
            self.post(lambda: self._promised(shown, theories))

    def _promised(self, shown: Shown, theories: list[Theory]) -> None:
        if not self._stale(shown):
            self.page.draw_bounds({one.label: one.bounds for one in theories})
            self._tell(self._latest, theories=told_of_theories(theories, shown.result.states))

    def _limit(self, shown: Shown, label: str, names: tuple[str, ...], found: Promise) -> None:
        """What takes longer, one by one: while a slider is held there is no end to what is asked, and it waits."""

        def job() -> None:
            if not self._waits(shown):
                more = found.with_more(self.bench.limits(shown, label, names[:1]))
                if names[1:]:
                    self._limit(shown, label, names[1:], more)
                else:
                    self.post(lambda: self._limited(shown, label, more))

        self.worker.submit(job, LATER)

    def _limited(self, shown: Shown, label: str, promise: Promise) -> None:
        if not self._stale(shown):
            self._tell(self._latest, theories=[told_of_limits(label, promise)])

    def _finish(self, shown: Shown) -> None:
        """Numbers of the run that take longer, likewise."""
        if not self._waits(shown) and (whole := self.bench.finished(shown)) is not None:
            picture = picture_of(whole)
            self.post(lambda: self._finished(shown, picture))

    def _finished(self, shown: Shown, picture: Picture) -> None:
        if not self._stale(shown):
            self._tell(self._latest, picture=told_of_picture(picture), further=True)

    def _look_ahead(self, shown: Shown) -> None:
        """Be ready for what may be asked next, a little at a time: what is asked meanwhile waits for that."""
        if not self._waits(shown) and self.bench.look_ahead(shown):
            self.worker.submit(lambda: self._look_ahead(shown), LATER)

    def _waits(self, shown: Shown) -> bool:
        return self._stale(shown) or self.history.preview is not None

    def _stale(self, shown: Shown) -> bool:
        """Whether a run is no longer shown, or about to be replaced."""
        return self.closed or self._shown is not shown or self._wanted > self._drawn

    def _write(self, number: int, file: str) -> None:
        """Write the chosen values; nothing is written where the file does not come to the same."""
        if self._shown is None:
            raise ConfigError("there is nothing to write yet")
        written = self.keeper.write(self._shown, file)
        self._tell(number, written=str(written), file=self.keeper.next_name())

    def _tell(self, number: int, **more: object) -> None:
        """Where the page is, and what is new."""
        history, state = self.history, self.history.shown
        values = {name: state.values.get(name, knob.start) for name, knob in self.bench.knobs.items()}
        told: Told = {
            "number": number,
            "values": values,
            "off": sorted(state.off),
            "undo": bool(history.past),
            "redo": bool(history.future),
            "query": state.query(),
            "command": command(self.bench, state),
            **more,
        }
        self.page.tell(told)
