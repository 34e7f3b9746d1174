"""An analysis as text for a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from hgorun.analysis.finding import Finding
from hgorun.analysis.report import Analysis, Findings
from hgorun.result.result import Result
from hgorun.tables.layout import number, packed, wrapped
from hgorun.tables.typeset import printable

_CAUTION = (
    "theta_bound, delay_bound and tau_bound are sufficient: what the proofs ask for, usually 1e2 to 1e6 times more "
    "than is needed. delay_critical and period_critical are the limits of the linear error."
)


def text(analysis: Analysis) -> str:
    """Tables as wide as the terminal, then what has no value and why."""
    result, found = analysis.result, analysis.observers
    unit = printable(result.units.get("time", ""))
    lines = wrapped(": ".join(part for part in (printable(analysis.name), printable(result.title)) if part))
    if unit:
        lines += wrapped(f"times in {unit}, rates in 1/{unit}; beta, chi and poles at theta = 1", "  ")
    groups = [columns for group in _groups(analysis.findings) if (columns := _columns(group, found))]
    for block in packed(list(found), groups) if found else [["no observers"]]:
        lines += ["", *block]
    lines += ["", *wrapped(_CAUTION)]
    for words in [*_coordinates(result), *_notes(found)]:
        lines += wrapped(words)
    return "\n".join(lines)


def reference(findings: Sequence[Finding]) -> str:
    """Keys, units and meanings as a table in Markdown: the reference in docs/analysis.md."""
    rows = [f"| `{f.name}` | {f.unit} | {f.meaning} |" for f in findings if "json" in f.places]
    return "\n".join(["| key | unit | meaning |", "|---|---|---|", *rows])


def _groups(findings: Sequence[Finding]) -> list[list[Finding]]:
    """What has a column, in groups that stay together."""
    shown = [finding for finding in findings if "table" in finding.places]
    return [list(group) for _, group in groupby(shown, lambda finding: finding.group)]


def _columns(group: Sequence[Finding], found: Mapping[str, Findings]) -> list[list[str]]:
    columns = []
    for finding in group:
        values = [f.values.get(finding.name) for f in found.values()]
        maps = [v for v in values if isinstance(v, Mapping)]
        if maps and all(isinstance(v, Mapping) or v is None for v in values):
            for part in dict.fromkeys(name for m in maps for name in m):
                cells = [_cell(v.get(part) if isinstance(v, Mapping) else None) for v in values]
                columns.append([f"{finding.title} {part}", *cells])
        else:
            columns.append([finding.title, *map(_cell, values)])
    return [column for column in columns if any(cell != "-" for cell in column[1:])]


def _cell(value: Any) -> str:
    """A number, a truth, poles; a dash for what a cell has no room for."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, float, np.number)) and not isinstance(value, complex):
        return number(float(value))
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return _poles(value)
    return "-"


def _poles(values: np.ndarray) -> str:
    """``-1 (3), -2±1j``: each with how often it occurs."""
    rounded = Counter(complex(round(v.real, 3) + 0.0, round(abs(v.imag), 3)) for v in np.asarray(values, dtype=complex))
    parts = []
    for pole, count in list(rounded.items())[:3]:
        times = count // 2 if pole.imag else count
        parts.append(
            f"{pole.real:g}" + (f"±{pole.imag:g}j" if pole.imag else "") + (f" ({times})" if times > 1 else "")
        )
    return ", ".join(parts) + (", ..." if len(rounded) > 3 else "")


def _coordinates(result: Result) -> list[str]:
    """In which coordinates observers correct, those that share them together."""
    labels: dict[str, list[str]] = {}
    for label, o in result.observers.items():
        if o.coordinates is not None:
            labels.setdefault(str(o.coordinates), []).append(label)
    return [f"coordinates of {', '.join(own)}: {text}" for text, own in labels.items()]


def _notes(found: Mapping[str, Findings]) -> list[str]:
    """Reasons and remarks, the same ones of several observers or keys once."""
    reasons: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for key in dict.fromkeys(key for f in found.values() for key in f.reasons):
        texts: dict[str, list[str]] = {}
        for label, f in found.items():
            if key in f.reasons:
                texts.setdefault(f.reasons[key], []).append(label)
        for reason, labels in texts.items():
            reasons.setdefault((reason, tuple(labels)), []).append(key)
    lines = [f"no {', '.join(keys)}{_whose(labels, found)}: {reason}" for (reason, labels), keys in reasons.items()]
    remarks: dict[str, list[str]] = {}
    for label, f in found.items():
        kind = f.values.get("lipschitz_kind")
        own = [f"lipschitz: {kind}; {f.values['lipschitz_region']}"] if kind else []
        for remark in [*own, *f.remarks]:
            remarks.setdefault(remark, []).append(label)
    return lines + [f"{remark}{_whose(labels, found)}" for remark, labels in remarks.items()]


def _whose(labels: Sequence[str], found: Mapping[str, Findings]) -> str:
    return "" if len(labels) == len(found) else f" ({', '.join(map(printable, labels))})"
