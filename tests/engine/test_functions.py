"""The inlined functions against mpmath, and the same bits on 1, 4 and 8 lanes."""

from __future__ import annotations

import ctypes
import importlib.util
import math
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import numpy.typing as npt
import pytest
from mpmath import mp, mpf

from hgorun.engine import functions
from hgorun.engine.ir import Block

Array = npt.NDArray[np.float64]
LANES = (1, 4, 8)
LIMIT = functions.PERIODIC_LIMIT
HUGE = float(np.finfo(np.float64).max)
INF, NAN = math.inf, math.nan

# applies one function to an array of `count` groups of W doubles
LOOP = """
define void @apply_{name}(ptr %x, ptr %y, i64 %count) {{
entry:
  br label %loop
loop:
  %i = phi i64 [0, %entry], [%next, %loop]
  %from = getelementptr {real}, ptr %x, i64 %i
  %to = getelementptr {real}, ptr %y, i64 %i
  %a = load {real}, ptr %from, align 8
  %b = call {real} @hgorun_{name}({real} %a)
  store {real} %b, ptr %to, align 8
  %next = add i64 %i, 1
  %end = icmp eq i64 %next, %count
  br i1 %end, label %done, label %loop
done:
  ret void
}}
"""


class Compiled:
    """All the functions on W lanes."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        declarations: set[str] = set()
        definitions = [functions.function_definition(name, lanes, declarations) for name in functions.INLINE]
        loops = [LOOP.format(name=name, real=Block(lanes, set()).real) for name in functions.INLINE]
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(),
            features=llvm.get_host_cpu_features().flatten(),
            opt=2,
            reloc="pic",
            jit=False,
        )
        module = llvm.parse_assembly("\n".join([*sorted(declarations), *definitions, *loops]))
        module.triple = machine.triple
        module.data_layout = str(machine.target_data)
        module.verify()
        # one lane has to stay one lane: no vectorization of the loops
        tuning = llvm.create_pipeline_tuning_options(speed_level=2)
        tuning.loop_vectorization = False
        tuning.slp_vectorization = False
        passes = llvm.create_pass_builder(machine, tuning)
        passes.getModulePassManager().run(module, passes)
        builder = llvm.JITLibraryBuilder().add_object_img(machine.emit_object(module)).add_current_process()
        for name in functions.INLINE:
            builder.export_symbol(f"apply_{name}")
        self.compiler = llvm.create_lljit_compiler(machine)
        self.library = builder.link(self.compiler, f"functions_{lanes}")

    def __call__(self, name: str, x: npt.ArrayLike) -> Array:
        values = np.asarray(x, dtype=np.float64)
        count = -(-len(values) // self.lanes)
        padded = np.ones(count * self.lanes)
        padded[: len(values)] = values
        y = np.empty_like(padded)
        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
        kind(self.library[f"apply_{name}"])(padded.ctypes.data, y.ctypes.data, count)
        return y[: len(values)]


@pytest.fixture(scope="module")
def compiled() -> dict[int, Compiled]:
    return {lanes: Compiled(lanes) for lanes in LANES}


def neighbours(x: Array, steps: int = 2) -> Array:
    """Each double with those up to so many places beside it."""
    below, above = [x], [x]
    for _ in range(steps):
        below.append(np.nextafter(below[-1], -INF))
        above.append(np.nextafter(above[-1], INF))
    return np.concatenate([*below, *above[1:]])


def multiples_of_pi(shift: float, rng: np.random.Generator) -> Array:
    """The doubles around (k + shift) π, small k and large."""
    k = np.concatenate([np.arange(20), np.exp(rng.uniform(0, math.log(LIMIT / 4), 300)).astype(np.int64)])
    with mp.workprec(160):
        nearest = [float((int(i) + mpf(shift)) * mp.pi) for i in k]
    return neighbours(np.array(nearest))


def points(name: str) -> Array:
    rng = np.random.default_rng(20240501)

    def spread(low: float, high: float, count: int = 1500) -> Array:
        """Evenly in the exponent, of both signs."""
        size = np.exp(rng.uniform(math.log(low), math.log(high), count))
        both: Array = size * rng.choice([-1.0, 1.0], count)
        return both

    if name in ("sin", "cos"):
        parts = [
            np.linspace(-10, 10, 2001),
            # where the largest errors are
            rng.uniform(0.5, 0.6, 1000),
            rng.uniform(1.5, 1.65, 1000),
            spread(1e-300, 1),
            spread(1, 1e9),
            spread(1e9, LIMIT),
            multiples_of_pi(0, rng),
            multiples_of_pi(0.5, rng),
            neighbours(np.array([LIMIT]))[:3],
        ]
    elif name == "exp":
        parts = [
            np.linspace(-1, 1, 1001),
            np.linspace(-746, 710, 3001),
            rng.uniform(-745.2, -708, 1000),
            spread(1e-300, 700),
            neighbours(np.log(2) * np.arange(-1076, 1026) / 2, 1),
        ]
    elif name == "tanh":
        parts = [
            np.linspace(-22, 22, 2001),
            rng.uniform(-1, 1, 2000),
            rng.uniform(0.4, 0.55, 2000),
            spread(1e-300, 20),
            spread(1e-9, 1e-2),
            neighbours(np.log(2) / 2 * (np.arange(60) + 0.75)),
        ]
    else:
        parts = [
            rng.uniform(0.6, 1.5, 3000),
            1 + spread(1e-16, 0.1),
            np.abs(spread(2.0**-1021, HUGE)),
            rng.integers(1, 2**52, 500).view(np.float64),
            neighbours(np.array([math.sqrt(0.5), 1.0, math.sqrt(2), 2.0**-1022])),
            np.array([5e-324, HUGE]),
        ]
    x: Array = np.concatenate(parts)
    return x


def ulps(name: str, x: float, y: float) -> float:
    """The distance of y to the true value in units of the true value's last place."""
    with mp.workprec(160):
        true = getattr(mp, name)(mpf(x))
        unit = mpf(2) ** (max(mp.frexp(true)[1], -1021) - 53)
        return float(abs(mpf(y) - true) / unit)


@pytest.mark.parametrize("name", functions.INLINE)
def test_within_two_ulp(compiled: dict[int, Compiled], name: str) -> None:
    x = points(name)
    y = compiled[8](name, x)
    finite = np.isfinite(y)
    errors = [ulps(name, a, b) for a, b in zip(x[finite].tolist(), y[finite].tolist(), strict=True)]
    assert max(errors) < 2, x[finite][int(np.argmax(errors))]
    # exp alone leaves the range of the doubles
    overflow = x > 709.782712893384 if name == "exp" else np.zeros(len(x), dtype=bool)
    np.testing.assert_array_equal(y[~finite], INF)
    np.testing.assert_array_equal(~finite, overflow)
    if name in ("sin", "cos", "tanh"):
        assert np.abs(y).max() <= 1


@pytest.mark.parametrize("name", functions.INLINE)
def test_same_bits_on_all_lanes(compiled: dict[int, Compiled], name: str) -> None:
    special = [0.0, -0.0, INF, -INF, NAN, -1.0, 5e-324, -5e-324, HUGE, -HUGE]
    x = np.concatenate([points(name), special])
    one = compiled[1](name, x)
    bits = np.where(np.isnan(one), NAN, one).view(np.int64)
    for lanes in LANES[1:]:
        for turn in range(lanes):
            y = np.roll(compiled[lanes](name, np.roll(x, turn)), -turn)
            np.testing.assert_array_equal(np.where(np.isnan(y), NAN, y).view(np.int64), bits)


TINY = [5e-324, 2.0**-1022, 1e-300, 1e-20]
SPECIAL: dict[str, dict[float, float]] = {
    "sin": {0.0: 0.0, INF: NAN, LIMIT * 1.01: NAN, HUGE: NAN, math.pi / 2: 1.0} | {x: x for x in TINY},
    "cos": {0.0: 1.0, INF: NAN, LIMIT * 1.01: NAN, HUGE: NAN, math.pi: -1.0} | dict.fromkeys(TINY, 1.0),
    "exp": {0.0: 1.0, INF: INF, 710.0: INF, HUGE: INF, -745.2: 0.0, -HUGE: 0.0, -INF: 0.0, -745.1: 5e-324}
    | dict.fromkeys(TINY, 1.0),
    "tanh": {0.0: 0.0, INF: 1.0, HUGE: 1.0, 19.1: 1.0} | {x: x for x in TINY},
    "log": {0.0: -INF, INF: INF, -INF: NAN, -1.0: NAN, -5e-324: NAN, -HUGE: NAN, 1.0: 0.0},
}


@pytest.mark.parametrize("lanes", LANES)
@pytest.mark.parametrize("name", functions.INLINE)
def test_special_values(compiled: dict[int, Compiled], name: str, lanes: int) -> None:
    x = np.array([*SPECIAL[name], NAN])
    expected = np.array([*SPECIAL[name].values(), NAN])
    y = compiled[lanes](name, x)
    np.testing.assert_array_equal(y, expected)
    number = ~np.isnan(y)
    np.testing.assert_array_equal(np.signbit(y[number]), np.signbit(expected[number]))


@pytest.mark.parametrize(("name", "sign"), [("sin", -1.0), ("tanh", -1.0), ("cos", 1.0)])
def test_symmetry(compiled: dict[int, Compiled], name: str, sign: float) -> None:
    x = np.concatenate([points(name), [0.0, 5e-324]])
    x = x[np.abs(x) <= LIMIT]
    expected = sign * compiled[4](name, x)
    np.testing.assert_array_equal(compiled[4](name, -x).view(np.int64), expected.view(np.int64))


def test_log_of_negative_zero(compiled: dict[int, Compiled]) -> None:
    assert compiled[4]("log", [-0.0])[0] == -INF


def test_coefficients_are_those_of_the_fit() -> None:
    path = Path(__file__).parents[2] / "tools" / "fit_functions.py"
    specification = importlib.util.spec_from_file_location("fit_functions", path)
    assert specification is not None
    assert specification.loader is not None
    tool: Any = importlib.util.module_from_spec(specification)
    digits = mp.dps
    try:
        specification.loader.exec_module(tool)
        for what in tool.FITS:
            assert tuple(tool.fit(what)[0]) == getattr(functions, what.name), what.name
    finally:
        mp.dps = digits  # the tool sets its own, and mpmath keeps it for the whole process
