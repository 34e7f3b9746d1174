"""Signs that stand side by side in an expression: read as mathematics has it, and mistyped as a rule."""

from __future__ import annotations

import re
from collections.abc import Iterator

from hgorun.config.paths import dotted, walk
from hgorun.config.yaml_source import Source

_TWO_SIGNS = re.compile(r"[-+]\s*\+")
_WITH_EXPRESSIONS = ("plant", "controller", "measurement", "observers")


def sign_remarks(source: Source) -> Iterator[str]:
    """A remark for every expression with ``- +`` or ``+ +``; ``- -x`` and ``+ -x`` are what people write."""
    for path, value in walk({key: source.data.get(key) for key in _WITH_EXPRESSIONS}):
        if isinstance(value, str) and (found := _TWO_SIGNS.search(value)):
            yield (
                f"{dotted(path)}: `{value[:60]}`: two signs, `{found.group()}`, stand side by side, and the second "
                "changes nothing: see whether something is missing between them"
            )
