"""Names in the expressions of a plant that nothing declares, and the keys that do."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress

import casadi as ca

from hgorun.config.expressions import CONSTANTS, ExpressionError, nearest, parse
from hgorun.config.tokens import short
from hgorun.errors import KeyPath, Problem
from hgorun.plants.base import Plant

_UNKNOWN = re.compile(r"`(\w+)` is not known\.")


def require_readable(path: KeyPath, text: str, values: Mapping[str, ca.SX], states: Sequence[str]) -> None:
    """Refuse an equation that cannot be read; of a name that nothing declares the keys are told that do.

    In an output a misspelt state is likelier than an input or a constant, so that the nearest state comes first.

    Parameters
    ----------
    path : tuple
    text : str
        The equation.
    values : mapping
        Symbols by the names that it may use.
    states : sequence of str

    Raises
    ------
    Problem
    """
    try:
        _symbol(path, text, values)
    except Problem as error:
        with suppress(ExpressionError):
            for name in sorted(parse(text).names - values.keys() - CONSTANTS.keys()):
                before, told, listed = error.message.partition(f"`{short(name)}` is not known.")
                if not told:  # another name is reported
                    continue
                as_input, recorded = f"inputs: {{{name}: expression of t}}", f"inputs: {{{name}: column}}"
                declared = f"an input is declared in plant by {as_input}, a constant by {_as_constant(name)}"
                declared = f"{declared}; an input that was recorded, in data by {recorded}"
                if path[1] == "output" and (near := nearest(name, states)):
                    listed = f"{near} States: {', '.join(states)}"
                raise Problem(path, f"{before}{told}{listed}; {declared}") from error
        raise


@contextmanager
def constants_told(block: Plant) -> Iterator[None]:
    """Say where a constant is declared when an input or a disturbance uses a name that nothing declares.

    Raises
    ------
    Problem
        As it came, with more in its message where the plant takes parameters of any name.
    """
    try:
        yield
    except Problem as error:
        found = _UNKNOWN.search(error.message)
        if found is None or block.known_parameters:
            raise
        name = found[1]
        if name in (*block.state_names, *block.output_names):
            told = f"{error.path[1]} has expressions of t and parameters; feedback stands in the block controller"
        else:
            told = f"a constant is declared in plant by {_as_constant(name)}"
        raise Problem(error.path, f"{error.message}; {told}") from error


def _as_constant(name: str) -> str:
    return f"parameters: {{{name}: number}}"


def _symbol(path: KeyPath, text: str, values: Mapping[str, ca.SX]) -> ca.SX:
    """An expression of known names as a symbolic one."""
    try:
        return parse(text, names=values).symbol(values)
    except ExpressionError as error:
        raise Problem(path, str(error)) from error
