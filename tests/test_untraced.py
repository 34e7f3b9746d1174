"""What is drawn is not traced, and what comes after it is again."""

import sys
from types import FrameType

from measured_cases import untraced


def test_tracing_stops_inside_and_goes_on_behind() -> None:
    before, seen = sys.gettrace(), list[str]()

    def trace(frame: FrameType, event: str, _: object) -> None:
        seen.append(frame.f_code.co_name)

    def drawn() -> int:
        return inner()

    def inner() -> int:
        return 3

    def behind() -> None:
        pass

    sys.settrace(trace)
    try:
        value = untraced(drawn)()
        behind()
    finally:
        sys.settrace(before)
    assert value == 3
    assert not {"drawn", "inner"} & set(seen)
    assert "behind" in seen
