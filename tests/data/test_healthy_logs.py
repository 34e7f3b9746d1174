"""Logs as plants write them, in which nothing is wrong: they are read without a false word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import recorded, table

K = np.arange(600.0)
NOISE = np.random.default_rng(5).normal(size=600)


def on(period: int, duty: float) -> np.ndarray:
    return np.asarray(K % period < duty * period)


PUMP = np.cumsum(np.where(on(100, 0.6), 43 * (1 + 0.003 * NOISE), 0.0))
HEALTHY = {
    "valve": (np.where(on(50, 0.4), 1.0, 0.0), 0),
    "valve in percent": (np.where(on(70, 0.5), 100.0, 0.0), 1),
    "valve that leaks": (np.where(on(60, 0.5), 99.8, 0.3) + 0.05 * NOISE, 2),
    "flow that is turned on and off": (np.where(on(50, 0.5), 2.0, 0.02), 2),
    "flow that is turned on": (np.where(K > 300, 2.0, 0.02) + 0.004 * NOISE, 3),
    "heater": (np.where(on(40, 0.3), 1500.0, 12.0), 0),
    "set point, steps of ten": (20 + 10 * np.floor(K / 100), 1),
    "set point, steps by ten and a hundred": (np.array([1.0, 100, 1, 100, 10, 1])[(K // 100).astype(int)], 1),
    "level of batches": (np.interp(K % 200, [0, 150, 190, 200], [0.1, 1.9, 1.9, 0.1]) + 0.002 * NOISE, 3),
    "level in steps of a converter": (np.rint((50 + 20 * np.sin(K / 50)) / 0.0244) * 0.0244, 3),
    "scale": (np.interp(K % 150, [0.3, 40, 60.4, 70, 150], [0, 413, 413, 0, 0]), 0),
    "counter": (np.floor(K / 3.7), 0),
    "counter of 16 bits": (np.floor(K * 350) % 65536, 0),
    "totaliser": (PUMP, 0),
    "operating hours": (np.floor(np.cumsum(on(90, 0.4)) / 6) / 10, 1),
    "pH": (7 + 0.4 * np.sin(K / 140), 1),
    "pH that drifts": (7 + 0.001 * np.cumsum(NOISE), 2),
    "thermostat": (59 + np.abs(K % 40 - 20) / 10, 1),
    "thermostat in K": (332.15 + np.abs(K % 40 - 20) / 10 + 0.1 * NOISE, 2),
    "conductivity of a rinse": (np.where(on(200, 0.3), 80.0, 0.5) + 0.02 * NOISE, 2),
    "oxygen": (np.where(on(200, 0.3), 0.1, 20.9) + 0.02 * NOISE, 2),
    "crane": (np.interp(K, [0, 50, 80.5, 200, 260.3, 400, 420], [0, 0, 33.3, 33.3, 12.1, 12.1, 40]), 2),
}
AT_REST = {
    "motor": (np.where(on(300, 0.5), 1450 + NOISE, 0.0), 0),
    "limit": (np.clip(60 + 60 * np.sin(K / 30) + NOISE, 0, 100), 1),
    "night": (np.where(on(144, 0.5), 5 + NOISE, 0.0), 2),
}


@pytest.mark.parametrize("name", HEALTHY)
def test_nothing_is_said_of_a_healthy_log(tmp_path: Path, name: str) -> None:
    values, digits = HEALTHY[name]
    said = [note.message for note in recorded(tmp_path, table(K, values.round(digits))).notes]
    assert [one for one in said if "a machine at rest, a limit, or a sensor that is stuck" not in one] == []


@pytest.mark.parametrize("name", AT_REST)
def test_a_rest_is_told_as_what_it_may_be(tmp_path: Path, name: str) -> None:
    values, digits = AT_REST[name]
    (note,) = recorded(tmp_path, table(K, values.round(digits))).notes
    assert "stretches of equal values, as of a machine at rest, a limit, or a sensor that is stuck" in note.message
