"""``figures``: the ``figures:`` blocks of the shipped experiments and of one's own files."""

from __future__ import annotations

import json as json_text
from collections.abc import Sequence
from pathlib import Path

from hgorun.commands.run import RESULTS, execute, refuse_twins, warn
from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError
from hgorun.loading import load
from hgorun.run import Run
from hgorun.shipped import experiments
from hgorun.simulation import prepare


def figures(names: Sequence[str], output: Path | None, *, quiet: bool, json: bool) -> int:
    """Draw the chosen figures, all by default, with the integration error of each run."""
    from hgorun.figures import draw, save

    folder = output or RESULTS / "figures"
    report = []
    for group, run, wanted in _chosen(names):
        experiment = run.experiment
        result = execute(run, quiet or json, check_step=True)
        warn(result)
        error = max((result.integration_error or {}).values(), default=0.0)
        for name in wanted:
            # one folder a publication, or a file of one's own
            written = save(draw(result, experiment.blocks.figures[name], name), folder / group / name)
            report.append(
                {
                    "figure": name,
                    "experiment": experiment.name,
                    "files": [str(f) for f in written],
                    "integration_error": error,
                }
            )
            if not quiet and not json:
                print(f"{name}: {written[0]} (integration error {error:.1e})")
    if json:
        print(json_text.dumps(report, indent=2, allow_nan=False))
    return 0


def _chosen(names: Sequence[str]) -> list[tuple[str, Run, list[str]]]:
    """Experiments with the figures wanted of each; all are checked before any runs."""
    shipped = experiments()
    own = [n for n in names if Path(n).suffix in {".yaml", ".yml"}]
    refuse_twins([Path(n) for n in own])
    patterns = [n.strip("/") for n in names if n not in own]
    chosen: list[tuple[str, Run, list[str]]] = []
    used: set[str] = set()
    known: set[str] = set()
    for path, file in ({} if own and not patterns else shipped).items():
        experiment = load(file)
        known |= {path, experiment.name, *experiment.blocks.figures}
        matching = [p for p in patterns if path == p or path.startswith(f"{p}/") or experiment.name == p]
        named = [f for f in experiment.blocks.figures if f in patterns]
        used |= {*matching, *named}
        wanted = list(experiment.blocks.figures) if matching or not patterns else named
        if wanted:
            chosen.append((path.split("/")[0], prepare(experiment), wanted))
    for pattern in patterns:
        if pattern not in used:
            raise ConfigError(f"no figure or experiment is called {pattern!r}.{nearest(pattern, known)}")
    for name in own:
        experiment = load(name)
        if not experiment.blocks.figures:
            raise ConfigError("the file has no figures: block", file=name, key="figures")
        chosen.append((experiment.name, prepare(experiment), list(experiment.blocks.figures)))
    return chosen
