"""The demo of closed loops gives what docs/closed_loop.md says of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from shell import Shell

import hgorun
from hgorun import ConfigError
from hgorun.config.expressions import ExpressionError
from hgorun.config.study import Figure
from hgorun.config.sweeps import SweepBlocks
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.figures.drawing import draw
from hgorun.result.quantities.quantities import measure_quantity, read_quantity
from hgorun.study.check import check_figures
from hgorun.study.loading import load_study
from hgorun.tables.metrics import as_json

ROOT = Path(__file__).parents[1]
DEMO = ROOT / "demos" / "closed_loop" / "closed_loop.yaml"
PAGE = (ROOT / "docs" / "closed_loop.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)


@pytest.mark.costly
@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_recovery(row: tuple[str, ...]) -> None:
    theta, *expected = map(float, row)
    base = hgorun.load(DEMO, run="continuous")
    found = hgorun.simulate(base.varied({f"observers.{label}.theta": theta for label in base.observers})).metrics()
    assert [of["recovery"]["x1"] for of in found.values()] == pytest.approx(expected, rel=1e-3)


@pytest.mark.costly
def test_the_example_of_the_page_runs() -> None:
    (text,) = [block for block in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL) if "controller:" in block]
    config = yaml.safe_load(text)
    result = hgorun.simulate(hgorun.Experiment(config | {"time": {"end": 1, "output_step": 0.1}}))
    assert result.status == "ok"
    assert list(result.closed_loop) == ["plant", "SHGO", "FHGO"]


def test_the_noisy_run_and_its_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With hgo_sa, whose samples come at steps of its own."""
    shell = Shell(tmp_path, monkeypatch, capsys)
    code, out, err = shell("simulate", str(DEMO), "--run", "noisy", "--set", "runs.noisy.time.end=2")
    assert (code, err) == (0, "")
    assert "state feedback" in out
    assert "effort u" in out
    result = hgorun.read(shell.folder / "results" / "closed_loop" / "noisy.h5")
    block = Figure.model_validate(
        {"panels": [{"driven": "x1"}, {"input": "u"}, {"error": "x2", "window": [0, 1]}], "columns": 2}
    )
    figure = draw([result], block)
    labels = {line.get_label() for ax in figure.axes for line in ax.lines}
    assert {"state feedback", "HGO-SA", "FHGO"} <= labels
    for ax in figure.axes[:2]:
        (reference,) = [line for line in ax.lines if line.get_label() == "state feedback"]
        shown = result.x[:, 0] if ax is figure.axes[0] else result.u[:, 0]
        assert np.max(np.abs(np.asarray(reference.get_ydata()))) == pytest.approx(np.max(np.abs(shown)))


@pytest.mark.parametrize(
    ("panel", "message"),
    [({"driven": "z"}, "no state is called 'z'"), ({"input": "v"}, "no input is called 'v'")],
)
def test_panels_name_what_there_is(panel: dict[str, str], message: str, tmp_path: Path) -> None:
    config = yaml.safe_load(DEMO.read_text(encoding="utf-8"))
    config["figures"] = {"wrong": {"panels": [panel | {"run": "continuous"}]}}
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(config))
    with pytest.raises(ConfigError, match=message):
        check_figures(load_study(path))


def test_quantities_of_loops() -> None:
    base = hgorun.load(DEMO, run="continuous", overrides=["runs.continuous.time.end=1", "solver.step=2e-3"])
    results = {"continuous": hgorun.simulate(base)}
    loops = results["continuous"].closed_loop

    def value(text: str) -> float:
        return measure_quantity(read_quantity(text, ("continuous",)), results)

    assert value("cost('SHGO')") == loops["SHGO"].cost
    assert value("cost('plant')") == loops["plant"].cost
    assert value("effort('FHGO', u)") == loops["FHGO"].effort[0]
    assert value("peak_input('cascade', u)") == 1.0
    for text, message in (
        ("cost('SHGO', x1)", "takes nothing after"),
        ("effort('SHGO')", "takes an input after"),
        ("recovery('SHGO', x1, 0, 1)", "without a window"),
    ):
        with pytest.raises(ExpressionError, match=message):
            value(text)
    told = as_json(results["continuous"])["closed_loop"]
    assert told["plant"]["cost"] == loops["plant"].cost
    assert told["SHGO"]["effort"] == {"u": loops["SHGO"].effort[0]}
    labelled = results["continuous"].to_xarray()
    np.testing.assert_array_equal(labelled["driven"].sel(observer="SHGO"), loops["SHGO"].x)
    np.testing.assert_array_equal(labelled["driven_u"].sel(observer="FHGO"), loops["FHGO"].u)
    quantities = ["cost('SHGO')", "effort('plant', u)"]
    ensemble = Ensemble(
        name="continuous",
        base=base,
        blocks=SweepBlocks.model_validate({"axes": {"seed": {"count": 2}}, "keep": {"quantities": quantities}}),
    )
    assert [(q.function, q.state) for q in ensemble.quantities] == [("cost", None), ("effort", "u")]
    assert "recovery" in ensemble.metrics


@pytest.mark.parametrize("command", ["analyze", "export"])
def test_what_is_of_an_observer_beside_a_plant_is_refused(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = Shell(tmp_path, monkeypatch, capsys)(command, str(DEMO), "--run", "noisy")
    assert code == 2
    assert "controller" in err
    assert "leave it out" in err
