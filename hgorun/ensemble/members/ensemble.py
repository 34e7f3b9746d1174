"""An ensemble: a base experiment, the axes along which it is varied, and what is kept of every member.

Members are numbered. What a member changes follows from its number, so that no list of all of them is ever made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import prod

import numpy as np

from hgorun.config.expressions import ExpressionError, nearest
from hgorun.config.nearest import among, listed, meant
from hgorun.config.refusals import Refusals
from hgorun.config.sweeps import MOST_MEMBERS, Combine, Keep, LinearAxis, ListAxis, LogAxis, SweepBlocks, Worst
from hgorun.ensemble.members.members import Members, written_out
from hgorun.ensemble.members.names import new_names, why_not_there
from hgorun.ensemble.members.values import Column, Floats, Places, Seeds, Values, check_seeds, values_of
from hgorun.errors import ConfigError, KeyPath, Problem
from hgorun.measurement.chance import generator
from hgorun.result.metrics.base import all_metrics
from hgorun.result.quantities.quantities import kinds, of_loops, read_quantity
from hgorun.result.quantities.quantity import Quantity
from hgorun.result.quantities.quoted import quoted
from hgorun.result.windows import points_in, window_since
from hgorun.simulation.experiment.experiment import Experiment

_BITS = 32  # of a coordinate of a Sobol point


@dataclass(frozen=True, kw_only=True, eq=False)
class Ensemble:
    """Members of a base experiment.

    Attributes
    ----------
    name : str
        Results are called by it.
    base : Experiment
    blocks : SweepBlocks
        Axes, how they are combined, and what is kept.
    title, text : str
        The title, and the file as it was written.
    """

    name: str
    base: Experiment
    blocks: SweepBlocks
    title: str = ""
    text: str = ""

    @property
    def combine(self) -> Combine:
        """How the values of the axes are put together."""
        return self.blocks.combine

    @property
    def keep(self) -> Keep:
        """What is kept of every member."""
        return self.blocks.keep

    @cached_property
    def axes(self) -> dict[str, Values]:
        """The values of every axis, by its path as it was written."""
        seed = self.base.blocks.seed
        return {path: values_of(axis, path, seed) for path, axis in self.blocks.axes.items()}

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics that are kept, in the order of tables."""
        known = tuple(all_metrics(closed=self.base.closed))
        kept = self.keep.metrics
        return known if kept is None else tuple(name for name in known if name in kept)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """What else is measured of every member.

        Raises
        ------
        Problem
            For text that is no quantity of one run.
        """
        return tuple(map(self._quantity, range(len(self.keep.quantities))))

    def _quantity(self, i: int) -> Quantity:
        text = self.keep.quantities[i]
        place: KeyPath = ("keep", "quantities", i)
        try:
            found = read_quantity(quoted(text, self.base.observers), (self.name,))
        except ExpressionError as error:
            raise Problem(place, str(error)) from error
        if kinds()[found.function].measure is None or any(run != self.name for run, _ in found.of):
            raise Problem(place, f"it is not measured on one member: {text}")
        kind, model = kinds()[found.function], self.base.plant.model
        for _, label in found.of:
            if label is not None and not kind.takes(label, self.base.observers):
                known = tuple(self.base.observers)
                near, all_names = nearest(label, known), listed(known, label)
                raise Problem(place, f"no observer is called {label!r}.{near} Known: {all_names}")
        if of_loops(found) and not self.base.closed:
            raise Problem(place, f"{text}: there is no controller")
        what, names = ("input", model.inputs) if kind.of == "input" else ("state", model.states)
        if kind.of != "loop" and found.state not in names:
            raise Problem(
                place,
                f"no {what} is called {found.state!r}. {what.capitalize()}s: {among(found.state or '', names)}",
            )
        self._check_window(found, place)
        return found

    def _check_window(self, quantity: Quantity, place: KeyPath) -> None:
        """Refuse a window without a point of the base's output grid."""
        if quantity.window is None or any(path.partition(".")[0] == "time" for path in self.axes):
            return
        time, (points, every, _) = self.base.blocks.time, self.base.grid
        low, high = quantity.window
        if low < time.start - 1e-9 or high > time.end + 1e-9:
            raise Problem(place, f"{quantity}: the run lasts from {time.start:g} to {time.end:g}")
        if not points[::every][points_in(points[::every], window_since((low, high), time.start))].size:
            raise Problem(place, f"{quantity}: no output point lies in this window")

    @property
    def dimensions(self) -> dict[str, int]:
        """Names and sizes of the dimensions along which members lie."""
        if self.combine == "product":
            return {path: values.size for path, values in self.axes.items()}
        return {"member": max(self._sizes.values(), default=0)}

    @property
    def size(self) -> int:
        """How many members there are."""
        return prod(self.dimensions.values())

    def values(self, start: int, stop: int) -> dict[str, Column]:
        """What the members from ``start`` to before ``stop`` have on every axis, each of shape (stop - start,)."""
        places: Places = np.arange(start, stop)
        if self.combine == "product":
            along = np.unravel_index(places, tuple(self.dimensions.values()))
            return {path: v.at(p) for (path, v), p in zip(self.axes.items(), along, strict=True)}
        if self.combine == "zip":
            return {path: values.at(places) for path, values in self.axes.items()}
        points = self._sobol(start, stop)
        return {path: v.spread(u, places) for (path, v), u in zip(self.axes.items(), points, strict=True)}

    def members(self, start: int, stop: int) -> Members:
        """The members from ``start`` to before ``stop``."""
        return Members(self.values(start, stop), stop - start)

    def _sobol(self, start: int, stop: int) -> Iterator[Floats]:
        """Coordinates of points of a Sobol sequence, shifted by random digits, each inside (0, 1)."""
        from scipy.stats.qmc import Sobol

        sequence = Sobol(len(self.axes), scramble=False, bits=_BITS)
        if start:
            sequence.fast_forward(start)
        first = min(1, stop - start)  # else scipy warns of every number of points that is no power of two
        points = np.concatenate([sequence.random(first), sequence.random(stop - start - first)])
        points = (points * 2.0**_BITS).astype(np.int64)
        for path, column in zip(self.axes, points.T, strict=True):
            shift = int(generator(self.base.blocks.seed, "sobol", path).integers(2**_BITS))
            yield ((column ^ shift) + 0.5) * 2.0**-_BITS

    def check(self) -> None:
        """Refuse what no member could be made of.

        Raises
        ------
        Problem
            Its path is one of the sweep file; ``others`` are further ones.
        """
        faults, found = Refusals(), dict[str, str]()
        checks: list[Callable[[], object]] = [
            self._check_sizes,
            *(partial(self._check_ends, path) for path in self.axes),
            *(partial(self._quantity, i) for i in range(len(self.keep.quantities))),
            *(partial(self._check_metric, i) for i in range(len(self.keep.metrics or ()))),
            self._check_trajectories,
            *(partial(self._check_axis, path, found) for path in self.axes),
        ]
        for check in checks:
            with faults.of_a_part():
                check()
        faults.refuse()

    def _check_axis(self, path: str, found: dict[str, str]) -> None:
        """Refuse an axis that leads nowhere, meets one that is found before, or has no value that can be used."""
        place, values = ("axes", path), self.axes[path]
        if isinstance(values, Seeds):
            check_seeds(path, values)
        try:
            paths = written_out(self.base, path)
        except ConfigError as error:
            raise Problem(place, error.message) from None
        for one in paths:
            _check_apart(one, path, found)
            found[one] = path
        if (refused := self._refused(path, paths)) is not None:
            key = "" if refused.key in (None, path) else f"{refused.key}: "
            raise Problem(place, f"{key}{refused.message}")

    def _refused(self, path: str, paths: Sequence[str]) -> ConfigError | None:
        """Why no value of an axis can be used, or, where whole numbers are asked for, why one that is none cannot."""

        def why(value: object) -> ConfigError | None:
            try:
                varied = self.base.varied(dict.fromkeys(paths, value))
            except ConfigError as error:
                return error
            return why_not_there(varied, new) if new else None

        new = new_names(self.base, paths)
        axis, values = self.blocks.axes[path], self.axes[path]
        written = axis.values if isinstance(axis, ListAxis) else None  # 1 and 2.5 are 1.0 and 2.5 in a column
        places = sorted({0, values.size // 2, values.size - 1})
        tried = [written[at] if written is not None else values.at(np.array([at])).tolist()[0] for at in places]
        reasons = [why(value) for value in tried]
        accepted = [value for value, reason in zip(tried, reasons, strict=True) if reason is None]
        if not accepted:
            return reasons[0]
        for word in dict.fromkeys(value for value in written or () if isinstance(value, str)):
            reason = why(word)
            if reason is not None and reason.key in paths:  # not of another key that does not go with it
                return reason
        if written is not None and values.at(np.arange(1)).dtype.kind == "f":
            whole = [value for value in accepted if type(value) is int]
            if whole and why(float(whole[0])) is not None:
                return next(filter(None, map(why, written)), None)
        return None

    @property
    def _sizes(self) -> dict[str, int]:
        """By path, how many members there are where values are not combined; a list that is spread does not say it."""
        blocks = self.blocks.axes
        return {
            path: values.size
            for path, values in self.axes.items()
            if self.combine == "zip" or not isinstance(blocks[path], ListAxis)
        }

    def _check_sizes(self) -> None:
        if self.combine == "product":
            if self.size > MOST_MEMBERS:
                raise Problem(("axes",), f"they make {self.size} members, more than {MOST_MEMBERS}")
            return
        if not self._sizes:
            raise Problem(("axes",), "lists alone do not say how many members there are")
        if len(set(self._sizes.values())) > 1:
            each = ", ".join(f"{path} {size}" for path, size in self._sizes.items())
            raise Problem(("axes",), f"{self.combine} needs axes with the same number of values, found {each}")

    def _check_ends(self, path: str) -> None:
        axis = self.blocks.axes[path]
        if self.combine == "sobol" or not isinstance(axis, LinearAxis | LogAxis):
            return
        if axis.count == 1 and axis.ends[0] != axis.ends[1]:
            first, last = axis.ends
            raise Problem(("axes", path), f"one value cannot be both {first:g} and {last:g}: give 2 or more")

    def _check_metric(self, i: int) -> None:
        known, name = all_metrics(closed=self.base.closed), (self.keep.metrics or ())[i]
        if name not in known:
            near, all_names = nearest(name, known), listed(known, name)
            raise Problem(("keep", "metrics", i), f"no metric is called {name!r}.{near} Known: {all_names}")

    def _check_trajectories(self) -> None:
        kept = self.keep.trajectories
        place: KeyPath = ("keep", "trajectories")
        if kept != "none" and self.base.closed:
            raise Problem(place, "only metrics and quantities of closed loops are kept; simulate a member to see more")
        if isinstance(kept, Worst):
            for key, names in (
                ("by", self.metrics),
                ("observer", tuple(self.base.observers)),
                ("state", self.base.plant.model.states),
            ):
                value = getattr(kept, key)
                if value is not None and value not in names:
                    raise Problem(
                        (*place, key), f"expected one of {', '.join(names)}; found {value!r}{meant(str(value), names)}"
                    )
        if kept != "none" and (moved := next((p for p in self.axes if p.split(".")[0] == "time"), None)):
            raise Problem(place, f"trajectories need one grid of output, but the axis {moved} may change it")


def _check_apart(path: str, axis: str, found: Mapping[str, str]) -> None:
    """Refuse an axis that changes what another one changes, a part of it, or what it is a part of."""
    for other, before in found.items():
        if f"{path}.".startswith(f"{other}.") or f"{other}.".startswith(f"{path}."):
            raise Problem(("axes", axis), f"it changes {path}, and so does the axis {before}: let one of them do so")
