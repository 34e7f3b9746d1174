"""Which cases of tests are tried: of many alike a part, slow ones in turn, and still fewer with other libraries."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from zlib import crc32

import pytest
from measured_cases import takes_turns

# Where libraries are used directly: types, files, machine code, pages, figures, other programs' systems, symbols,
# processes, command lines, streams. What the rest uses is NumPy's, SciPy's and CasADi's arithmetic, alike in all tests
# of a file.
ROOMS = ("config", "data", "engine", "explore", "figures", "interop", "result", "symbolic")
FILES = (
    "commands/test_cli.py",
    "commands/test_mqtt.py",
    "commands/test_mqtt_messages.py",
    "commands/test_mqtt_sessions.py",
    "ensemble/test_cluster.py",
    "export/test_fmu.py",
)
ALL_OF = tuple(f"tests/{name}" for name in (*(f"{room}/" for room in ROOMS), *FILES))
ALL_CASES = os.environ.get("HGORUN_CASES") == "all"
TURNS = 8
_AS_USERS = ("tests/native/test_quick_code.py",)  # it compares both


def one_in(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Of each test that is marked ``one_in(n)`` every n-th case, and all cases of the others.

    Of several parameters the values are combined as in a Latin square, so that none is always left out; tests of the
    same values begin at different ones.
    """
    items = list(items)
    chosen = {item.nodeid for item in items if _is_tried(item)}
    some = {_test(item) for item in items if item.nodeid in chosen}
    first = {_test(item): item.nodeid for item in reversed(items)}
    chosen |= {name for test, name in first.items() if test not in some}
    return [item for item in items if item.nodeid in chosen]


def _is_tried(item: pytest.Item) -> bool:
    marker = item.get_closest_marker("one_in")
    if marker is None:
        return True
    places = dict(item.callspec.indices)  # type: ignore[attr-defined]  # of what is parametrised
    for names in (mark.args[0] for mark in item.iter_markers("parametrize")):
        for name in (names.split(",") if isinstance(names, str) else names)[1:]:
            places.pop(name.strip(), None)  # it goes with the first
    return (crc32(_test(item).encode()) + sum(places.values())) % marker.args[0] == 0


def in_turn(items: Iterable[pytest.Item], turn: int, *, few: bool = False) -> list[pytest.Item]:
    """Of the cases of slow and costly tests every one of ``TURNS``: others in the next turn, all in as many turns.

    Tests begin at different cases. What is marked ``measured`` is tried in every turn: floors of coverage need it.
    With ``few`` so is what is chosen by its file, which takes a turn itself.
    """
    kept, tried = [], dict[str, int]()
    for item in items:
        test = _test(item)
        if not takes_turns(item) or (few and not item.nodeid.startswith(ALL_OF)):
            kept.append(item)
            continue
        case = tried[test] = tried.get(test, -1) + 1
        if (crc32(test.encode()) + case + turn) % TURNS == 0:
            kept.append(item)
    return kept


def waits(file: str, turn: int) -> bool:
    """Whether another turn is that of a file which does not use libraries directly."""
    return not file.startswith(ALL_OF) and (crc32(file.encode()) + turn) % TURNS != 0


def as_users_get_it(file: str, turn: int | None) -> bool:
    """Whether the tests of a file compile as users' programs are: one of ``TURNS``, and all where no turn is given."""
    return turn is None or ALL_CASES or file in _AS_USERS or (crc32(file.encode()) + turn) % TURNS == 0


def one_case(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Of each test the last case: all of its cases make the same calls."""
    return list({_test(item): item for item in items}.values())


def few_of_a_file(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Of each file the first test and the last; in the rooms of libraries all."""
    files: dict[str, list[str]] = {}
    for item in items:
        tests = files.setdefault(item.nodeid.partition("::")[0], [])
        if _test(item) not in tests:
            tests.append(_test(item))
    chosen = {test for file, tests in files.items() for test in _few(file, tests)}
    return [item for item in items if _test(item) in chosen]


def _few(file: str, tests: Sequence[str]) -> Iterable[str]:
    return tests if file.startswith(ALL_OF) else {tests[0], tests[-1]}


def _test(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[0]
