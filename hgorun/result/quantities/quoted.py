"""Names of observers in texts of quantities: in quotes, or without where nothing else can be meant."""

from __future__ import annotations

import re
from collections.abc import Collection

from hgorun.config.expressions import ExpressionError, nearest
from hgorun.result.quantities.quantities import kinds

_BARE = re.compile(r"\b([A-Za-z_]\w*)\s*\(((?:\s*'[^']*'\s*,)*)\s*([^\s'\"(),][^'\"(),]*?)\s*(?=[,)])")
_PAIRS = re.compile(r"'[^']*'|\"([^\"']*)\"")


def quoted(text: str, labels: Collection[str]) -> str:
    """The same with quotes around labels that stand where a quantity has names: nothing else can be meant there.

    Parameters
    ----------
    text : str
        Quotes may be of both kinds.
    labels : collection of str
        Those of observers, which are known without quotes where they are identifiers.

    Raises
    ------
    ExpressionError
        Where something else stands there.
    """
    before, text = "", _PAIRS.sub(lambda match: match[0] if match[1] is None else f"'{match[1]}'", text)
    while before != text:  # a quantity of two observers has two
        before, text = text, _BARE.sub(lambda match: _with_quotes(match, labels), text)
    return text


def _with_quotes(call: re.Match[str], labels: Collection[str]) -> str:
    """A call up to its first name without quotes, with quotes."""
    kind, (function, quoted, name) = kinds().get(call[1]), call.groups()
    if kind is None or kind.of_plant or quoted.count("'") // 2 >= kind.names:
        return call[0]
    right = f"{function}({quoted} '{name}'" if quoted else f"{function}('{name}'"
    if name.isidentifier() and kind.takes(name, labels):
        return right
    if quoted and name not in labels:  # a state, it may be
        return call[0]
    near = nearest(name, labels) if name not in labels else ""
    known = f"{near} Known: {', '.join(labels)}" if labels else ""
    raise ExpressionError(
        f"{call[0]}, ...): {name!r} is no observer's label that may be without quotes; names with a run, or of other "
        f"characters than letters and digits, stand in quotes: {right}, ...).{known}"
    )
