"""Who appears in a figure: every observer of every result with its label and its look."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hgorun.figures.style import colour
from hgorun.figures.typeset import words
from hgorun.result import ObserverResult, Result


@dataclass(frozen=True)
class Actor:
    """One observer of one result.

    Attributes
    ----------
    order : int
        Place among all observers of all results.
    run : int
        Which result.
    label : str
        Its key in the result.
    text : str
        What legends call it.
    """

    order: int
    run: int
    label: str
    text: str
    result: Result
    observer: ObserverResult

    @property
    def colour(self) -> str:
        """The same in all figures of these results."""
        return colour(self.order)

    def among(self, names: Sequence[str] | None) -> bool:
        """Whether names, ``label`` or ``run/label``, include this observer; None includes all."""
        return names is None or self.label in names or f"{self.result.name}/{self.label}" in names


def cast(results: Sequence[Result]) -> list[Actor]:
    """All observers; with several results labels say which."""
    return list(_cast(results))


def _cast(results: Sequence[Result]) -> Iterator[Actor]:
    order = 0
    for run, (result, name) in enumerate(zip(results, run_names(results), strict=True)):
        for label, observer in result.observers.items():
            text = words(f"{name}: {label}" if len(results) > 1 else label)
            text = f" {text}" if text.startswith("_") else text  # matplotlib would leave it out of legends
            if observer.diverged_at is not None:
                text += " (diverged)"
            yield Actor(order, run, label, text, result, observer)
            order += 1


def run_names(results: Sequence[Result]) -> list[str]:
    """Names of results, numbered where two are called the same."""
    names: list[str] = []
    for result in results:
        name, number = result.name, 2
        while name in names:
            name, number = f"{result.name} ({number})", number + 1
        names.append(name)
    return names
