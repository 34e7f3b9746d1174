"""What an installation is: one version everywhere, and imports that are made only where they are used."""

import math
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

import hgorun
from hgorun.version import RELEASED

ROOT = Path(__file__).parents[1]

HEAVY = (
    "casadi",
    "dask",
    "h5py",
    "llvmlite",
    "matplotlib",
    "numpy",
    "pydantic",
    "scipy",
    "sympy",
    "xarray",
    "yaml",
)
# these cost 0.6 to 1 s each, more than all the rest of a simulation
NEVER_NEEDED_TO_SIMULATE = ("dask", "matplotlib", "scipy", "sympy", "xarray")
# and these together some 5 % of a short run
NEEDED_BY_OTHERS = (
    "hgorun.engine.adaptive",
    "hgorun.engine.rosenbrock",
    "hgorun.figures.scaling",
    "hgorun.native.functions.power",
    "hgorun.observers.kalman",
    "hgorun.observers.levant",
    "hgorun.observers.red",
    "hgorun.result.evaluation.columns",
    "hgorun.result.reading",
    "hgorun.simulation.error_control.control",
    "hgorun.simulation.divergence.escape",
    "hgorun.simulation.divergence.why_diverged",
    "hgorun.symbolic.enclosures",
    "hgorun.tables.latex",
    "numpy.ma",
)

CONFIG = """
time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -x1 + u}
  inputs: {u: abs(sin(t))}
  output: x1
  initial: {x1: 1, x2: 0}
measurement:
  sampling: {period: 0.25}
  delay: 0.1
  noise: [{type: gaussian, std: 0.01}]
observers:
  SHGO: {type: shgo, theta: 2}
  FHGO: {type: fhgo2, theta: 2, r: 1}
solver: {step: 1.0e-2}
"""


def imported(program: str, watched: tuple[str, ...], *arguments: str | Path) -> set[str]:
    """Which of these packages and modules a program leaves in sys.modules, in a process of its own."""
    script = f"{program}\nimport sys\nprint('MODULES', *sorted({{*sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = next(line for line in done.stdout.splitlines() if line.startswith("MODULES"))
    return set(found.split()) & set(watched)


def test_there_is_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert hgorun.__version__ == project["version"] == citation["version"] == version("hgorun")
    assert re.fullmatch(r"\d+\.\d+\.\d+", hgorun.__version__)
    assert str(citation["date-released"]) == RELEASED


def test_the_citation_has_what_the_format_requires() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    for entry in (citation, *citation["references"]):
        assert entry["title"]
        assert all(author.keys() & {"family-names", "name"} for author in entry["authors"])
    assert len(citation["references"]) == 5


@pytest.mark.costly
def test_import_costs_nothing() -> None:
    assert imported("import hgorun", HEAVY) == set()


@pytest.mark.costly
def test_the_command_line_costs_nothing_before_a_command_runs() -> None:
    assert imported("import hgorun.cli", HEAVY) == set()


@pytest.mark.costly
@pytest.mark.parametrize(
    "program",
    [
        "import hgorun\nhgorun.simulate(hgorun.load(sys.argv[1]))",
        "from hgorun.cli import main\nsys.argv[1:] = ['simulate', *sys.argv[1:], '-o', sys.argv[1] + '.h5']\n"
        "try:\n  main()\nexcept SystemExit as end:\n  assert not end.code, end.code",
    ],
    ids=["python", "command line"],
)
def test_a_simulation_imports_only_what_it_needs(program: str, tmp_path: Path) -> None:
    config = tmp_path / "config.yaml"
    config.write_text(CONFIG)
    found = imported(f"import sys\n{program}", (*HEAVY, *NEEDED_BY_OTHERS), config)
    assert "casadi" in found  # it did simulate
    assert not found & {*NEVER_NEEDED_TO_SIMULATE, *NEEDED_BY_OTHERS}


@pytest.mark.costly
def test_an_estimate_of_a_log_with_dates_needs_no_masked_arrays(tmp_path: Path) -> None:
    config = tmp_path / "config.yaml"
    rows = [f"2024-05-31T13:45:{second:02d},{math.cos(second):.6f}" for second in range(50)]
    (tmp_path / "log.csv").write_text("\n".join(["t,y", *rows, ""]))
    plant = "plant: {states: [a, b], dynamics: {a: b, b: -a}, output: a}\n"
    data = "data: {file: log.csv, time: t, outputs: {a: {column: y}}}\n"
    config.write_text(plant + data + "observers: {o: {type: shgo, theta: 2}}\n")
    command = "sys.argv[1:] = ['estimate', sys.argv[1], '--no-plots', '-q', '-o', sys.argv[1] + '.h5']"
    program = f"import sys\nfrom hgorun.cli import main\n{command}\ntry:\n  main()\nexcept SystemExit as end:\n"
    assert imported(f"{program}  assert not end.code, end.code", ("casadi", "numpy.ma"), config) == {"casadi"}


def test_shipped_experiments_are_part_of_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["packages"] == ["hgorun"]
    example = {"demos/fermentation": "hgorun/demos/fermentation"}
    assert wheel["force-include"] == {"experiments": "hgorun/experiments", **example}
