"""Why stamps may run backwards or come again, where to sort or to drop them would be wrong, and what is right."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from hgorun.data.recording import Origin
from hgorun.data.samples import Samples
from hgorun.data.tags import NearRows
from hgorun.data.times.number_clocks import clock_in_digits
from hgorun.data.units.units import seconds
from hgorun.pieces import median

_COUNTERS = [2.0**bits * part for bits in (8, 16, 24, 32) for part in (1.0, 1e-3, 1e-6)]
_DAYS = [86_400.0, 86_400e3, 1440.0, 24.0]
_NEAR = 1.5  # steps by which what follows may be off
_FEWEST = 3  # stamps that show their usual step
_THOUSAND = 1000
_HOUR = 100  # as hours and minutes are written without a sign between
_TIME = re.compile(r"[0-9]{1,2}:[0-9]{2}(?::[0-9]{2}(?:[.,][0-9]+)?)?(?:\s?[APap]\.?[Mm]\.?)?")
_PARTS = re.compile(r"m(illi)?s(ec(onds?)?)?|milli(s|seconds?)?|µs|us|microseconds?|fractions?", re.IGNORECASE)


def begun_again(samples: Samples, back: int, origin: Origin) -> str:
    """Why numbers may run backwards at a sample, and what is right; empty where nothing is known, and of dates."""
    if origin.epoch is not None or back < _FEWEST:
        return ""
    scale = (
        float(seconds(origin.unit, ()) / seconds(samples.time_unit, ())) if samples.time_unit != origin.unit else 1.0
    )
    taken = samples.taken * scale
    before, here = float(taken[back - 1]), float(taken[back])
    step = median(np.diff(taken[:back]))
    if not step > 0:
        return ""
    if before < _THOUSAND <= _THOUSAND * here and abs(_THOUSAND * here - before - step) <= _NEAR * step:
        return f'if the point in {here:.3f} stands between thousands: csv: {{thousands: "."}}'
    if (found := clock_in_digits(taken[:back])) is not None:
        forms = ", ".join(f'"{form}" if they are {of}' for of, form in found.patterns.items())
        shown = f"since {found.before:.10g} is followed by {found.behind:.10g}"
        return f"its numbers look like times, {shown}: format: {forms}"
    if step == _HOUR and before == 24 * _HOUR - step and 0 <= here < _HOUR:
        return f'its numbers look like hours, since {before:g} is followed by {here:g}: format: "%H%M"'
    for period in (*_COUNTERS, *_DAYS):
        if before < period and abs(here + period - before - step) <= _NEAR * step < period / 2:
            what = "the time of day at midnight" if period in _DAYS else "a counter that is full"
            return f"they may begin again, as {what}: write n + {period:.10g} for each n from here on into the file"
    return ""


def beside_time(near: NearRows | None, samples: Samples, pair: Sequence[int]) -> str:
    """What is right where a column beside equal stamps has the time of day, or parts of a second; empty elsewhere."""
    places = [samples.place(k) for k in pair]
    if near is None or {file for file, _ in places} != {str(samples.sources[0])}:
        return ""
    lines = [line for _, line in places]
    for column, cells in near(*lines).items():
        before, behind = (cells.get(line, "") for line in lines)
        of_day = all(map(_TIME.fullmatch, (before, behind)))
        parts = _PARTS.fullmatch(column.strip()) and before.isdigit() and behind.isdigit()
        if before != behind and (of_day or parts):
            what = "the time of day" if of_day else "parts of a second"
            right = "write a column into the file that has both, such as 2024-05-31 13:45:10.25"
            return f"column {column!r} has {what}: {right}"
    return ""
