"""Kinds of noise from another package, as the page on extending hgorun has them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from examples import load, prepared, run, said
from outside import code_of, installed

import hgorun
from hgorun.commands.catalogue import list_all, show
from hgorun.commands.catalogue_options import List, Show
from hgorun.commands.schema import build_schema
from hgorun.errors import ConfigError
from hgorun.noise.base import NOISE

CHIRP = {"type": "chirp", "amplitude": 0.1, "omega": 2, "rate": 0.5}
COLOURED = {"type": "coloured", "std": 0.1, "rho": 0.8}


def config(noise: dict[str, Any], **measurement: Any) -> dict[str, Any]:
    return {
        "time": {"end": 20, "output_step": 0.01},
        "plant": {
            "states": ["x1", "x2"],
            "dynamics": {"x1": "x2", "x2": "-x1 - 0.1*x2"},
            "output": "x1",
            "initial": {"x1": 1, "x2": 0},
        },
        "measurement": {"noise": [noise], **measurement},
        "observers": {"A": {"type": "shgo", "theta": 2, "initial": {"x1": 1}}},
    }


@pytest.fixture(autouse=True)
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    code = code_of("extending.md", '"chirp"') + code_of("extending.md", '"coloured"')
    with installed(tmp_path, monkeypatch, NOISE, "my_noise", code, chirp="Chirp", coloured="ColouredNoise"):
        yield


def test_its_values_reach_the_samples_and_the_continuous_output(tmp_path: Path) -> None:
    def chirp(t: np.ndarray) -> np.ndarray:
        return 0.1 * np.sin(2 * t + 0.25 * t**2)

    sampled = run(tmp_path, config(CHIRP, sampling={"period": 0.1}))
    truth = np.interp(sampled.measurements.time, sampled.time, sampled.y[:, 0])
    t = sampled.measurements.time
    np.testing.assert_allclose(sampled.measurements.y[:, 0] - truth, chirp(t), atol=1e-12)
    continuous = run(tmp_path, config(CHIRP))
    np.testing.assert_allclose(continuous.measurements.y - continuous.y, chirp(continuous.time)[:, None], atol=1e-12)
    assert continuous.observers["A"].metrics["rmse"][0] > 0.01


def test_the_automatic_step_follows_it(tmp_path: Path) -> None:
    fast = CHIRP | {"rate": 5}  # 102 rad a time unit at the end
    asked = 2 * np.pi / 102 / 60
    assert asked <= prepared(tmp_path, config(fast)).step < 2 * asked  # the span over a power of two


def test_amplitudes_are_numbers_of_the_same_code(tmp_path: Path) -> None:
    small, large = (prepared(tmp_path, config(CHIRP | {"amplitude": a})) for a in (0.1, 0.7))
    assert small.structure is large.structure


def test_draws_depend_on_the_seed_alone_and_remember(tmp_path: Path) -> None:
    noise = COLOURED | {"std": 1}
    short, long = (
        run(tmp_path, config(noise, sampling={"period": 0.01}), f"time.end={end}").measurements.y[:, 0]
        for end in (10, 40)
    )
    truth = run(tmp_path, config(noise | {"std": 0}, sampling={"period": 0.01}), "time.end=40").measurements.y[:, 0]
    np.testing.assert_allclose(short[:900], long[:900], atol=1e-6)
    v = long - truth
    assert np.corrcoef(v[:-1], v[1:])[0, 1] == pytest.approx(0.8, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "measurement"),
    [
        (COLOURED, {"sampling": {"period": 0.1}}),
        (COLOURED | {"hold": 0.05}, {}),
        (CHIRP, {"sampling": {"period": 0.1}}),
    ],
    ids=["sampled", "held", "function"],
)
def test_the_analysis_predicts_it_along_the_run(
    tmp_path: Path, noise: dict[str, Any], measurement: dict[str, Any]
) -> None:
    found = hgorun.analyze(load(tmp_path, config(noise, **measurement))).observers["A"]
    predicted, measured = said(found)["noise_rms_predicted"], said(found)["noise_rms_measured"]
    for state, value in measured.items():
        assert predicted[state] == pytest.approx(value, rel=0.02)


@pytest.mark.costly
def test_the_analysis_says_why_it_cannot(tmp_path: Path) -> None:
    found = hgorun.analyze(load(tmp_path, config(CHIRP))).observers["A"]
    assert found.reasons["noise_rms_predicted"] == "noise of type chirp has no spectrum that is known"
    assert said(found)["noise_rms_measured"]["x1"] > 0.01


def test_continuous_outputs_need_hold(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"measurement\.noise\.0: coloured noise on a continuous .* needs hold"):
        prepared(tmp_path, config(COLOURED))


def test_wrong_keys_are_told_with_their_line(tmp_path: Path) -> None:
    for noise, message in (
        (CHIRP | {"rat": 1}, r"yaml:\d+: measurement\.noise\.0\.rat: unknown key 'rat'\. Did you mean .rate"),
        (COLOURED | {"rho": 1}, r"yaml:\d+: measurement\.noise\.0\.rho: .*below 1"),
        (
            CHIRP | {"type": "chrip"},
            r"yaml:\d+: measurement\.noise\.0\.type: no noise .* 'chrip'\. Did you mean .chirp",
        ),
        ({"amplitude": 1}, r"yaml:\d+: measurement\.noise\.0: type is missing; one of chirp, coloured, expression"),
        ({"type": "coloured", "rho": 0}, r"yaml:\d+: measurement\.noise\.0\.std: this key is missing"),
    ):
        with pytest.raises(ConfigError, match=message):
            load(tmp_path, config(noise))


@pytest.mark.costly
def test_schema_and_catalogue_know_it(capsys: pytest.CaptureFixture[str]) -> None:
    schema = build_schema()
    jsonschema.validate(config(CHIRP), schema)
    jsonschema.validate(config(COLOURED | {"hold": 0.1}), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(config(CHIRP | {"rat": 1}), schema)
    list_all(List(kind="noise", json=True))
    assert "A sinusoid that gets faster" in json.loads(capsys.readouterr().out)["noise"]["chirp"]
    show(Show(name="coloured", json=True))
    described = json.loads(capsys.readouterr().out)
    assert described["kind"] == "noise"
    assert [key["key"] for key in described["keys"]] == ["hold", "std", "rho"]


def test_the_resolved_configuration_has_all_its_keys(tmp_path: Path) -> None:
    resolved = load(tmp_path, config({"type": "chirp", "amplitude": "1/4", "omega": 1})).resolved()
    assert resolved["measurement"]["noise"] == [{"type": "chirp", "amplitude": 0.25, "omega": 1.0, "rate": 0.0}]
