"""A folder with a pendulum's configuration and its log, for tests of ``hgorun estimate``."""

from pathlib import Path

import numpy as np

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: -sin(a) - 0.1*b}
  output: a
solver: {step: 0.02}
data:
  file: log.csv
  time: t
  outputs: {a: {column: angle, std: 0.02, gate: 6}}
observers:
  o: {type: shgo, theta: 2, poles: -1, initial: {a: 0, b: 1}}
"""


def write(folder: Path) -> None:
    """The configuration, the log, and some more samples of it."""
    rng = np.random.default_rng(5)
    t = np.arange(0, 10, 0.1)
    y = np.sin(t) + 0.02 * rng.standard_normal(t.size)
    lines = [f"{a:.1f},{b:.4f}" for a, b in zip(t, y, strict=True)]
    (folder / "log.csv").write_text("t,angle\n" + "\n".join(lines) + "\n")
    (folder / "more.csv").write_text("t,angle\n2.05,0.88\n3.05,0.09\n")
    (folder / "pendulum.yaml").write_text(CONFIG)
