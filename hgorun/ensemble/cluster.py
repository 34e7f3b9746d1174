"""Blocks of members on the workers of a cluster, by dask.distributed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Any

from hgorun.ensemble.blocks.carried import Carried, carry_out
from hgorun.ensemble.blocks.cuts import Cuts
from hgorun.ensemble.executors import Executor, Flow
from hgorun.ensemble.members.fingerprint import own_code
from hgorun.errors import ConfigError, HgorunError, SimulationError
from hgorun.process import processors
from hgorun.version import __version__

if TYPE_CHECKING:
    from distributed import Client

_AHEAD = 2  # blocks that wait for each worker
_WAIT = 60.0  # seconds for a worker to appear
_ONE = Lock()  # of a worker's process: CasADi's symbols are not for several threads


def dask(scheduler: str | None, jobs: int | None = None) -> Executor:
    """Blocks on the workers of a scheduler.

    A block is begun again elsewhere when its worker dies; that it has been begun twice does not matter.

    Parameters
    ----------
    scheduler : str, optional
        Its address, such as ``tcp://host:8786``; by default a cluster of this machine's processors is started.
    jobs : int, optional
        Workers of that cluster.
    """

    def run(recipe: str, cuts: Cuts, _: Callable[[int], None]) -> Iterator[Carried]:
        client, distributed = _client(scheduler, jobs)
        with client, client.as_current():
            try:
                client.wait_for_workers(1, timeout=_WAIT)
            except TimeoutError:
                raise SimulationError(f"the scheduler {scheduler} has no worker after {_WAIT:g} s") from None
            flow = Flow(cuts, _AHEAD * max(len(client.nthreads()), 1))
            name = hashlib.sha256(recipe.encode()).hexdigest()[:16]
            code = dict(own_code())

            def submit(start: int, stop: int) -> Any:
                key = f"hgorun-{name}-{start}-{stop}"
                return client.submit(on_worker, recipe, start, stop, __version__, code, key=key, pure=True)

            try:
                yield from flow.finished(submit, partial(distributed.wait, return_when="FIRST_COMPLETED"))
            except distributed.KilledWorker as error:
                raise SimulationError(
                    f"workers die again and again: {error}; what is finished is kept: run the command again"
                ) from None
            except (OSError, distributed.CancelledError) as error:
                raise SimulationError(
                    f"the scheduler is gone: {error}; what is finished is kept: run the command again"
                ) from None
            finally:
                with suppress(Exception):  # whoever is gone has nothing left to do
                    client.cancel([f for f in flow.left.values() if isinstance(f, distributed.Future)])

    return run


def on_worker(recipe: str, start: int, stop: int, version: str, code: Mapping[str, str]) -> Carried:
    """Carry members out on a worker, which has to be of the same version.

    Raises
    ------
    SimulationError
        When it is not: its numbers could differ.
    """
    own = own_code()
    if version != __version__ or code != own:
        rooms = ", ".join(sorted(room for room in {*code, *own} if code.get(room) != own.get(room)))
        what = f"hgorun {__version__} instead of {version}" if version != __version__ else f"other code: {rooms}"
        raise SimulationError(f"a worker has {what}; install the same version everywhere")
    with _ONE:
        return carry_out(recipe, start, stop, _threads())


def _threads() -> int:
    """How many threads this worker has."""
    from distributed import get_worker

    try:
        return int(get_worker().state.nthreads)
    except ValueError:  # called outside of a worker
        return 1


def _client(scheduler: str | None, jobs: int | None) -> tuple[Client, Any]:
    try:
        import distributed
    except ImportError as error:
        raise HgorunError("--executor dask needs the package distributed: pip install 'hgorun[dask]'") from error
    if scheduler is None:
        workers = jobs or processors()
        return distributed.Client(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, set_as_default=False
        ), distributed
    try:
        _require_address(scheduler)
        return distributed.Client(scheduler, timeout=_WAIT, set_as_default=False), distributed
    except ValueError as error:
        raise ConfigError(f"--scheduler {scheduler}: not an address such as tcp://host:8786: {error}") from error
    except OSError as error:
        raise HgorunError(f"--scheduler {scheduler}: {error}") from error


def _require_address(scheduler: str) -> None:
    """ValueError where no scheduler can be; a client that finds out itself leaves a thread behind that waits for it."""
    from distributed.comm.addressing import parse_address, parse_host_port

    kind, where = parse_address(scheduler)
    if kind != "inproc":
        parse_host_port(where)
