"""What is left out with other versions of libraries: a wrong choice would leave out all that finds a fault."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from chosen_cases import ALL_OF, TURNS, as_users_get_it, few_of_a_file, in_turn, one_case, one_in, waits

ROOT = Path(__file__).parents[1]


def items(*names: str) -> list[pytest.Item]:
    return [cast(pytest.Item, SimpleNamespace(nodeid=name)) for name in names]


def names(kept: list[pytest.Item]) -> list[str]:
    return [item.nodeid for item in kept]


def test_one_case_is_the_last_of_each_test() -> None:
    assert names(one_case(items("a.py::t[1]", "a.py::t[2]", "a.py::u", "b.py::t[1]"))) == [
        "a.py::t[2]",
        "a.py::u",
        "b.py::t[1]",
    ]


def test_few_are_two_tests_with_all_their_cases_and_all_where_libraries_are_used() -> None:
    others = [f"tests/study/test_a.py::t{k}" for k in range(5)]
    cases = [f"{others[0]}[{k}]" for k in range(4)]
    whole = [f"tests/result/test_b.py::t{k}" for k in range(5)]
    given = items(*cases, *others[1:], "tests/study/test_c.py::alone", *whole)
    assert names(few_of_a_file(given)) == [*cases, others[4], "tests/study/test_c.py::alone", *whole]


class Cases:
    """What pytest knows of a case of a test of two parameters, the second of which is given with a third."""

    def __init__(self, test: str, a: int, b: int, marks: list[pytest.Mark]) -> None:
        self.nodeid, self.marks = f"{test}[{a}-{b}]", marks
        self.callspec = SimpleNamespace(indices={"a": a, "b": b, "c": b})

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return next(self.iter_markers(name), None)

    def iter_markers(self, name: str) -> Iterator[pytest.Mark]:
        return (mark for mark in self.marks if mark.name == name)


def test_every_third_case_has_every_value_of_every_parameter() -> None:
    marks = [pytest.mark.parametrize("a", []).mark, pytest.mark.parametrize(("b", "c"), []).mark]
    grid = [(a, b) for a in range(3) for b in range(4)]
    some = [cast(pytest.Item, Cases("a.py::t", a, b, [*marks, pytest.mark.one_in(3).mark])) for a, b in grid]
    whole = [cast(pytest.Item, Cases("b.py::t", a, 0, marks)) for a in range(2)]
    kept = [item.nodeid for item in one_in([*some, *whole])]
    assert len(kept) == 12 / 3 + 2  # all where there is no mark
    assert {name[8] for name in kept if name.startswith("a")} == set("012")
    assert {name[10] for name in kept if name.startswith("a")} == set("0123")


def test_of_few_cases_one_is_tried() -> None:
    marks = [pytest.mark.parametrize("a", []).mark, pytest.mark.one_in(9).mark]
    for name in "stuvwxyz":
        assert len(one_in([cast(pytest.Item, Cases(f"a.py::{name}", a, 0, marks)) for a in range(2)])) == 1


def test_what_is_named_exists() -> None:
    assert [name for name in ALL_OF if not (ROOT / name).exists()] == []


class Marked:
    def __init__(self, name: str, *marks: str, cases: tuple[str, ...] = ()) -> None:
        self.nodeid, self.marks = name, [getattr(pytest.mark, mark)(*cases).mark for mark in marks]

    def get_closest_marker(self, name: str) -> pytest.Mark | None:
        return next((mark for mark in self.marks if mark.name == name), None)


def test_in_so_many_turns_every_case_of_a_slow_or_costly_test_is_tried_once() -> None:
    slow = [f"a.py::{test}[{case}]" for test in "pqrs" for case in range(TURNS + 1)]
    slow += [f"b.py::t{k}" for k in range(40)]
    always = ["a.py::fast", "a.py::needed"]
    given = [cast(pytest.Item, Marked(name, ("slow", "costly")[place % 2])) for place, name in enumerate(slow)]
    given += [cast(pytest.Item, Marked(always[0])), cast(pytest.Item, Marked(always[1], "slow", "measured"))]
    named = [cast(pytest.Item, Marked(f"c.py::t[a-{k}]", "slow", "measured", cases=("a-2",))) for k in (1, 2)]
    assert sum(names(in_turn(named, turn)).count("c.py::t[a-2]") for turn in range(TURNS)) == TURNS
    assert sum(names(in_turn(named, turn)).count("c.py::t[a-1]") for turn in range(TURNS)) == 1
    turns = [names(in_turn(given, turn)) for turn in range(7, 7 + TURNS)]
    assert sorted(name for turn in turns for name in turn) == sorted([*slow, *always * TURNS])
    for turn in turns:
        assert {name[6] for name in turn if name.startswith("a.py::") and "[" in name} == set("pqrs")
        assert 0 < sum(name.startswith("b.py") for name in turn) < 40
    assert names(in_turn(given, 7 + TURNS)) == turns[0]


def test_with_few_costly_tests_take_turns_where_their_file_takes_none() -> None:
    """Else a test and its file would have to meet, which most never do."""
    given = [cast(pytest.Item, Marked(f"tests/{room}/test_a.py::t", "costly")) for room in ("study", "result")]
    turns = [names(in_turn(given, turn, few=True)) for turn in range(TURNS)]
    assert sorted(turns, key=len) == [[given[0].nodeid]] * (TURNS - 1) + [names(given)]


def test_files_that_use_no_library_directly_take_turns_and_the_others_do_not_wait() -> None:
    files = [f"tests/study/test_{k}.py" for k in range(40)]
    went = [[file for file in files if not waits(file, turn)] for turn in range(TURNS)]
    assert sorted(file for turn in went for file in turn) == sorted(files)
    assert min(map(len, went)) > 0
    assert not any(waits("tests/result/test_a.py", turn) for turn in range(TURNS))


def test_in_so_many_turns_every_file_is_compiled_once_as_users_get_it() -> None:
    files = [f"tests/study/test_{k}.py" for k in range(40)]
    thorough = [[file for file in files if as_users_get_it(file, turn)] for turn in range(TURNS)]
    assert sorted(file for turn in thorough for file in turn) == sorted(files)
    assert min(map(len, thorough)) > 0
    assert all(as_users_get_it(file, None) for file in files)
