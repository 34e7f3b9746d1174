"""What measurements take of memory, for the limit that a configuration sets."""

from __future__ import annotations

SAMPLE_BYTES = 250  # of memory that a sample takes in the end: its times and numbers, its event
EVENT_BYTES = 1000  # that an event takes where the tables of all events are made at once
COUNTABLE = 1e12  # samples or changes: more are not worth counting
DRAW_BYTES = 16  # that a draw takes until those that a stretch needs are left
