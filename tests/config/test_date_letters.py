"""Patterns of dates in letters are told with percent signs; what they read is what the letters write."""

from __future__ import annotations

from datetime import datetime

import pytest
from pydantic import ValidationError

from hgorun.config.data import Clock
from hgorun.config.date_letters import with_percent


@pytest.mark.parametrize(
    ("letters", "text", "read"),
    [
        ("dd.mm.yyyy hh:mm:ss", "03.04.2025 06:07:08", datetime(2025, 4, 3, 6, 7, 8)),
        ("YYYY-MM-DD", "2025-04-03", datetime(2025, 4, 3)),
        ("dd/MM/yy", "03/04/25", datetime(2025, 4, 3)),
        ("HH:mm", "06:07", datetime(1900, 1, 1, 6, 7)),
        ("HH:MM:SS", "06:07:08", datetime(1900, 1, 1, 6, 7, 8)),
        ("mm:ss", "07:08", datetime(1900, 1, 1, 0, 7, 8)),
        ("yyyy-MM-dd'T'HH:mm:ss.SSSX", "2025-04-03T06:07:08.250+00:00", datetime(2025, 4, 3, 6, 7, 8, 250_000)),
        ("yyyy-mm-ddThh:mm", "2025-04-03T06:07", datetime(2025, 4, 3, 6, 7)),
        ("TT.MM.JJJJ hh:mm", "03.04.2025 06:07", datetime(2025, 4, 3, 6, 7)),
        ("m/d/yyyy h:mm AM/PM", "4/3/2025 6:07 PM", datetime(2025, 4, 3, 18, 7)),
        ("ddd, dd mmm yyyy hh:mm:ss.000", "Thu, 03 Apr 2025 06:07:08.250", datetime(2025, 4, 3, 6, 7, 8, 250_000)),
        ("yyyyMMddHHmmss", "20250403060708", datetime(2025, 4, 3, 6, 7, 8)),
        ("MM/DD/YYYY hh:mm:ss A", "04/03/2025 06:07:08 PM", datetime(2025, 4, 3, 18, 7, 8)),
        ("MM/dd/yyyy hh:mm:ss aa", "04/03/2025 06:07:08 PM", datetime(2025, 4, 3, 18, 7, 8)),
        ("d.m.Y H:i:s", "03.04.2025 06:07:08", datetime(2025, 4, 3, 6, 7, 8)),
        ("n/j/Y g:i A", "4/3/2025 6:07 PM", datetime(2025, 4, 3, 18, 7)),
        ("D, d M Y H:i:s O", "Thu, 03 Apr 2025 06:07:08 +0000", datetime(2025, 4, 3, 6, 7, 8)),
        ("Y-m-dTH:i:s.v", "2025-04-03T06:07:08.250", datetime(2025, 4, 3, 6, 7, 8, 250_000)),
        ("Y-m-d", "2025-04-03", datetime(2025, 4, 3)),
        ("d.m.y H:i", "03.04.25 06:07", datetime(2025, 4, 3, 6, 7)),
        ("H:i", "06:07", datetime(1900, 1, 1, 6, 7)),
    ],
)
def test_letters_stand_for_signs(letters: str, text: str, read: datetime) -> None:
    form = with_percent(letters)
    assert datetime.strptime(text, form).replace(tzinfo=None) == read
    with pytest.raises(ValidationError, match=f"or a pattern with %Y, found .*. Did you mean `{form}`"):
        Clock.model_validate({"column": "t", "format": letters})
    assert Clock.model_validate({"column": "t", "format": form}).format == form


@pytest.mark.parametrize(
    "word", ["isoo", "date", "seconds", "yyyy", "HH24:MI", "ddmmmmmyy", "german", "", "his", "daily", "min", "Ymi"]
)
def test_words_are_no_patterns(word: str) -> None:
    assert with_percent(word) == ""


def test_a_word_may_be_a_mistyped_one() -> None:
    with pytest.raises(ValidationError, match=r"found 'exel'\. Did you mean `excel`"):
        Clock.model_validate({"column": "t", "format": "exel"})
