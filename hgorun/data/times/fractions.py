"""Fractions of a second that are whole numbers without zeros in front: ``13:45:12.27`` that means 27 ms."""

from __future__ import annotations

import re
from collections.abc import Sequence

_FRACTION = re.compile(r"[0-9]{2}[.,:]([0-9]{1,9})(?:\s?[^\W\d_]\S*|\s?[-+][0-9]{2}:?[0-9]{2})?$")
_FEWEST = 8  # fractions of several digits of which one would begin with 0 by chance


def without_zeros(texts: Sequence[str], pattern: str | None) -> str:
    """The first date whose fraction is most likely a number without its zeros in front; empty where there is none.

    Their widths differ, and some end in 0, so that no zeros were taken off behind; and none of several digits begins
    with 0, as one of ten does.

    Parameters
    ----------
    texts : sequence of str
    pattern : str or None
        None of ISO 8601.
    """
    if pattern is not None and not re.search(r"%S[.,:]%f(?!.*%[HMSdmyYjf])", pattern):
        return ""
    found = [(text, match[1]) for text in texts if text.count(":") > 1 or pattern if (match := _FRACTION.search(text))]
    several = [digits for _, digits in found if len(digits) > 1]
    widths = {len(digits) for _, digits in found}
    zeros = any(digits.startswith("0") for digits in several) or not any(digits.endswith("0") for digits in several)
    if len(several) < _FEWEST or len(widths) < 2 or zeros:
        return ""
    longest = max(widths)
    return next(text for text, digits in found if len(digits) < longest)
