"""The observer and the plant of the page on extending hgorun, as a package of their own."""

from __future__ import annotations

from pathlib import Path

import pytest
from outside import blocks_of, code_of, installed
from typed import assert_strictly_typed

import hgorun
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.testing import check_observer, check_plant


def page(*containing: str) -> str:
    return "".join(code_of("extending.md", text) for text in containing)


OBSERVER, PLANT = 'observer("own_ekf")', 'plant("tank")'
TESTS = ("def test_the_filter", "def test_the_tank")


@pytest.mark.costly
def test_the_observer_and_the_plant_run_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        installed(tmp_path / "a", monkeypatch, OBSERVERS, "my_observers", page(OBSERVER), own_ekf="ExtendedKalman"),
        installed(tmp_path / "b", monkeypatch, PLANTS, "my_plants", page(PLANT), tank="Tank"),
    ):
        config = {
            "time": {"end": 10, "output_step": 0.1},
            "plant": {"type": "tank", "inputs": {"q": "0.3 + 0.1*sin(t)"}, "initial": {"h1": 0.5, "h2": 0.4}},
            "measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.02}]},
            "observers": {
                "EKF": {
                    "type": "own_ekf",
                    "r": 0.0004,
                    "q": 0.001,
                    "initial": {"h1": 0.8, "h2": 0.3},
                    "internal": {"P": 0.05},
                }
            },
            "seed": 1,
        }
        result = hgorun.simulate(hgorun.Experiment(config))
        assert result.metrics()["EKF"]["rmse"]["h1"] < 0.03
        assert check_observer(OBSERVERS.find("own_ekf")).left_out.keys() == {"declared rate"}
        assert "slopes" in check_plant(PLANTS.find("tank")).kept


@pytest.mark.costly
def test_the_tests_of_the_page_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        installed(tmp_path, monkeypatch, OBSERVERS, "my_observers", page(OBSERVER, PLANT), own_ekf="ExtendedKalman"),
    ):
        names: dict[str, object] = {}
        exec(page(*TESTS), names)
        for name, test in names.items():
            if name.startswith("test_"):
                assert callable(test)
                test()
        PLANTS.forget("tank")


@pytest.mark.slow
def test_all_code_of_the_page_passes_strict_type_checking(tmp_path: Path) -> None:
    tests = [block for block in blocks_of("extending.md") if "from my_observers import" in block]
    others = [block for block in blocks_of("extending.md") if block not in tests]
    assert len(tests) == len(TESTS)
    files = {"my_observers.py": page(OBSERVER, PLANT), "test_my_observers.py": "".join(tests)}
    files |= {f"block_{i}.py": block for i, block in enumerate(others)}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert_strictly_typed(*(tmp_path / name for name in files))
