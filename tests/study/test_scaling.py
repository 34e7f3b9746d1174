"""Lines of theory in scaling panels against simulation: each agrees, or is refused with its reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from ensembles import numbers
from examples import Block, chain, sinusoid

from hgorun.figures.scaling import ScalingData
from hgorun.study.loading import load_study
from hgorun.study.measured import asked_of
from hgorun.study.scaling import scaling_data

SINUSOID = sinusoid(0.1, 6.0)
HELD = {"type": "gaussian", "std": 0.1, "hold": 0.2}
UNIFORM = {"type": "uniform", "low": -0.1, "high": 0.2, "hold": 0.15}


def scaled(folder: Path, measurement: Block, *, of: str = "amplitude", **more: Any) -> ScalingData:
    """A panel of x2 with theta 4 and 5, on a chain of two unless another plant is given."""
    config: Block = {
        "time": {"end": 30, "output_step": 0.01},
        "plant": chain(2, start=0),
        "measurement": measurement,
        "observers": {"SHGO": {"type": "shgo", "theta": 4}},
        "solver": {"step": 0.005},
        "metrics": {"window": [15, 30]},
        "runs": {"sweep": {"vary": {"name": "theta", "values": [4, 5], "set": {"observers.SHGO.theta": "theta"}}}},
        "figures": {"f": {"panels": [{"scaling": {"state": "x2", "of": of, "theory": True}}]}},
    }
    path = folder / "scaled.yaml"
    path.write_text(yaml.safe_dump(config | more, sort_keys=False))
    study = load_study(path)
    run = study.runs["sweep"]
    return scaling_data(study, "f", {"sweep": numbers(run, asked_of(study, "sweep", (), ("f",)), folder)})[0]


CASES: dict[str, Block] = {
    "continuous": {"noise": SINUSOID},
    "late": {"noise": SINUSOID, "delay": 0.15},
    "sampled": {"noise": SINUSOID, "sampling": {"period": 0.4}},
    "sampled and late": {"noise": SINUSOID, "sampling": {"period": 0.2}, "delay": 0.07},
    "of one output": {"outputs": {"x1": {"noise": SINUSOID}}},
    "two sinusoids of one period": {"noise": sinusoid(0.1, 6.0) + sinusoid(0.1, 12.0, 1.0)},
    "later than the observer bears": {"noise": SINUSOID, "delay": 0.6},
    "held": {"noise": [HELD]},
    "held and late": {"noise": [UNIFORM], "delay": 0.1},
    "drawn at samples": {"noise": [{"type": "gaussian", "std": 0.1}], "sampling": {"period": 0.1, "jitter": 0.02}},
    "expression at samples": {
        "noise": [{"type": "expression", "value": "0.1*sin(t)*cos(5*t)"}],
        "sampling": {"period": 0.1},
    },
}


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("of", ["amplitude", "rmse", "sup", "hf"])
@pytest.mark.parametrize("case", CASES)
def test_the_line_is_what_is_simulated(tmp_path: Path, case: str, of: str) -> None:
    observer = scaled(tmp_path, CASES[case], of=of).observers["SHGO"]
    assert observer.theory is not None, observer.reasons
    np.testing.assert_allclose(observer.theory, observer.measured, rtol=0.02)


@pytest.mark.slow
def test_multiplicative_noise_of_a_plant_that_moves(tmp_path: Path) -> None:
    measurement = {"noise": SINUSOID, "mode": "multiplicative"}
    for more in ({}, {"delay": 0.1}, {"sampling": {"period": 0.1}}):
        plant = chain(2, "-x1", start=[1, 0])
        observer = scaled(tmp_path, measurement | more, plant=plant).observers["SHGO"]
        assert observer.theory is not None, observer.reasons
        np.testing.assert_allclose(observer.theory, observer.measured, rtol=0.03)


@pytest.mark.costly
def test_an_error_without_noise_is_in_the_line(tmp_path: Path) -> None:
    plant = chain(2, "-x1 - x2", start=0) | {"disturbance": {"x2": "sin(t)"}}
    observer = scaled(tmp_path, {"noise": SINUSOID}, plant=plant, of="rmse").observers["SHGO"]
    assert observer.theory is not None
    np.testing.assert_allclose(observer.theory, observer.measured, rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("measurement", "of", "reason"),
    [
        ({}, "amplitude", "no noise"),
        ({"noise": [{"type": "expression", "value": "0.1*sin(t)"}]}, "rmse", "no spectrum"),
        ({"noise": SINUSOID}, "peak", "steady window"),
        ({"noise": [HELD], "delay": "0.1 + 0.05*sin(t)"}, "rmse", "continuous and delayed"),
    ],
)
@pytest.mark.measured("measurement0-amplitude-no noise", "measurement2-peak-steady window")
def test_no_line_without_its_reason(tmp_path: Path, measurement: Block, of: str, reason: str) -> None:
    import re

    observer = scaled(tmp_path, measurement, of=of).observers["SHGO"]
    assert observer.theory is None
    assert re.search(reason, " ".join(observer.reasons))
