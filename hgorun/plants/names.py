"""Names of a plant's states, of a block that nobody has checked yet: for examples in messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hgorun.plants.base import PLANTS


def states_of(block: Mapping[str, Any]) -> list[str]:
    """As far as the block says them or its type is known."""
    given, name = block.get("states"), block.get("type")
    if isinstance(given, list):
        return [str(state) for state in given]
    return list(PLANTS.find(name).model_construct().state_names) if name in PLANTS.names() else []
