"""A benchmark as text, Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence

import numpy as np

from hgorun.benchmark.benchmark import Entry
from hgorun.benchmark.intervals import remade, resampled
from hgorun.benchmark.standing import Standing
from hgorun.tables.layout import packed
from hgorun.version import __version__

COLUMNS = (
    "plant",
    "scenario",
    "observer",
    "group",
    "knob",
    "at_end",
    "error",
    "error_low",
    "error_high",
    "steady",
    "peak",
    "converged",
    "time_unit",
    "lost",
    "operations",
    "at_samples",
    "ns_per_step",
    "refused",
)


def text(found: Mapping[tuple[str, str], Standing], scenarios: Sequence[str]) -> str:
    """For a terminal: an observer a row, a scenario a column."""
    labels = _labels(found)
    columns = [[name, *(_cell(found[name, label]) for label in labels)] for name in scenarios]
    lines = packed(labels, [[column] for column in columns], title="error / that of the best")
    return "\n\n".join("\n".join(block) for block in lines)


def markdown(
    found: Mapping[tuple[str, str], Standing], scenarios: Sequence[str], absent: Mapping[str, str] | None = None
) -> str:
    """The same with intervals, for a page; and why others do not take part."""
    lines = ["| observer | " + " | ".join(scenarios) + " |", "|---" * (1 + len(scenarios)) + "|"]
    for label in _labels(found):
        cells = [_with_interval(found[name, label]) for name in scenarios]
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    if absent:
        lines += ["", "Not in it:", "", *(f"- `{name}`: {why}" for name, why in absent.items())]
    return "\n".join([*lines, "", f"hgorun {__version__}", ""])


def table(entries: Sequence[Entry]) -> str:
    """Every entry as a line of CSV."""
    file = io.StringIO()
    writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", restval="")
    writer.writeheader()
    for entry in entries:
        row: dict[str, object] = {
            "plant": entry.plant,
            "scenario": entry.scenario,
            "observer": entry.label,
            "group": entry.group,
            "refused": entry.refused,
            "time_unit": entry.time_unit,
        }
        if (score := entry.score) is not None:
            low, high = remade(resampled(score)) if score.lost < len(score.total) else (math.inf, math.inf)
            row |= {"knob": _short(score.value), "at_end": int(score.at_end), "error": _short(_mean(score.total))}
            row |= {"error_low": _short(low), "error_high": _short(high)}
            row |= {"steady": _short(_mean(score.steady)), "peak": _short(score.peak)}
            row |= {"converged": _short(score.converged), "lost": score.lost}
            row |= {"operations": score.operations, "at_samples": score.at_samples}
            row |= {"ns_per_step": f"{score.nanoseconds:.3g}"}
        writer.writerow(row)
    return file.getvalue()


def _labels(found: Mapping[tuple[str, str], Standing]) -> list[str]:
    return list(dict.fromkeys(label for _, label in found))


def _cell(one: Standing) -> str:
    """The ratio, and of how many plants."""
    return f"{one.ratio:.2f} ({one.plants})" if one.plants else "-"


def _with_interval(one: Standing) -> str:
    if not one.plants:
        return "-"
    lost = f", {one.lost} lost" if one.lost else ""
    return f"{one.ratio:.2f} [{one.low:.2f}, {one.high:.2f}] ({one.plants}{lost})"


def _mean(values: Sequence[float]) -> float:
    """The mean over the seeds that kept the estimate."""
    kept = np.array(values)[np.isfinite(values)]
    return float(kept.mean()) if kept.size else math.inf


def _short(value: float) -> str:
    return f"{value:.5g}"
