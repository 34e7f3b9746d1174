"""What a shell completes, asked as bash asks it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun.cli import app
from hgorun.commands import completion

MINE = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {"S 1": {type: shgo, theta: 2}}
runs: {slow: {observers.S 1.theta: 1}, fast: {}}
"""


@pytest.fixture
def complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):  # type: ignore[no-untyped-def]  # a function of a line
    (tmp_path / "mine.yaml").write_text(MINE)
    (tmp_path / "mine.h5").touch()
    (tmp_path / "log.csv").touch()
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)

    def words(line: str) -> list[str]:
        monkeypatch.setenv("_HGORUN_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setattr("sys.argv", ["hgorun"])
        with pytest.raises(SystemExit):
            app(prog_name="hgorun")
        return capsys.readouterr().out.split("\n")[:-1]

    return words


@pytest.mark.parametrize(
    ("line", "some", "none"),
    [
        ("hgorun ", {"simulate", "analyze", "init"}, set()),
        ("hgorun si", {"simulate"}, {"analyze"}),
        ("hgorun simulate --se", {"--set", "--seed"}, {"--strict"}),
        ("hgorun simulate ", {"mine.yaml", "folder/", "contois_te025"}, {"mine.h5", "log.csv"}),
        ("hgorun simulate m", {"mine.yaml"}, {"contois_te025"}),
        ("hgorun compare ./m", {"./mine.yaml", "./mine.h5"}, set()),
        ("hgorun rerun ", {"mine.h5", "folder/"}, {"mine.yaml"}),
        ("hgorun estimate mine.yaml ", {"log.csv"}, {"mine.yaml"}),
        ("hgorun show ", {"contois", "shgo", "gaussian", "rmse", "theta_bound", "contois_te025"}, set()),
        ("hgorun list pl", {"plants"}, {"observers"}),
        ("hgorun compare mine.yaml --format l", {"latex"}, {"csv"}),
        ("hgorun claims robles2023", {"robles2023"}, set()),
        ("hgorun simulate mine.yaml --run ", {"slow", "fast"}, set()),
        ("hgorun analyze mine.yaml --set plant.", {"plant.initial.x1=", "plant.parameters="}, {"seed="}),
        ("hgorun simulate mine.yaml --set s", {"seed=", "solver.step="}, {"time.end="}),
        ("hgorun simulate missing.yaml --set t", {"time.end="}, set()),
        ("hgorun init f", {"fermentation"}, {"contois_te025"}),
    ],
)
def test_words(complete, line: str, some: set[str], none: set[str]) -> None:  # type: ignore[no-untyped-def]  # as above
    found = set(complete(line))
    assert some <= found
    assert not none & found
    assert all(word.startswith(line.rsplit(" ", 1)[1]) for word in found)


class Line:
    """What is on the line before the word that is completed."""

    def __init__(self, *arguments: str) -> None:
        self.args, self.params = list(arguments), {"config": None}


def test_keys_are_those_of_the_file_and_those_that_it_leaves_out(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(MINE)
    line = Line(str(tmp_path / "mine.yaml"))
    found = completion.keys(line, "observers.S 1.")  # type: ignore[arg-type]  # as much of a context as is read
    assert {"observers.S 1.theta=", "observers.S 1.nested.M=", "observers.S 1.poles="} <= set(found)
    assert completion.labels(line, "") == ["S 1"]  # type: ignore[arg-type]  # as above
    (tmp_path / "mine.yaml").write_text("observers: [1")
    assert "seed=" in completion.keys(line, "")  # type: ignore[arg-type]  # as above
    assert completion.labels(line, "") == []  # type: ignore[arg-type]  # as above
