"""What holds for all tests: drawn examples are the same each time, and a busy machine makes none of them fail."""

import gc
import os
import signal
import sys
from collections.abc import Generator
from contextlib import nullcontext
from pathlib import Path

import pytest

os.environ.pop("COLUMNS", None)  # workers of pytest-xdist are told another width than what is tested
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does; NumPy reads it when it is imported

from chosen_cases import ALL_CASES, as_users_get_it, few_of_a_file, in_turn, one_case, one_in, waits
from hypothesis import HealthCheck, settings
from measured_cases import Measured, is_wanted, leave_out_drawings
from measured_forks import measure_forks
from quick_code import compiled_quickly

MEASURED = pytest.StashKey[Measured]()

settings.register_profile(
    "repeatable", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")
measure_forks()
gc.disable()  # until all is collected: syntax trees and tests are many objects, of which hardly any is garbage

# what is started in the background of a shell ignores Ctrl-C, and so would all that the tests start and interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--one-case", action="store_true", help="of each test that has several cases, the last one only")
    parser.addoption("--turn", type=int, help="of slow and costly tests a part, others with another number")
    parser.addoption("--few", action="store_true", help="of files that do not use libraries directly, two tests")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Of the files of which few tests are tried only those of this turn are imported."""
    turn = config.getoption("--turn")
    if turn is None or ALL_CASES or not config.getoption("--few") or not collection_path.name.startswith("test_"):
        return None
    return waits(collection_path.relative_to(config.rootpath).as_posix(), turn) or None


@pytest.hookimpl(trylast=True)  # of what -m leaves
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Other versions of Python or of libraries are found out by calls, of which many tests make the same."""
    kept, turn = items if ALL_CASES else one_in(items), config.getoption("--turn")
    if turn is not None and not ALL_CASES:
        kept = in_turn(kept, turn, few=config.getoption("--few"))
    if config.getoption("--one-case"):
        kept = one_case(kept)
    if config.getoption("--few"):
        kept = few_of_a_file(kept)
    if len(kept) < len(items):
        names = {item.nodeid for item in kept}
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in names])
    # what is kept for all of a process, compiled functions above all, is made where it is measured
    items[:] = sorted(kept, key=lambda item: not is_wanted(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    if sys.gettrace() is not None:
        leave_out_drawings()
    thorough = as_users_get_it(item.nodeid.partition("::")[0], item.config.getoption("--turn"))
    with item.session.stash[MEASURED].of(item), nullcontext() if thorough else compiled_quickly():
        return (yield)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Take what is imported and collected out of each search for garbage, of which there are fewer."""
    session.stash[MEASURED] = Measured()
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
