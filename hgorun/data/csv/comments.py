"""Which lines of a text file are comments."""

from __future__ import annotations

import re
from collections.abc import Collection

from hgorun.data.csv.splitting import SPACES

_CELL_ENDS = re.compile(r"[\t;|,]")


def is_comment(line: str, sign: str, missing: Collection[str], separator: str | None) -> bool:
    """Whether a line begins with the sign of comments, and not with a text for a missing value, such as #N/A.

    Parameters
    ----------
    line, sign : str
    missing : collection of str
        Texts for a missing value, in small letters.
    separator : str or None
        Of cells, so that tabs in front are empty cells where it is the tab; None where it is not yet known.
    """
    tabs = separator == "\t" or (separator is None and "\t" in line.strip())
    start = line.lstrip(" ") if tabs else line.lstrip()
    if not start.startswith(sign):
        return False
    if separator == SPACES:
        first = start.split(maxsplit=1)[0]
    else:  # the sign may be one that ends cells
        rest = start[len(sign) :]
        first = sign + (rest.split(separator, 1) if separator else _CELL_ENDS.split(rest, maxsplit=1))[0]
    return first.strip().lower() not in missing
