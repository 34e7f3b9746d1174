"""Draw the pictures of the documentation again: ``python tools/images.py [NAME...]``, or ``make images``.

Each is what the commands and files of its page make, or of what is recorded in the repository. The live page's needs
Chromium: ``python tools/explore_picture.py``.
"""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
TARGET = ROOT / "docs" / "images"
TUTORIALS = ROOT / "docs" / "tutorials"
RECORD = ROOT / "experiments" / "benchmark" / "record" / "entries.csv"
_SCENARIOS = ("low noise", "high noise", "sampled", "late", "outliers", "model error")
_DPI, _COLOURS = 180, 128
_PLAIN = {"sampling"}  # drawn by a page's own Python, in the colours of matplotlib


def _hgorun(folder: Path, *words: str | Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "hgorun", *map(str, words)]
    subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)


def _blocks(page: str, language: str) -> list[str]:
    text = (TUTORIALS / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def _files(folder: Path, page: str) -> None:
    """Write the configurations of a page, whose first lines are their names."""
    for block in _blocks(page, "yaml"):
        if name := re.match(r"# (\S+\.yaml)\n", block):
            (folder / name[1]).write_text(block, encoding="utf-8")


def contois(folder: Path) -> Path:
    """The first figure: the README's experiment."""
    _hgorun(folder, "init", "contois_te025")
    _hgorun(folder, "compare", "contois_te025.yaml")
    return folder / "results" / "contois_te025-comparison.png"


def own_plant(folder: Path) -> Path:
    """The pendulum of the first tutorial."""
    _files(folder, "own_plant.md")
    _hgorun(folder, "compare", "pendulum.yaml")
    return folder / "results" / "pendulum-comparison.png"


def noise_scan(folder: Path) -> Path:
    """Errors against theta, of 50 seeds."""
    _files(folder, "noise.md")
    _hgorun(folder, "sweep", "scan.yaml")
    _hgorun(folder, "compare", "results/scan.sweep.h5")
    return folder / "results" / "scan-against-theta.png"


def sampling(folder: Path) -> Path:
    """Errors against period and delay, by the page's own Python."""
    _files(folder, "sampling.md")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    script = "\n".join(_blocks("sampling.md", "python"))
    subprocess.run([sys.executable, "-c", script], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    return folder / "sampling.png"


def closed_loop(folder: Path) -> Path:
    """States and input of every loop of the demo."""
    _hgorun(folder, "figures", ROOT / "demos" / "closed_loop" / "closed_loop.yaml", "-o", "results", "-q")
    return folder / "results" / "closed_loop" / "loops.png"


def differentiators(folder: Path) -> Path:
    """Six differentiators on a noisy sine."""
    _hgorun(folder, "figures", ROOT / "experiments" / "benchmark" / "differentiators.yaml", "-o", "results", "-q")
    return folder / "results" / "differentiators" / "1.png"


def benchmark(folder: Path) -> Path:
    """The fronts of the table of record; nothing is run again."""
    from hgorun.benchmark.contenders import contenders
    from hgorun.figures.benchmark import benchmark as draw
    from hgorun.figures.files import save

    with RECORD.open(encoding="utf-8", newline="") as file:
        entries: list[Any] = [_entry(row) for row in csv.DictReader(file)]
    return save(draw(contenders(entries, _SCENARIOS)), folder / "fronts", ("png",))[0]


def _entry(row: Mapping[str, str]) -> SimpleNamespace:
    """What the figure asks of an entry."""
    score = None
    if not row["refused"]:
        lost, steady = int(row["lost"]), [float(row["steady"] or "nan")]
        score = SimpleNamespace(lost=lost, steady=steady, converged=float(row["converged"] or "nan"))
    names = {"plant": row["plant"], "scenario": row["scenario"], "label": row["observer"], "group": row["group"]}
    return SimpleNamespace(**names, score=score)


_PICTURES: Mapping[str, Callable[[Path], Path]] = {
    made.__name__: made for made in (contois, own_plant, noise_scan, sampling, closed_loop, differentiators, benchmark)
}


def _shrink(source: Path, target: Path) -> None:
    """At most so many points an inch, and fewer colours: pages load faster, and the repository stays small."""
    from matplotlib.colors import to_rgb

    from hgorun.figures.files import reduced
    from hgorun.figures.style import PALETTE

    with Image.open(source) as image:
        part = min(_DPI / image.info["dpi"][0], 1.0)
        size = (round(image.width * part), round(image.height * part))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    own = [] if target.stem in _PLAIN else [np.array(to_rgb(colour)) for colour in PALETTE]
    reduced(small, own, _COLOURS).save(target, optimize=True)


def main(names: list[str]) -> None:
    """Draw those that are named, or all."""
    if unknown := set(names) - set(_PICTURES):
        sys.exit(f"no picture is called {', '.join(sorted(unknown))}; there are {', '.join(_PICTURES)}")
    for name in names or _PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            _shrink(_PICTURES[name](Path(folder)), TARGET / f"{name}.png")
        print(f"docs/images/{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
