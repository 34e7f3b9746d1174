"""Which tests are enough to find out what another version of Python or of a library does not have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pytest

# Where libraries are used directly: types, files, machine code, pages, figures, other programs' systems, symbols,
# processes, command lines, streams. What the rest uses is NumPy's, SciPy's and CasADi's arithmetic, alike in all tests
# of a file.
ROOMS = ("config", "data", "engine", "explore", "figures", "interop", "result", "symbolic")
FILES = ("commands/test_cli.py", "commands/test_mqtt.py", "ensemble/test_cluster.py", "export/test_fmu.py")
ALL_OF = tuple(f"tests/{name}" for name in (*(f"{room}/" for room in ROOMS), *FILES))
OF_OTHERS = 3


def one_case(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Of each test the last case: all of its cases make the same calls."""
    return list({_test(item): item for item in items}.values())


def few_of_a_file(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """Of each file the first test, the last and what lies evenly between them; in the rooms of libraries all."""
    files: dict[str, list[str]] = {}
    for item in items:
        tests = files.setdefault(item.nodeid.partition("::")[0], [])
        if _test(item) not in tests:
            tests.append(_test(item))
    chosen = {test for file, tests in files.items() for test in _few(file, tests)}
    return [item for item in items if _test(item) in chosen]


def _few(file: str, tests: Sequence[str]) -> Iterable[str]:
    if file.startswith(ALL_OF):
        return tests
    return {tests[round(k * (len(tests) - 1) / (OF_OTHERS - 1))] for k in range(OF_OTHERS)}


def _test(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[0]
