"""What is left out with other versions of libraries: a wrong choice would leave out all that finds a fault."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from chosen_cases import ALL_OF, few_of_a_file, one_case

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


def test_few_are_three_tests_with_all_their_cases_and_all_where_libraries_are_used() -> None:
    others = [f"tests/study/test_a.py::t{k}" for k in range(5)]
    cases = [f"{others[2]}[{k}]" for k in range(4)]
    whole = [f"tests/result/test_b.py::t{k}" for k in range(5)]
    given = items(*others[:2], *cases, *others[3:], "tests/study/test_c.py::alone", *whole)
    assert names(few_of_a_file(given)) == [others[0], *cases, others[4], "tests/study/test_c.py::alone", *whole]


def test_what_is_named_exists() -> None:
    assert [name for name in ALL_OF if not (ROOT / name).exists()] == []
