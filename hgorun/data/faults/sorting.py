"""Samples of one quantity while they are sorted out: what is dropped, refused, or only reported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hgorun import pieces
from hgorun.config.data import Faults
from hgorun.data.clocks import duration_shown, shown
from hgorun.data.faults import clock_changes, faults, filled
from hgorun.data.faults.another_log import Reasons
from hgorun.data.faults.begun_again import begun_again, beside_time
from hgorun.data.faults.one_stamp import one_ahead
from hgorun.data.faults.periods import means, unwrapped
from hgorun.data.faults.said_places import held_said, samples_said, where
from hgorun.data.odd_clocks import EXACT
from hgorun.data.recording import Note, Origin
from hgorun.data.samples import Samples
from hgorun.data.tags import NearRows, of_several
from hgorun.errors import ConfigError

_ALL_DIGITS = 17  # that tell two doubles apart
_AS_MEASURED = "faults: {slips: report} if this was measured so"
_HELD = "an input's last value is held meanwhile, or with hold: linear a straight line goes to the next"
_IF_KNOWN = "faults: {repeated: first}, last, mean or keep if this is known"
_IF_SORTED = "faults: {backwards: sort} or {backwards: drop} if this is known"
_LATEST = 1e8  # steps between samples


class Sorting:
    """Sorts samples out as told, and notes what it has found.

    Parameters
    ----------
    told : Faults
    measured : bool
        Whether a sensor measured them: what a machine was told to do may well be a ramp, a level or a step.
    origin : Origin
        Of their times.
    period : float, optional
        Up to which the values are known, as those of an angle.
    near : callable, optional
        Gives the rows near some lines of a file, where these may name the signal that they are of.
    """

    def __init__(
        self,
        told: Faults,
        measured: bool,
        origin: Origin,
        period: float | None = None,
        near: NearRows | None = None,
    ) -> None:
        self._told, self._measured, self._origin, self._period, self._near = told, measured, origin, period, near
        self.notes: list[Note] = []
        self._reasons = Reasons(origin)

    def sorted_out(self, samples: Samples, plausible: tuple[float, float] | None, unit: str = "") -> Samples:
        """Finite values in the order of their times.

        Raises
        ------
        ConfigError
            For the first fault that is to be refused.
        """
        with np.errstate(all="ignore"):  # differences of the largest numbers
            return self._sorted_out(samples, plausible, unit)

    def _sorted_out(self, samples: Samples, plausible: tuple[float, float] | None, unit: str) -> Samples:
        samples = self._present(samples)
        samples = self._good(samples)
        samples = self._plausible(samples, plausible, unit)
        samples = self._known_after(samples)
        samples = self._in_order(samples)
        samples = self._once(samples)
        self._gaps(samples)
        if not self._measured:
            return samples
        self._slips(samples)
        samples = self._filled(samples)
        return self._stuck(samples)

    def _note(self, kind: str, samples: Samples, k: int, count: int, message: str, consequence: str = "") -> None:
        file, line = samples.place(k)
        note = Note(kind=kind, signal=samples.key, file=file, line=line, count=count, message=message)
        self.notes.append(replace(note, consequence=consequence))

    def _refused(self, samples: Samples, k: int, message: str, hint: str) -> ConfigError:
        file, line = samples.place(k)
        below = next((f"; {key} goes below data" for key in ("faults", "csv") if f"{key}: {{" in hint), "")
        return ConfigError(f"{message}; {hint}{below}", file=file, line=line, key=samples.key)

    def _kept(self, samples: Samples, wrong: np.ndarray, kind: str, what: str, refuse: str | None) -> Samples:
        """Those that are not wrong, with a note; refused if a hint says how they are dropped."""
        if not wrong.any():
            return samples
        first, count = int(wrong.argmax()), int(wrong.sum())
        if refuse is not None:
            raise self._refused(samples, first, what, refuse)
        self._note(kind, samples, first, count, f"{samples_said(count)} left out: {what}")
        kept = samples.at(~wrong)
        if not kept.values.size:
            raise self._refused(samples, first, f"no value is left: {what}", "there is nothing to estimate from")
        return kept

    def _present(self, samples: Samples) -> Samples:
        refuse = "faults: {missing: drop} leaves them out" if self._told.missing == "refuse" else None
        if np.isnan(np.min(samples.values, initial=np.inf)):  # told in less time than which they are
            missing = np.isnan(samples.values)
            samples = self._kept(samples, missing, "missing", "the value is missing", refuse)
        if not faults.ascending(samples.taken) and (unstamped := np.isnan(samples.taken)).any():
            raise self._refused(
                samples, int(unstamped.argmax()), "a value without time stamp", "it cannot be placed: remove that row"
            )
        if samples.late:
            unknown = np.isnan(samples.available)
            samples = self._kept(samples, unknown, "unknown", "the time when it was known is missing", refuse)
        return samples

    def _good(self, samples: Samples) -> Samples:
        if samples.good is None:
            return samples
        return self._kept(samples, samples.good == 0, "quality", "the quality is not good", None)

    def _plausible(self, samples: Samples, plausible: tuple[float, float] | None, unit: str) -> Samples:
        if plausible is None:
            return samples
        low, high = plausible
        wrong = (samples.values < low) | (samples.values > high)
        refuse = "faults: {implausible: drop} leaves them out" if self._told.implausible == "refuse" else None
        return self._kept(samples, wrong, "implausible", f"the value is outside of [{low:g}, {high:g}]{unit}", refuse)

    def _known_after(self, samples: Samples) -> Samples:
        if samples.late and (early := samples.available < samples.taken).any():
            k = int(early.argmax())
            both = samples.available, samples.taken
            known, taken = (shown(float(times[k]), self._origin, samples.time_unit) for times in both)
            if known == taken:
                known, taken = (
                    duration_shown(float(times[k]), self._origin, samples.time_unit, _ALL_DIGITS) for times in both
                )
            what = f"known at {known}, before it was taken at {taken}"
            raise self._refused(samples, k, what, "the two columns may have been exchanged")
        return self._known_soon(samples)

    def _known_soon(self, samples: Samples) -> Samples:
        """Refuse a sample that the run would have to wait for, far beyond the log, as a stream does."""
        step = np.ptp(samples.taken) / (samples.taken.size - 1) if samples.late and samples.taken.size > 1 else 0.0
        if step and (late := samples.available - samples.taken > _LATEST * step).any():
            k = int(late.argmax())
            known, taken = (
                shown(float(times[k]), self._origin, samples.time_unit) for times in (samples.available, samples.taken)
            )
            what = f"known at {known}, more than {_LATEST:g} mean steps of the log after it was taken at {taken}"
            hint = "correct it, or leave the cell empty and say faults: {missing: drop}"
            raise self._refused(samples, k, what, hint)
        return samples

    def _in_order(self, samples: Samples) -> Samples:
        if faults.ascending(samples.taken):
            return samples
        back = faults.backwards(samples.taken)
        if not back.size:
            return self._by_arrival(samples)
        k, told = int(back[0]), self._told.backwards
        what = f"the time stamp {shown(samples.taken[k], self._origin, samples.time_unit)} lies before one above it"
        hint = begun_again(samples, k, self._origin) or of_several(self._near, samples, (k - 1, k), _IF_SORTED)
        what, hint, noted = self._reasons.told(samples, what, hint)
        if told == "drop":
            wrong = np.zeros(samples.values.size, dtype=bool)
            wrong[back] = True
            return self._by_arrival(self._kept(samples, wrong, "backwards", noted, None))
        if told != "sort" and not samples.late:
            alone = None if hint == clock_changes.RIGHT else one_ahead(samples, k, self._origin)
            raise self._refused(samples, *(alone or (k, what, hint)))
        self._note("backwards", samples, k, back.size, f"{samples_said(back.size)} sorted by time: {noted}")
        return self._by_arrival(samples)

    def _by_arrival(self, samples: Samples) -> Samples:
        """By the time they were taken, then by when they were known."""
        if pieces.ascending(samples.taken, strictly=True):
            return samples
        order = np.lexsort((samples.available, samples.taken))
        return samples if np.all(np.diff(order) == 1) else samples.at(order)

    def _once(self, samples: Samples) -> Samples:
        again = faults.repeated(samples.taken) if not faults.ascending(samples.taken) else np.empty(0, dtype=int)
        told = self._told.repeated
        if not again.size:
            return samples
        pair = [int(again[0]) - 1, int(again[0])]
        before, k = sorted(pair, key=lambda i: (int(samples.part[i]) if samples.part.size else 0, samples.lines[i]))
        file, line = samples.place(before)
        above = f"line {line}" if file == samples.place(k)[0] else f"line {line} of {file}"
        stamp = shown(float(samples.taken[k]), self._origin, samples.time_unit)
        what = f"the time stamp {stamp} has come before, on {above}"
        if samples.coarse:
            what += f", or is the same only as it is rounded, to multiples of {samples.coarse:.3g} here: {EXACT}"
        hint = beside_time(self._near, samples, (before, k)) or of_several(self._near, samples, (before, k), _IF_KNOWN)
        what, hint, noted = self._reasons.told(samples, what, hint)
        if told is None or told == "refuse":
            raise self._refused(samples, k, what, hint)
        self._note("repeated", samples, k, again.size, f"{samples_said(again.size)} ({told}): {noted}")
        if told == "keep":
            return samples
        starts = np.delete(np.arange(samples.values.size), again)
        if told == "first":
            return samples.at(starts)
        last = np.append(starts[1:], samples.values.size) - 1
        kept = samples.at(last)  # a mean is known when the last of them is
        if told == "last":
            return kept
        return replace(kept, values=means(samples.values, starts, self._period))

    def _gaps(self, samples: Samples) -> None:
        if (forward := clock_changes.put_forward(samples.taken, self._origin)).size:
            self._note("clock", samples, int(forward[0]), forward.size, clock_changes.PUT_FORWARD, clock_changes.RIGHT)
        found = faults.gaps(samples.taken)
        if not found.size:
            return
        k, longest = int(found[0]), float(np.diff(samples.taken).max())
        most = duration_shown(longest, self._origin, samples.time_unit, digits=6)
        what = f"the time stamps jump by more than {faults.GAP:g} usual steps, at most by {most}"
        if self._told.gaps == "refuse":
            raise self._refused(samples, k, what, "faults: {gaps: report} if nothing was measured there")
        places = [faults.Stretch(int(k), int(k) + 1) for k in found]
        self._note("gaps", samples, k, found.size, f"{what}{where(samples, places)}", "" if self._measured else _HELD)

    def _slips(self, samples: Samples) -> None:
        found = faults.slips(unwrapped(samples.values, self._period))
        if not found:
            return
        k, change = found[0]
        what = (
            f"from here on the values differ by {change} ({samples.values[k - 1]:g}, then {samples.values[k]:g}), "
            "as if the unit had changed"
        )
        if self._told.slips != "report":
            raise self._refused(samples, k, what, f"{_AS_MEASURED}{samples.doubt}")
        places = [faults.Stretch(k, k + 1) for k, _ in found]
        self._note("slips", samples, k, len(found), f"{what}{where(samples, places)}")

    def _filled(self, samples: Samples) -> Samples:
        hint = "faults: {filled: drop} keeps the ends of the lines, report all"
        what = "on straight lines, as if filled in by interpolation"
        return self._stretches(
            samples,
            filled.filled(samples.taken, unwrapped(samples.values, self._period)),
            "filled",
            what,
            self._told.filled or "refuse",
            hint,
            _ends,
        )

    def _stuck(self, samples: Samples) -> Samples:
        hint = "faults: {stuck: report} or drop if this is known"
        found = faults.stuck(samples.values)
        what = held_said(samples.values, found)
        return self._stretches(samples, found, "stuck", what, self._told.stuck or "report", hint, _start)

    def _stretches(
        self,
        samples: Samples,
        found: list[faults.Stretch],
        kind: str,
        what: str,
        told: str,
        hint: str,
        kept: Callable[[faults.Stretch], list[int]],
    ) -> Samples:
        """Refused, reported, or dropped but for some of each stretch."""
        if not found:
            return samples
        keep = np.ones(samples.values.size, dtype=bool)
        for stretch in found:  # lines meet in their ends
            keep[stretch.start : stretch.stop] = False
        first, count = found[0], int(np.count_nonzero(~keep))
        message = f"{samples_said(count)} {what}{where(samples, found)}"
        if told == "refuse":
            raise self._refused(samples, first.start, message, f"{hint}{samples.doubt}")
        if told == "report":
            self._note(kind, samples, first.start, count, message)
            return samples
        for stretch in found:
            keep[kept(stretch)] = True
        dropped = int(np.count_nonzero(~keep))
        self._note(kind, samples, first.start, count, f"{message}, of which {dropped:,} are left out")
        return samples.at(keep)


def _ends(stretch: faults.Stretch) -> list[int]:
    return [stretch.start, stretch.stop - 1]


def _start(stretch: faults.Stretch) -> list[int]:
    return [stretch.start]
