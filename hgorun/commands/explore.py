"""``explore``: a configuration as a live page."""

from __future__ import annotations

import sys
import tempfile
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path

from hgorun.commands.inputs import configuration
from hgorun.commands.kept import tell_what_runs_keep
from hgorun.commands.outputs import RESULTS, refuse_other_kinds
from hgorun.commands.run_options import Explore
from hgorun.config.reading import read_source
from hgorun.errors import HgorunError
from hgorun.explore.bench import Bench
from hgorun.explore.keeping import Keeper
from hgorun.explore.simulated import SimulatedBench
from hgorun.process import until_interrupted
from hgorun.reproduce.shipped import is_shipped
from hgorun.study.loading import load

_YAML = {".yaml", ".yml"}


def explore(options: Explore) -> int:
    """Serve a page of a configuration until Ctrl-C."""
    refuse_other_kinds(options.output, _YAML)
    config = configuration(options.config, "explore")
    bench = bench_of(config, options.overrides, seed=options.seed, run=options.run)
    tell_what_runs_keep(config, options)
    try:
        from hgorun.explore.server import LivePage
    except ImportError as error:
        raise HgorunError("a live page needs the package bokeh: pip install 'hgorun[explore]'") from error
    page = LivePage(bench, _keeper(bench, options.output), options.port, failed=_failed)
    with _private_address(page.address) as file:

        def ready() -> None:
            print(page.address, flush=True)
            if not options.quiet:
                print("only on this machine, and only with this address; Ctrl-C ends it", file=sys.stderr, flush=True)
            if options.browser and not webbrowser.open(file.as_uri()) and not options.quiet:
                print("no browser could be opened: open the address yourself", file=sys.stderr, flush=True)

        with until_interrupted(page.stop):
            page.serve(ready)
    if not options.quiet:
        print("hgorun: the page is closed", file=sys.stderr)
    return 0


def bench_of(config: Path, overrides: Sequence[str] = (), *, seed: int | None = None, run: str | None = None) -> Bench:
    """A configuration on the bench: of a simulated plant, or of recorded data.

    Raises
    ------
    ConfigError
    """
    text, source = read_source(config, overrides, seed=seed)
    if not isinstance(source.data, dict) or "data" not in source.data:
        return SimulatedBench(config, load(config, overrides, seed=seed, run=run), run)
    from hgorun.commands.estimate import one_run  # a page of a simulated plant is there sooner without
    from hgorun.explore.recordings import RecordedBench

    return RecordedBench.of(config, one_run(source, config, run)[0], text, run)


def _keeper(bench: Bench, output: Path | None) -> Keeper:
    shipped = is_shipped(bench.path)
    if output is not None and output.suffix.lower() in _YAML:
        return Keeper(bench, output.parent, output.name, alone=shipped)
    return Keeper(bench, output or RESULTS, f"{bench.name}.explored.yaml", alone=shipped)


@contextmanager
def _private_address(address: str) -> Iterator[Path]:
    """A file that leads to the address, which nobody else may read: a browser's command line is seen by all users."""
    with tempfile.TemporaryDirectory(prefix="hgorun-explore-") as folder:
        file = Path(folder) / "open.html"
        file.touch(mode=0o600)
        file.write_text(f'<!DOCTYPE html><meta http-equiv="refresh" content="0; url={escape(address, quote=True)}">\n')
        yield file


def _failed(error: Exception) -> None:
    """A fault of ours, in the thread that computes: its traceback, and the page goes on."""
    import traceback

    traceback.print_exception(error)
