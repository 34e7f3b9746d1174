"""Numbers with their uncertainty, so many digits as that leaves."""

from __future__ import annotations

import math
import re

from hgorun.tables.layout import number

_DIGITS = 15  # of a number, at most: more are those of rounding
_FIXED = (1e-4, 1e6)  # numbers between are written without an exponent; below, those without uncertainty have one, too


def uncertain(value: float, half: float) -> str:
    """A number and half the width of its interval.

    >>> uncertain(0.123456, 0.0056), uncertain(1.23456e-7, 2e-9), uncertain(3.0, float("nan"))
    ('0.1235 ± 0.0056', '(1.235 ± 0.020)e-07', '3.000')
    """
    parts = _parts(value, half)
    if parts is None:
        return number(value)
    mean, error, exponent = parts
    return f"{mean} ± {error}" if exponent == 0 else f"({mean} ± {error})e{exponent:+03d}"


def mean_and_half(value: float, half: float) -> tuple[str, str]:
    """The same in two columns, with a dash for what is not known.

    >>> mean_and_half(0.123456, 0.0056), mean_and_half(1.23456e-7, 2e-9), mean_and_half(3.0, float("nan"))
    (('0.1235', '0.0056'), ('1.235e-07', '0.020e-07'), ('3.000', '-'))
    """
    parts = _parts(value, half)
    if parts is None:
        mean, error = ("-" if math.isnan(one) else number(one) for one in (value, half))
        return mean, error
    mean, error, exponent = parts
    power = "" if exponent == 0 else f"e{exponent:+03d}"
    return mean + power, error + power


def latex_uncertain(value: float, half: float, *, bold: bool = False) -> str:
    r"""The same as LaTeX, with the number bold if asked for; two dashes where there is none.

    >>> latex_uncertain(1.23456e-7, 2e-9, bold=True)
    '$(\\mathbf{1.235} \\pm 0.020) \\times 10^{-7}$'
    """
    if math.isnan(value):
        return "--"
    if math.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    parts = _parts(value, half)
    if parts is None:
        mean, error, exponent = number(value), "", 0
    else:
        mean, error, exponent = parts
    mean, error = (re.sub(r"e([-+])0*(\d+)", _power, text) for text in (mean, error))
    mean = rf"\mathbf{{{mean}}}" if bold else mean
    both = rf"{mean} \pm {error}" if error else mean
    return f"${both}$" if exponent == 0 else rf"$({both}) \times 10^{{{exponent}}}$"


def _power(match: re.Match[str]) -> str:
    return rf" \times 10^{{{match[1].strip('+')}{match[2]}}}"


def _parts(value: float, half: float) -> tuple[str, str, int] | None:
    """Both as text, and the power of ten that they have in common; None where there is no uncertainty to show."""
    if not (math.isfinite(value) and math.isfinite(half) and half > 0):
        return None
    largest = max(abs(value), half)
    exponent = 0 if _FIXED[0] <= largest < _FIXED[1] else math.floor(math.log10(largest))
    value, half, largest = (part / 10.0**exponent for part in (value, half, largest))
    decimals = 1 - math.floor(math.log10(half))  # two digits of the uncertainty
    most = _DIGITS - 1 - math.floor(math.log10(largest))
    if decimals > most:  # it is smaller than what is shown of the number
        return f"{value:.{max(most, 0)}f}", f"{half:.1e}", exponent
    mean, error = (f"{round(part, decimals):.{max(decimals, 0)}f}" for part in (value, half))
    return mean, error, exponent
