"""Fingerprint of everything that the shipped experiments compute, to compare two states of the program bit by bit.

Every run of every file in ``experiments/`` is simulated, all members of ensembles too. Of each result every array
is hashed (SHA-256 of dtype, shape and bytes); metrics, verdicts and the numbers of some analyses stand as they
are, so that a difference shows both numbers. Of an ensemble the first member is written in this way, the others
as one hash for each observer. Texts meant for people (titles, reasons, remarks) are left out.
Only the public surface is used: functions of ``hgorun``, attributes of results, the command line.

    python tools/fingerprint.py --write                      the reference, tests/reference/fingerprint.json
    python tools/fingerprint.py --check                      compare with it; exit code 1 where something differs
    python tools/fingerprint.py --check FILE --only katayama contois_te025
    python tools/fingerprint.py                              print it

Numbers may differ between processors and between versions of the libraries: the file names those that it is of,
and a check says when they are others.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

import hgorun
from hgorun.reproduce.shipped import experiments

ROOT = Path(__file__).resolve().parents[1]
EXPERIMENTS = ROOT / "experiments"
REFERENCE = ROOT / "tests" / "reference" / "fingerprint.json"
PROCESSES = 2
START = 60.0  # seconds within which a worker has to say that it is there
LONGEST = 160  # characters of a value that stands as it is; longer ones are hashed

# (experiment, run) whose analysis is compared, at least one of each kind of theory; None: the file has no runs
ANALYSED: tuple[tuple[str, str | None], ...] = (
    ("robles2023/chapter3/contois_te025", None),
    ("astolfi2016/noise_linear", "slow"),
    ("robles2023/chapter3/academic_fhgo2", "te001"),
    ("robles2023/chapter2/phytoplankton", "ts002"),
    ("robles2023/chapter2/academic_continuous", None),
    ("lee2016/stochastic_approximation", "fixed"),
    ("lee2016/stochastic_approximation", "sa"),
    ("meiners2025/transient_reduction", "one"),
    ("katayama/van_der_pol", "t020"),
)

Entries = dict[str, Any]  # {key: a hash, or a value that JSON can hold}
Task = tuple[Callable[..., Entries], tuple[Any, ...]]


def canonical(value: Any) -> str:
    """The one text of a JSON value; floats as the shortest text that gives the same bits."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def digest(array: np.ndarray) -> str:
    """Hash of dtype, shape and bytes."""
    head = f"{array.dtype.str} {array.shape} ".encode()
    return hashlib.sha256(head + np.ascontiguousarray(array).tobytes()).hexdigest()


def of_text(text: str) -> str:
    """Hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def value_or_hash(value: Any) -> Any:
    """A value as it is where it is short."""
    text = canonical(value)
    return value if len(text) <= LONGEST else of_text(text)


def plain(value: Any) -> Any:
    """As JSON holds it: arrays as lists, numbers that are not finite as text."""
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def of_result(result: hgorun.Result) -> Entries:
    """Everything that a result holds of numbers, but for the estimate of their error."""
    given = result.measurements
    found: Entries = {
        "time": digest(result.time),
        "x": digest(result.x),
        "u": digest(result.u),
        "y": digest(result.y),
        "measurements/time": digest(given.time),
        "measurements/taken": digest(given.taken),
        "measurements/y": digest(given.y),
        "names": [list(names) for names in (result.states, result.inputs, result.outputs)],
        "units": dict(result.units),
        "windows": plain(result.windows),
        "seed": result.seed,
    }
    for label, observer in result.observers.items():
        own: Entries = {
            "type": observer.type,
            "xhat": digest(observer.xhat),
            "dimension": observer.dimension,
            "gains": plain(observer.gains),
            "status": observer.verdict.text(),
            "diverged_at": observer.diverged_at,
        }
        own |= {f"internal/{name}": digest(values) for name, values in observer.internal.items()}
        own |= {f"metrics/{name}": plain(values) for name, values in observer.metrics.items()}
        found |= prefixed(f"observers/{label}", own)
    return {key: value_or_hash(value) for key, value in found.items()}


def folded(result: hgorun.Result) -> Entries:
    """The same as one hash for each observer, and one for all else: members are many."""
    left = of_result(result)
    found: Entries = {}
    for label in result.observers:
        base = f"observers/{label}"
        found[base] = of_text(canonical({key: left.pop(key) for key in list(left) if key.startswith(f"{base}/")}))
    left["integration_error"] = None  # was a part of the hash once
    return found | {"else": of_text(canonical(left))}


def prefixed(prefix: str, entries: Mapping[str, Any]) -> Entries:
    return {f"{prefix}/{key}": value for key, value in entries.items()}


def runs(experiment: str) -> dict[str, Any]:
    return dict(hgorun.load_study(EXPERIMENTS / f"{experiment}.yaml").runs)


def trajectories(experiment: str, name: str) -> Entries:
    """Of a run, or of all members of an ensemble."""
    run = runs(experiment)[name]
    base = f"{experiment}/{name}"
    if run.single:
        return prefixed(base, of_result(hgorun.simulate(run.experiment)))
    found: Entries = {}
    for i, member in enumerate(run.members()):
        result = hgorun.simulate(member)
        found |= prefixed(f"{base}/members/{i:02}", of_result(result) if i == 0 else folded(result))
    return found


def command(*arguments: str) -> Any:
    """What a command of hgorun prints as JSON.

    Raises
    ------
    RuntimeError
        When it fails.
    """
    line = [sys.executable, "-m", "hgorun", *arguments]
    done = subprocess.run(line, capture_output=True, encoding="utf-8", cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"{' '.join(line[1:])}: exit code {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout)


def claims(experiment: str) -> Entries:
    """Verdicts and the numbers that they are from, measured anew in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        rows = command("claims", experiment, "--json", "--jobs", "1", "--output", folder)
    kept = ("verdict", "value", "interval", "members")
    return {f"{experiment}/claims/{row['id']}/{key}": value_or_hash(row[key]) for row in rows for key in kept}


def analysis(experiment: str, run: str | None) -> Entries:
    """What theory says of a run's observers."""
    chosen = () if run is None else ("--run", run)
    told = command("analyze", str(EXPERIMENTS / f"{experiment}.yaml"), "--json", "--no-plots", *chosen)
    base = f"{experiment}/{run or experiment.rpartition('/')[2]}/analysis"
    found: Entries = {}
    for label, values in told["observers"].items():
        numbers = {key: value_or_hash(value) for key, value in values.items() if key not in ("reasons", "remarks")}
        found |= prefixed(f"{base}/{label}", numbers)
    return found


def this_platform() -> dict[str, str]:
    """What numbers may depend on besides the program."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "libc": " ".join(platform.libc_ver()),
        "python": platform.python_version(),
        "cpu": llvm.get_host_cpu_name(),
        "cpu_features": " ".join(sorted(name for name, there in features.items() if there)),
        **{name: version(name) for name in ("numpy", "scipy", "casadi", "llvmlite")},
        "llvm": ".".join(map(str, llvm.llvm_version_info)),
    }


def choose(names: Sequence[str]) -> list[str]:
    """Experiments by path, folder or stem; all by default.

    Raises
    ------
    ValueError
        When a name means nothing.
    """
    every = list(experiments())
    chosen = {name: [e for e in every if f"{e}/".startswith(f"{name}/") or Path(e).name == name] for name in names}
    for name, meant in chosen.items():
        if not meant:
            raise ValueError(f"no experiment is called {name!r}; there are {', '.join(every)}")
    return [e for e in every if not names or any(e in meant for meant in chosen.values())]


def tasks(experiments: Sequence[str]) -> Iterator[Task]:
    """The work in parts, long ones first."""
    yield from ((analysis, (experiment, run)) for experiment, run in ANALYSED if experiment in experiments)
    yield from ((claims, (experiment,)) for experiment in experiments)
    of_all = [(experiment, name, run.single) for experiment in experiments for name, run in runs(experiment).items()]
    yield from ((trajectories, (experiment, name)) for experiment, name, _ in sorted(of_all, key=lambda one: one[2]))


class NoWorkersError(Exception):
    """Processes that were started to do the work cannot do it."""


@contextmanager
def workers() -> Iterator[ProcessPoolExecutor]:
    """Processes that have said that they can import this file; they are ended with the block.

    They are spawned: workers inherit nothing of this process but its environment. One that cannot import what it is
    to do, or that hangs while it tries, would otherwise be waited for, and started again, for ever.

    Raises
    ------
    NoWorkersError
        When a worker ends too early, or does not answer within START seconds.
    """
    pool = ProcessPoolExecutor(PROCESSES, mp_context=multiprocessing.get_context("spawn"))
    try:
        for answer in [pool.submit(this_platform) for _ in range(PROCESSES)]:
            answer.result(timeout=START)
        yield pool
    except BrokenProcessPool as error:
        raise NoWorkersError(f"a worker ended before its work was done: {error}") from error
    except TimeoutError as error:
        raise NoWorkersError(f"the workers did not answer within {START:g} s") from error
    finally:
        started = list((pool._processes or {}).values())  # shutdown alone waits for one that hangs
        pool.shutdown(wait=False, cancel_futures=True)
        for process in started:
            process.kill()


def fingerprint(experiments: Sequence[str]) -> tuple[Entries, list[str]]:
    """All entries of the experiments, and which parts of the work failed.

    Raises
    ------
    NoWorkersError
        When the processes that do the work cannot be started, or die.
    """
    found: Entries = {}
    failed: list[str] = []
    with workers() as pool:
        futures = [(task, pool.submit(task[0], *task[1])) for task in tasks(experiments)]
        for (function, arguments), future in futures:
            error = future.exception()
            if isinstance(error, BrokenProcessPool):
                raise error
            if error is None:
                found |= future.result()
            else:
                failed.append(f"{function.__name__} of {' '.join(map(str, arguments))}: {error}")
    return found, failed


def as_text(entries: Mapping[str, Any]) -> str:
    """The file: sorted, one entry a line."""
    parts = {"platform": this_platform(), "entries": entries}
    blocks = []
    for name, part in parts.items():
        lines = [f"    {canonical(key)}: {canonical(part[key])}" for key in sorted(part)]
        blocks.append(f"  {canonical(name)}: {{\n" + ",\n".join(lines) + "\n  }")
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def compare(stored: Mapping[str, Any], found: Mapping[str, Any]) -> bool:
    """Print what differs, by run; whether nothing does."""
    both = stored.keys() & found.keys()
    # as text: in Python 1 equals 1.0 and 0.0 equals -0.0
    different = {key for key in both if canonical(stored[key]) != canonical(found[key])}
    lists = {
        "different": {key: _change(stored[key], found[key]) for key in different},
        "missing": dict.fromkeys(stored.keys() - found.keys(), ""),
        "new": dict.fromkeys(found.keys() - stored.keys(), ""),
    }
    for name, keys in lists.items():
        print(f"{name}: {len(keys)}")
        for group, own in groupby(sorted(map(_split, keys)), key=lambda pair: pair[0]):
            print(f"  {group}")
            for _, rest in own:
                print(f"    {rest}{keys[f'{group}/{rest}']}")
    print(f"same: {len(both) - len(different)}")
    return not any(lists.values())


def _split(key: str) -> tuple[str, str]:
    """The run or the experiment, and what of it."""
    match = re.fullmatch(r"(.+?)/((?:observers|measurements|analysis|claims)/.+|[^/]+)", key)
    return (match[1], match[2]) if match else ("", key)


def _change(before: Any, after: Any) -> str:
    """Both values, unless they are hashes."""
    texts = [canonical(value) for value in (before, after)]
    return "" if any(re.fullmatch(r'"[0-9a-f]{64}"', text) for text in texts) else f": {texts[0]} -> {texts[1]}"


def other_platform(stored: Mapping[str, str]) -> list[str]:
    """In which ways this platform is not the one of the file."""
    here = this_platform()
    names = sorted(stored.keys() | here.keys())
    return [f"{n}: {stored.get(n)} -> {here.get(n)}" for n in names if stored.get(n) != here.get(n)]


def belongs(key: str, experiments: Iterable[str]) -> bool:
    return any(key.startswith(f"{experiment}/") for experiment in experiments)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group()
    for option in ("--write", "--check"):
        what.add_argument(option, metavar="FILE", type=Path, nargs="?", const=REFERENCE)
    parser.add_argument("--only", metavar="NAME", nargs="+", default=[], help="experiments, or folders of them")
    options = parser.parse_args()
    package = Path(hgorun.__file__).resolve()
    if not package.is_relative_to(ROOT):
        parser.error(f"hgorun comes from {package.parent}, not from {ROOT}: use the Python of its .venv")
    try:
        experiments = choose(options.only)
        stored = None if options.check is None else json.loads(options.check.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        parser.error(str(error))
    # two processes on two processors, and sums whose order does not depend on the number of processors
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    start = time.monotonic()
    try:
        found, failed = fingerprint(experiments)
    except NoWorkersError as error:
        print(f"failed: {error}", file=sys.stderr)
        return 1
    print(f"{len(found)} entries in {time.monotonic() - start:.0f} s", file=sys.stderr)
    for text in failed:
        print(f"failed: {text}", file=sys.stderr)
    if stored is not None:
        others = other_platform(stored["platform"])
        if others:
            print("The platform is another one, numbers may differ for that reason:", *others, sep="\n  ")
        expected = stored["entries"]
        if options.only:
            expected = {key: value for key, value in expected.items() if belongs(key, experiments)}
        return 0 if compare(expected, found) and not failed else 1
    if failed:
        return 1
    if options.write is not None:
        options.write.parent.mkdir(parents=True, exist_ok=True)
        options.write.write_text(as_text(found), encoding="utf-8")
    else:
        print(as_text(found), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
