"""Many starts of the Lorenz system beside other packages: ``python tests/benchmarks/others.py [MEMBERS]``.

JAX carries out the same steps: ``vmap`` over the members of a ``lax.scan`` over 1,000 RK4 steps, compiled. heyoka's
batch mode controls its steps; hgorun's are fixed. Each is run with several tolerances or steps, and what is compared is
the least time that reaches the accuracy: the largest error of any final state, relative to the largest state. Times are
CPU times of the process. Neither package is needed for anything else: ``pip install '.[bench]'``.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import sweep_cases
from bench import Row, WrongNumbers, at_most, table

from hgorun import Experiment
from hgorun.config.models import Method
from hgorun.engine.member_numbers import MemberNumbers
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.simulate import prepare

ACCURACY = 1e-9
CHECKED = 4096  # members whose errors are looked at
REPEATS = 3
WAYS: tuple[tuple[Method, tuple[float, ...]], ...] = (
    ("rk4", (4e-4,)),
    ("dopri5", (2.5e-3, 1 / 360, 1 / 330)),
)
TOLERANCES = (1e-10, 5e-11, 3e-11, 1e-11)
Solve = Callable[[], np.ndarray]  # the final states, shape (3, members)


def starts(members: int) -> np.ndarray:
    """Near the attractor, shape (3, members)."""
    z0: np.ndarray = np.array([[1.0], [1.0], [20.0]]) + np.random.default_rng(0).normal(size=(3, members))
    return z0


def ours(z0: np.ndarray, method: Method, step: float) -> Solve:
    """The members in lanes, with fixed steps."""
    run = prepare(Experiment(sweep_cases.LORENZ | {"solver": {"method": method, "step": step}}, name="lorenz"))
    plan, start = plan_of(run, as_given(run))
    p, nothing = np.broadcast_to(start.p, (start.p.shape[0], z0.shape[1])), np.zeros(0)
    members = MemberNumbers(z0=z0, p=p, gain=nothing, bias=nothing, holds=plan.holds)
    ensemble = run.structure.ensemble(method)
    return lambda: ensemble.run(plan, members).last


def jax_scan(z0: np.ndarray, steps: int) -> Solve:
    """RK4 in JAX, in double precision."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    jax.config.update("jax_enable_x64", True)
    h = 1.0 / steps

    def slope(state: Any) -> Any:
        x, y, z = state
        return jnp.array([10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z])

    def step(state: Any, _: None) -> tuple[Any, None]:
        k1 = slope(state)
        k2 = slope(state + h / 2 * k1)
        k3 = slope(state + h / 2 * k2)
        k4 = slope(state + h * k3)
        return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), None

    def one(state: Any) -> Any:
        return lax.scan(step, state, None, length=steps)[0]

    run, start = jax.jit(jax.vmap(one, in_axes=1, out_axes=1)), jnp.asarray(z0)
    return lambda: np.asarray(run(start))


def taylor_batches(z0: np.ndarray, tolerance: float) -> Solve:
    """Taylor's method in heyoka's batch mode, with as many members in a batch as it recommends."""
    import heyoka

    x, y, z = heyoka.make_vars("x", "y", "z")
    equations = [(x, 10.0 * (y - x)), (y, x * (28.0 - z) - y), (z, x * y - 8.0 / 3.0 * z)]
    size = heyoka.recommended_simd_size()
    integrator = heyoka.taylor_adaptive_batch(equations, np.zeros((3, size)), tol=tolerance)
    if z0.shape[1] % size:
        raise WrongNumbers(f"heyoka takes members by {size}: give a multiple of that")

    def run() -> np.ndarray:
        last = np.empty_like(z0)
        for first in range(0, z0.shape[1], size):
            integrator.set_time(0.0)
            integrator.state[:] = z0[:, first : first + size]
            integrator.propagate_until(1.0)
            last[:, first : first + size] = integrator.state
        return last

    return run


def fastest(ways: Iterable[tuple[str, Callable[[np.ndarray], Solve]]], z0: np.ndarray, truth: np.ndarray) -> Solve:
    """The one that takes least time of those that are accurate enough, told on stdout."""
    found = []
    for name, way in ways:
        error = float(np.max(np.abs(way(z0[:, : truth.shape[1]])() - truth)) / np.max(np.abs(truth)))
        took = np.nan
        if error <= ACCURACY:
            run = way(z0)
            run()
            took = sweep_cases.cpu(run)
            found.append((took, run))
        print(f"  {name:<18} error {error:.1e}" + (f", {took:.2f} s" if found and took == took else ""), flush=True)
    if not found:
        raise WrongNumbers(f"nothing reaches an accuracy of {ACCURACY:g}")
    return min(found, key=lambda one: one[0])[1]


def beside(members: int) -> Iterator[Row]:
    """The rows of the table."""
    z0, there = starts(members), {name: importlib.util.find_spec(name) is not None for name in ("jax", "heyoka")}
    if there["jax"]:
        same, theirs = ours(z0, "rk4", 1e-3), jax_scan(z0, 1000)
        gap = float(np.max(np.abs(same() - theirs())))
        if not gap <= 1e-9:
            raise WrongNumbers(f"hgorun and JAX differ by {gap:.2g}")
        ratio = sweep_cases.ratio(same, theirs, REPEATS, sweep_cases.cpu)
        note = f"the same 1,000 RK4 steps; they agree to {gap:.0e}"
        yield at_most("Lorenz / JAX scan over members", ratio, 0.5, note)
    else:
        yield Row("Lorenz / JAX scan over members", "skipped", "<= 0.5", None, "jax is not installed")
    if there["heyoka"]:
        truth = taylor_batches(z0[:, :CHECKED], 1e-18)()
        own = [
            (f"{method} {step:.3g}", lambda z, method=method, step=step: ours(z, method, step))
            for method, steps in WAYS
            for step in steps
        ]
        other = [(f"heyoka {tol:g}", lambda z, tol=tol: taylor_batches(z, tol)) for tol in TOLERANCES]
        ratio = sweep_cases.ratio(fastest(own, z0, truth), fastest(other, z0, truth), REPEATS, sweep_cases.cpu)
        yield at_most("Lorenz / heyoka's batch mode", ratio, 1.0, f"errors of at most {ACCURACY:g}, each at its best")
    else:
        yield Row("Lorenz / heyoka's batch mode", "skipped", "<= 1", None, "heyoka is not installed")


def main() -> int:
    parser = argparse.ArgumentParser(description="hgorun's lanes beside JAX and heyoka")
    parser.add_argument("members", nargs="?", type=int, default=131_072)
    members = parser.parse_args().members
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        os.environ["HGORUN_CACHE_DIR"] = str(Path(folder) / "own")
        try:
            rows = list(beside(members))
        except WrongNumbers as error:
            print(f"failed: {error}", file=sys.stderr)
            return 1
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
