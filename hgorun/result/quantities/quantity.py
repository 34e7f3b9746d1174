"""A quantity that is asked of results: a name, runs and observers, a state, and perhaps a window of time."""

from __future__ import annotations

from dataclasses import dataclass

Of = tuple[tuple[str, str | None], ...]  # (run, observer) each
Window = tuple[float, float] | None


@dataclass(frozen=True)
class Quantity:
    """One call: ``function('run/observer', state, from, to)``.

    Attributes
    ----------
    function : str
    of : tuple of (run, observer)
        The observer is None where the plant itself is meant.
    state : str or None
        A state of the plant, or an input where the quantity is of one; None where it is of neither.
    window : (from, to) or None
    """

    function: str
    of: Of
    state: str | None
    window: Window = None
    key: str | None = None

    def __str__(self) -> str:
        names = ", ".join(f"'{run}/{label}'" if label else f"'{run}'" for run, label in self.of)
        rest = "".join(f", {part}" for part in (self.key, self.state, *(self.window or ())) if part is not None)
        return f"{self.function}({names}{rest})"
