"""What the tutorials show is what happens, on the page and in the notebook that is made of it."""

from __future__ import annotations

import doctest
import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from chosen_cases import ALL_CASES
from shell import Shell
from site_notebooks import notebook, write
from site_steps import steps

from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "docs" / "tutorials" / "own_package.md"
TUTORIALS = sorted(set((ROOT / "docs" / "tutorials").glob("*.md")) - {PACKAGE})
SHORT = ROOT / "docs" / "tutorials" / "own_log.md"
LIKE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def told(shown: str, out: str) -> None:
    """What a page says is printed is what is printed, dots standing for anything."""
    assert not shown or doctest.OutputChecker().check_output(shown.rstrip("\n") + "\n", out, LIKE), out


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS, ids=[page.stem for page in TUTORIALS])
def test_a_tutorial_prints_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell, names = Shell(tmp_path, monkeypatch, capsys), dict[str, object]()
    for step in steps(page.read_text(encoding="utf-8")):
        if step.kind == "file":
            (tmp_path / step.name).write_text(step.text)
        elif step.kind == "command":
            for line in step.text.splitlines():
                code, out, err = shell(*shlex.split(line)[1:])
                assert code == 0, err
            told(step.shown, out)
        elif step.kind == "python":
            exec(step.text, names)
            told(step.shown, capsys.readouterr().out)


# A kernel and its commands are processes, each of which imports all; the longer pages have theirs with all cases.
@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS if ALL_CASES else [SHORT], ids=lambda page: page.stem)
@pytest.mark.filterwarnings("ignore")  # of Jupyter's own
def test_the_notebook_of_a_tutorial_runs_and_prints_what_the_page_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import nbclient
    import nbformat

    program = tmp_path / "bin" / "hgorun"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m hgorun "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    text = page.read_text(encoding="utf-8")
    found = nbformat.reads(notebook(text), as_version=4)  # type: ignore[no-untyped-call]  # nbformat has no types
    nbformat.validate(found)
    nbclient.NotebookClient(found, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    cells = [cell for cell in found.cells if cell.cell_type == "code"]
    done = [step for step in steps(text) if step.kind in ("file", "command", "python")]
    for step, cell in zip(done, cells, strict=True):
        out = "".join(output.get("text", "") for output in cell.outputs)
        told(step.shown, out)
        assert step.kind != "command" or "hgorun: " not in out, out  # a shell's exit code stops no notebook


@pytest.mark.slow
def test_the_package_of_the_tutorial_is_found_and_keeps_the_contract(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    try:
        for step in steps(PACKAGE.read_text(encoding="utf-8")):
            words = shlex.split(step.text) if step.kind == "command" else [""]
            if step.kind == "file":
                (tmp_path / step.name).write_text(step.text)
            elif words[0] == "pip":
                for folder in (tmp_path, _installed(tmp_path)):
                    monkeypatch.syspath_prepend(folder)
            elif words[0] == "pytest":
                environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])}
                subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, env=environment, check=True)
            elif words[0] == "hgorun":
                code, out, err = shell(*words[1:])
                assert (code, err) == (0, "")
                told(step.shown, out)
    finally:
        sys.modules.pop("my_lab", None)
        OBSERVERS.forget("leaky")
        PLANTS.forget("levitation")


def _installed(folder: Path) -> Path:
    """Where pip would leave the names of the package in a folder, in entry points."""
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    info = folder / "installed" / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    text = "".join(f"[{group}]\n" + "".join(f"{n} = {v}\n" for n, v in of.items()) for group, of in groups)
    (info / "entry_points.txt").write_text(text)
    return info.parent


def test_notebooks_are_of_pages_without_packages(tmp_path: Path) -> None:
    written = write(ROOT / "docs" / "tutorials", tmp_path / "notebooks")
    assert {file.stem for file in written} == {page.stem for page in TUTORIALS}


PAGE = """
# A page

Write

```yaml
# a.yaml
x: 1
```

    hgorun simulate a.yaml
    hgorun compare a.yaml

- a list

    which goes on

```python
print(1 + 1)
```

```text
2
```

    $ hgorun list
    plants:
    ...

    $ hgorun show shgo
"""


def test_the_steps_of_a_page() -> None:
    found = [(step.kind, step.text.split("\n")[0], step.shown) for step in steps(PAGE) if step.kind != "text"]
    assert found == [
        ("file", "# a.yaml", ""),
        ("command", "hgorun simulate a.yaml", ""),
        ("command", "hgorun compare a.yaml", ""),
        ("python", "print(1 + 1)", "2\n"),
        ("command", "hgorun list", "plants:\n..."),
        ("command", "hgorun show shgo", ""),
    ]
    assert "".join(step.text for step in steps(PAGE) if step.kind == "text").count("which goes on") == 1
