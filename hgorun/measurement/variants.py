"""What an output is to the observers in a stretch of time."""

from __future__ import annotations

# nothing yet; as it is now; the last sample; as it was a delay ago; observers and plant stand still
SILENT, CONTINUOUS, HELD, DELAYED, FROZEN = range(5)

Variant = tuple[tuple[int, int], ...]  # for each output: what it is, and in which phase


def is_delayed(variant: Variant) -> bool:
    """Whether some output is continuous and late."""
    return any(what == DELAYED for what, _ in variant)
