"""The live page: its document, its text, and what is drawn on it. This module imports bokeh."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from secrets import token_urlsafe
from typing import Any

from bokeh.document import Document
from jinja2 import Template

from hgorun.analysis.finding import FINDINGS
from hgorun.explore import plots
from hgorun.explore.bench import Bench, Shown
from hgorun.explore.keeping import Keeper
from hgorun.explore.knobs import Knob
from hgorun.explore.picture import Bound, Limits, Picture, styles_of
from hgorun.explore.plots import Changes, Lines
from hgorun.explore.promises import AT_ONCE, LATER
from hgorun.figures.page import dark

_PLACES = 200  # of a slider: a step is a two-hundredth of its range
_TOGETHER = {"measurement": "Measurement", "run": "Run", "plant": "Plant"}
_FOLDED = {"plant"}  # groups that are opened by who wants them


@dataclass(frozen=True)
class _Named:
    """A figure of the page."""

    name: str
    title: str
    said: str
    plot: Any
    hidden: bool = False


class View:
    """The figures of one page.

    Parameters
    ----------
    document : bokeh.document.Document
        Of the page.
    bench : Bench
    keeper : Keeper
    base : Shown
        The file as it is: how many states there are, and how observers look.

    Attributes
    ----------
    key : str
        By which its page says, on a channel, whose that is.
    send : callable
        Gives a message to the page.
    """

    def __init__(self, document: Document, bench: Bench, keeper: Keeper, base: Shown) -> None:
        self.key = token_urlsafe(8)
        self.send: Callable[[bytes], object] = lambda _: None
        self._labels = bench.labels
        self._closed = base.experiment.closed
        self._theory, self._recorded = bench.theory and not self._closed, base.result.recorded is not None
        self._states = tuple(base.result.states)
        looks = styles_of(base.result)
        self._changes = Changes()
        self._estimates: list[Lines] = []
        self._errors: list[Lines] = []
        self._others: list[Lines] = []
        self._innovations: list[Lines] = []
        self._limits: list[dict[str, Limits]] = [{} for _ in self._states]
        named = list(self._figures(base, looks))
        for one in named:
            document.add_root(one.plot)
        document.title = f"{bench.name} - hgorun explore"
        document.template = Template(_read("page.html"))
        document.template_variables.update(_words(self.key, bench, keeper, base, looks, named))

    def _figures(self, base: Shown, looks: Any) -> Iterator[_Named]:
        result = base.result
        units = result.units
        span = float(result.time[0]), float(result.time[-1])
        time = f"time{_in_brackets(units.get('time', ''))}"
        for i, state in enumerate(self._states):
            unit = _in_brackets(units.get(state, ""))
            plot = plots.empty_plot(f"estimate{i}", time, f"{state}{unit}", span)
            self._estimates.append(
                plots.estimates_of(plot, self._changes, looks, closed=self._closed, recorded=self._recorded)
            )
            yield _Named(f"estimate{i}", f"{state} and its estimates", f"{state} and its estimates over time", plot)
            if self._recorded:
                continue
            plot = plots.empty_plot(f"error{i}", time, f"|error of {state}|{unit}", span, logarithmic=True)
            self._errors.append(plots.errors_of(plot, self._changes, looks))
            yield _Named(f"error{i}", f"Errors of {state}", f"size of the errors of {state} over time", plot)
        for i, output in enumerate(result.outputs if self._recorded else ()):
            unit = _in_brackets(units.get(output, ""))
            plot = plots.empty_plot(f"innovation{i}", time, f"innovation of {output}{unit}", span)
            self._innovations.append(plots.estimates_of(plot, self._changes, looks, closed=False, recorded=True))
            title = f"Innovations of {output}: measured minus estimated, before the sample was used"
            yield _Named(f"innovation{i}", title, f"innovations of {output} over time", plot)
        if self._theory:
            for i in range(len(self._states)):  # of theories in other coordinates, where there are some
                plot = plots.empty_plot(f"other{i}", time, f"|error of z{i + 1}|", span, logarithmic=True)
                self._others.append(plots.errors_of(plot, self._changes, looks))
                title = f"Errors of z{i + 1}, a coordinate of the theory"
                yield _Named(f"other{i}", title, title, plot, hidden=True)

    def draw(self, picture: Picture, bounds: Mapping[str, list[Bound]]) -> None:
        """Show a run, and what the theory bounds of some of its observers."""
        shown = [*zip(self._estimates, picture.panels, strict=True)]
        for lines, panel in (*shown, *zip(self._innovations, picture.innovations, strict=True)):
            plots.draw_estimates(lines, panel, self._labels, closed=self._closed)
        for lines, panel in zip(self._errors, picture.panels, strict=False):
            plots.draw_errors(lines, panel, self._labels)
        for label, of in bounds.items() if self._errors else ():
            self._draw_bounds(label, of)

    def draw_bounds(self, bounds: Mapping[str, list[Bound]]) -> None:
        """Show what the theory bounds of observers."""
        for label, of in bounds.items():
            self._draw_bounds(label, of)

    def _draw_bounds(self, label: str, bounds: list[Bound]) -> None:
        of_states = tuple(bound.name for bound in bounds) == self._states
        for i in range(len(self._states)):
            own = bounds[i] if i < len(bounds) else None
            plots.draw_bound(self._errors[i], label, own if of_states else None, with_error=False)
            if self._others:
                other = None if of_states else own
                plots.draw_bound(self._others[i], label, other, with_error=True)
                self._fit(i, label, other)

    def _fit(self, i: int, label: str, bound: Bound | None) -> None:
        """Have a coordinate's axis hold the errors of all observers."""
        known = self._limits[i]
        known.pop(label, None)
        limits = None if bound is None else bound.limits
        if limits is not None:
            known[label] = limits
        if known:
            self._others[i].set_limits(min(low for low, _ in known.values()), max(high for _, high in known.values()))

    def tell(self, told: Mapping[str, object]) -> None:
        """Give numbers and messages to the page, and with them what has been drawn."""
        drawn, points = self._changes.taken()
        self.send(packed({**told, "drawn": drawn}, points))


def packed(told: Mapping[str, object], points: bytes) -> bytes:
    """A message: the length of its text, the text, which is JSON, and points, from places that are multiples of 8."""
    text = json.dumps(told, allow_nan=False).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + points


def _words(key: str, bench: Bench, keeper: Keeper, base: Shown, looks: Any, named: Sequence[_Named]) -> dict[str, Any]:
    """What the template shows; Jinja does not escape, so all of it is."""
    from matplotlib.colors import to_hex

    knobs = list(bench.knobs.values())
    names = dict.fromkeys([*bench.labels, *(knob.group for knob in knobs)])
    groups = []
    for name in names:
        look = looks.get(name) if name in bench.labels else None
        groups.append(
            {
                "name": _safe(name if look else _TOGETHER.get(name, name)),
                "observer": look is not None,
                "folded": look is None and name in _FOLDED,
                "colour": look.colour if look else "",
                "dark": to_hex(dark(look.colour)) if look else "",
                "dashes": _dashes(look.dashes) if look else "",
                "knobs": [_knob(i, knob) for i, knob in enumerate(knobs) if knob.group == name],
            }
        )
    known = {
        "channel": key,
        "places": _PLACES,
        "labels": bench.labels,
        "knobs": [
            {"name": k.name, "scale": k.scale, "low": k.low, "high": k.high, "start": k.start, "unit": k.unit}
            for k in knobs
        ],
        "findings": [[name, *_said(name)] for name in (*AT_ONCE, *LATER)],
    }
    return {
        "style": _read("page.css"),
        "script": "".join(_read(f"{name}.js") for name in ("labels", "scheme", "painting", "page")),
        "known": json.dumps(known).replace("<", "\\u003c"),
        "heading": _safe(base.result.title or bench.name),
        "file": _safe(str(bench.path) + (f", run {bench.run_name}" if bench.run_name else "")),
        "name": _safe(bench.name),
        "time_unit": _safe(base.result.units.get("time", "")),
        "closed": base.experiment.closed,
        "recorded": base.result.recorded is not None,
        "groups": groups,
        "plots": [{"name": n.name, "title": _safe(n.title), "said": _safe(n.said), "hidden": n.hidden} for n in named],
        "folder": _safe(str(keeper.folder)),
        "file_name": _safe(keeper.next_name()),
    }


def _knob(number: int, knob: Knob) -> dict[str, Any]:
    whole = knob.scale == "integer"
    whose = {**dict.fromkeys(_TOGETHER, ""), "plant": " of the plant"}.get(knob.group, f" of {knob.group}")
    return {
        "number": number,
        "label": _safe(knob.label),
        "said": _safe(f"{knob.label}{whose}"),
        "unit": _safe(knob.unit),
        "bottom": round(knob.low) if whole else 0,
        "top": round(knob.high) if whole else _PLACES,
    }


def _said(name: str) -> tuple[str, str]:
    """A finding's title and meaning."""
    finding = FINDINGS.find(name)
    return finding.title, finding.meaning.replace("`", "")


def _dashes(style: Any) -> str:
    """A line style of matplotlib for SVG."""
    from hgorun.explore.marks import dash

    found = dash(style)
    return "" if found == "solid" else " ".join(str(2 * part) for part in found)


def _in_brackets(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _safe(words: str) -> str:
    from html import escape

    return escape(words, quote=True)


def _read(name: str) -> str:
    return (files("hgorun.explore") / name).read_text(encoding="utf-8")
