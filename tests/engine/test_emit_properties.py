"""Random expressions in machine code against numpy: every operation, every number of lanes, any double.

A random graph of CasADi operations is compiled with every node as an output. Each node is then compared with
numpy's operation on the values that the machine code gave for its arguments, so an error of one operation is
neither hidden nor magnified by those that follow.
"""

from __future__ import annotations

import ctypes
import math
import platform
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import llvmlite.binding as llvm
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun.engine.emit import emit
from hgorun.errors import HgorunError
from hgorun.native.compiler import NativeModule, _target_machine
from hgorun.native.elementary import apply
from hgorun.symbolic.instructions import read
from hgorun.symbolic.interpreter import carry_out, steps_of

Array = npt.NDArray[np.float64]
LANES = (1, 2, 4, 8, 16)
POINTS = 16
INF, NAN = math.inf, math.nan
SIZES = {"t": 1, "p": 2, "z": 3, "w": 2}

EXACT, OURS, NUMPYS = 0, 2, 4  # units in the last place; numpy's own vector functions claim 4


@dataclass(frozen=True)
class Operation:
    """What one of CasADi's operations means, and how many units in the last place it may be off."""

    reference: Callable[..., Any]
    ulp: int = EXACT


def truth(condition: Callable[..., npt.NDArray[np.bool_]]) -> Operation:
    return Operation(lambda *x: np.where(condition(*x), 1.0, 0.0))


UNARY: dict[int, Operation] = {
    ca.OP_NEG: Operation(np.negative),
    ca.OP_SQ: Operation(np.square),
    ca.OP_TWICE: Operation(lambda x: 2 * x),
    ca.OP_INV: Operation(lambda x: 1 / x),
    ca.OP_FABS: Operation(np.abs),
    ca.OP_SQRT: Operation(np.sqrt),
    ca.OP_FLOOR: Operation(np.floor),
    ca.OP_CEIL: Operation(np.ceil),
    ca.OP_NOT: truth(lambda x: x == 0),
    ca.OP_SIGN: Operation(lambda x: np.where(x == 0, x, np.sign(x))),
    ca.OP_SIN: Operation(np.sin, OURS),
    ca.OP_COS: Operation(np.cos, OURS),
    ca.OP_TANH: Operation(np.tanh, OURS),
    ca.OP_EXP: Operation(np.exp, OURS),
    ca.OP_LOG: Operation(np.log, OURS),
    ca.OP_TAN: Operation(np.tan, NUMPYS),
    ca.OP_ASIN: Operation(np.arcsin, NUMPYS),
    ca.OP_ACOS: Operation(np.arccos, NUMPYS),
    ca.OP_ATAN: Operation(np.arctan, NUMPYS),
    ca.OP_SINH: Operation(np.sinh, NUMPYS),
    ca.OP_COSH: Operation(np.cosh, NUMPYS),
    ca.OP_ASINH: Operation(np.arcsinh, NUMPYS),
    ca.OP_ACOSH: Operation(np.arccosh, NUMPYS),
    ca.OP_ATANH: Operation(np.arctanh, NUMPYS),
    ca.OP_LOG1P: Operation(np.log1p, NUMPYS),
    ca.OP_EXPM1: Operation(np.expm1, NUMPYS),
}
BINARY: dict[int, Operation] = {
    ca.OP_ADD: Operation(np.add),
    ca.OP_SUB: Operation(np.subtract),
    ca.OP_MUL: Operation(np.multiply),
    ca.OP_DIV: Operation(np.divide),
    # of two that are not ordered the second, as the processor's own minimum and maximum
    ca.OP_FMIN: Operation(lambda x, y: np.where(x < y, x, y)),
    ca.OP_FMAX: Operation(lambda x, y: np.where(x > y, x, y)),
    ca.OP_LT: truth(np.less),
    ca.OP_LE: truth(np.less_equal),
    ca.OP_EQ: truth(np.equal),
    ca.OP_NE: truth(np.not_equal),
    ca.OP_AND: truth(np.logical_and),
    ca.OP_OR: truth(np.logical_or),
    ca.OP_IF_ELSE_ZERO: Operation(lambda x, y: np.where(x != 0, y, 0.0)),
    ca.OP_COPYSIGN: Operation(np.copysign),
    ca.OP_FMOD: Operation(np.fmod),
    ca.OP_POW: Operation(np.power, NUMPYS),
    ca.OP_CONSTPOW: Operation(np.power, NUMPYS),
    ca.OP_ATAN2: Operation(np.arctan2, NUMPYS),
    ca.OP_HYPOT: Operation(np.hypot, NUMPYS),
}
# there is no code for these; everything else that SX can hold is above
REFUSED = {
    "erf": ca.OP_ERF,
    "erfinv": ca.OP_ERFINV,
    "remainder": ca.OP_REMAINDER,
    "printme": ca.OP_PRINTME,
}

Node = tuple[int, int, int]  # an operation and the numbers of two nodes before it
Graph = tuple[tuple[float, ...], tuple[Node, ...]]  # the constants, then the nodes


@pytest.fixture(autouse=True)
def _literal_expressions(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """CasADi builds what it is told, 0 x instead of 0; compiled code goes where it is forgotten."""
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path_factory.getbasetemp() / "emitted"))
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    yield
    ca.GlobalOptions.setSimplificationOnTheFly(True)


doubles = st.one_of(
    st.floats(-4.0, 4.0),
    st.floats(),  # any: subnormal, huge, infinite, not a number
    st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, 2.0, INF, -INF, NAN, 5e-324, -2.5e-310, 1e300, 2.0**43, 709.8, -745.2]),
)


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    # CasADi knows no constant -0
    constants = tuple(c + 0.0 for c in draw(st.lists(doubles, min_size=1, max_size=3)))
    leaves = sum(SIZES.values()) + len(constants)
    operations = st.sampled_from([*UNARY, *BINARY])
    count = draw(st.integers(1, 25))
    return constants, tuple(
        draw(st.tuples(operations, st.integers(0, leaves + k - 1), st.integers(0, leaves + k - 1)))
        for k in range(count)
    )


@st.composite
def points(draw: st.DrawFn) -> dict[str, Array]:
    """t of one time for all, everything else of shape (entries, points)."""
    size = sum(SIZES.values()) - 1
    some = draw(st.lists(doubles, min_size=6, max_size=24))
    seed = draw(st.integers(0, 2**32 - 1))
    mixed = np.random.default_rng(seed).choice(np.array(some), (size, POINTS))
    return {"t": np.array([draw(doubles)]), "p": mixed[:2], "z": mixed[2:5], "w": mixed[5:]}


def symbolic(graph: Graph) -> tuple[list[ca.SX], list[ca.SX]]:
    """The inputs t, p, z, w, and the nodes. A node's leaves are the entries of the inputs, then the constants."""
    inputs = [ca.SX.sym(name, size) for name, size in SIZES.items()]
    constants, nodes = graph
    known = [v[i] for v in inputs for i in range(v.numel())] + [ca.SX(c) for c in constants]
    for op, a, b in nodes:
        known.append(ca.SX.unary(op, known[a]) if op in UNARY else ca.SX.binary(op, known[a], known[b]))
    return inputs, known[-len(nodes) :]


class Native:
    """f(t, p, z, w) in machine code, on W lanes."""

    def __init__(self, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], lanes: int, *, literal: bool = True) -> None:
        self.lanes, self.outputs = lanes, sum(output.numel() for output in outputs)
        declarations: set[str] = set()
        emitted = emit(ca.Function("f", [*inputs], [ca.vertcat(*outputs)]), "f", lanes, declarations, literal=literal)
        ir = "\n".join(
            [
                *sorted(declarations),
                emitted.text,
                "define dso_local void @evaluate(double %t, ptr %p, ptr %c, ptr %tau, ptr %z, ptr %w, ptr %d) {",
                "call void @f_setup(ptr %p, ptr %c)",
                "call void @f_clock(double %t, ptr %p, ptr %c, ptr %tau)",
                "call void @f(ptr %p, ptr %c, ptr %tau, ptr %z, ptr %w, ptr %d)",
                "ret void\n}",
            ]
        )
        self._module = NativeModule(ir, ("evaluate",))
        kind = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 6)
        self._function = kind(self._module.address["evaluate"])
        self._room = [np.empty(max(count, 1) * lanes) for count in (emitted.constants, emitted.clocked)]

    def __call__(self, at: dict[str, Array]) -> Array:
        """The outputs at all points, shape (outputs, points)."""
        found = np.empty((self.outputs, POINTS))
        for first in range(0, POINTS, self.lanes):
            some = slice(first, first + self.lanes)
            p, z, w = (np.ascontiguousarray(at[name][:, some]) for name in ("p", "z", "w"))
            d = np.empty((self.outputs, self.lanes))
            self._function(at["t"][0], *(a.ctypes.data for a in (p, *self._room, z, w, d)))
            found[:, some] = d
        return found


def interpreted(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], at: dict[str, Array]) -> Array:
    """The outputs at all points, shape (outputs, points), as what is computed outside the compiled code has them."""
    found = np.empty((POINTS, len(outputs)))
    steps = steps_of(read(ca.Function("f", [*inputs], [ca.densify(ca.vertcat(*outputs))])))
    carry_out(steps, [at["t"], *(np.ascontiguousarray(at[name].T) for name in ("p", "z", "w"))], [found])
    return found.T


def places_apart(a: Array, b: Array) -> Array:
    """How many doubles lie between a and b; 0 for two NaN, infinity for one, and for zeros of two signs one."""
    bits = [x.view(np.int64) for x in (np.ascontiguousarray(a), np.ascontiguousarray(b))]
    order = [np.where(i < 0, np.int64(-(2**63)) - i - 1, i).astype(float) for i in bits]
    exact = bits[0] == bits[1]
    apart = np.where(exact, 0.0, np.maximum(np.abs(order[0] - order[1]), 1.0))
    return np.where(np.isnan(a) | np.isnan(b), np.where(np.isnan(a) & np.isnan(b), 0.0, INF), apart)


def same_bits(a: Array, b: Array) -> None:
    """Equal but for the payload of a NaN."""
    np.testing.assert_array_equal(places_apart(a, b), 0.0)


def check_nodes(graph: Graph, at: dict[str, Array], values: Array) -> None:
    """Every node is its operation on the values of its arguments."""
    constants, nodes = graph
    known = [np.broadcast_to(row, POINTS) for name in SIZES for row in at[name]]
    folded = [False] * len(known) + [True] * len(constants)
    known += [np.full(POINTS, c) for c in constants]
    for (op, a, b), value in zip(nodes, values, strict=True):
        folded.append(folded[a] and (op in UNARY or folded[b]))
        operation = UNARY[op] if op in UNARY else BINARY[op]
        arguments = [known[a]] if op in UNARY else [known[a], known[b]]
        with np.errstate(all="ignore"):
            expected = np.asarray(operation.reference(*arguments), dtype=np.float64)
        if folded[-1]:
            expected = expected + 0.0  # CasADi computes what follows from constants alone, and has no -0.0 among them
        off = places_apart(value + 0.0 if folded[-1] else value, expected)
        worst = int(np.argmax(off))
        assert off[worst] <= operation.ulp, (
            f"operation {op} of {[x[worst] for x in arguments]}: {value[worst]!r}, numpy says {expected[worst]!r}"
        )
        known.append(value)


@pytest.mark.unmeasured
@settings(max_examples=80)
@given(graphs(), points(), st.sampled_from(LANES[1:]))
def test_every_operation_is_numpys_in_every_lane(graph: Graph, at: dict[str, Array], lanes: int) -> None:
    inputs, nodes = symbolic(graph)
    values = Native(inputs, nodes, 1)(at)
    check_nodes(graph, at, values)
    same_bits(Native(inputs, nodes, lanes)(at), values)
    same_bits(interpreted(inputs, nodes, at), values)
    # nor does a value depend on what else is computed
    same_bits(Native(inputs, nodes[-1:], 1)(at), values[-1:])


TAME = [op for op in BINARY if op in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV)]


@st.composite
def sums_and_products(draw: st.DrawFn) -> Graph:
    """Of positive numbers, so that no sum cancels: then all ways to compute it are close."""
    nodes, leaves = draw(st.integers(1, 25)), sum(SIZES.values()) + 1
    positive = st.sampled_from([op for op in TAME if op != ca.OP_SUB])
    return (0.75,), tuple(
        draw(st.tuples(positive, st.integers(1, leaves + k - 1), st.integers(1, leaves + k - 1))) for k in range(nodes)
    )


@pytest.mark.slow
@settings(max_examples=60)
@given(sums_and_products(), st.integers(0, 2**32 - 1), st.sampled_from(LANES[1:]))
def test_what_is_taken_together_is_nearly_the_same(graph: Graph, seed: int, lanes: int) -> None:
    """Products with sums, reciprocals, factors that depend on parameters alone: in all lanes and in any company."""
    random = np.random.default_rng(seed)
    at = {"t": np.array([0.5])} | {name: random.uniform(0.5, 2, (SIZES[name], POINTS)) for name in "pzw"}
    inputs, nodes = symbolic(graph)
    exact, found = Native(inputs, nodes, 1)(at), Native(inputs, nodes, 1, literal=False)(at)
    sound = (np.abs(exact) > 1e-200) & (np.abs(exact) < 1e200)
    roundings = 3.0 ** len(nodes)  # a square has the error twice
    np.testing.assert_array_less(np.abs(found - exact)[sound], (1e-15 * roundings * np.abs(exact))[sound])
    same_bits(Native(inputs, nodes, lanes, literal=False)(at), found)
    same_bits(Native(inputs, nodes[-1:], 1, literal=False)(at), found[-1:])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_what_is_symmetric_stays_so_to_the_last_bit(seed: int) -> None:
    """P' = theta (P + (F P + P F^T) - K K^T / r): the terms of its entries are each other's in another order."""
    n, random = 3, np.random.default_rng(seed)
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p", 2), ca.SX.sym("z", n * n), ca.SX.sym("w", n * n)
    P, F = ca.reshape(z, n, n), ca.reshape(w, n, n)
    K = P[:, 0] * p[1]
    rate = p[0] * (P + (F @ P + P @ F.T) - K @ K.T / (1 + P[0, 0]))
    start = random.normal(size=(n, n, POINTS))
    start = start + start.transpose(1, 0, 2)
    at = {"t": np.array([0.0]), "p": random.normal(size=(2, POINTS)), "z": start.reshape(n * n, POINTS)}
    at["w"] = random.normal(size=(n * n, POINTS))
    found = Native([t, p, z, w], [ca.vec(rate)], 1, literal=False)(at).reshape(n, n, POINTS)
    same_bits(found, found.transpose(1, 0, 2))


@pytest.mark.parametrize("lanes", LANES)
def test_powers_of_one_base_are_each_what_it_is_alone(lanes: int) -> None:
    """Fractions, whole numbers and thirds, of usual and of extreme bases, side by side."""
    t, p, z, w = (ca.SX.sym(name, size) for name, size in (("t", 1), ("p", 2), ("z", 1), ("w", 1)))
    size = ca.fabs(z)
    base = np.resize([0.3, 2.5, 7e-9, 1e300, 5e-324, 0.0, 1.0, INF, NAN, 3e8, 0.7, 1e-310], POINTS)
    by_lane = [np.resize(y, POINTS) for y in ([0.91, 3.0, 1.1, 0.5], [1 / 3, -0.25, 7.5], [0.4, 1 / 3, 2.0, 40.0, 1.7])]
    at = {"t": np.zeros(1), "p": np.array(by_lane[:2]), "z": base[None], "w": by_lane[2][None]}
    found = Native([t, p, z, w], [size ** p[0], size ** p[1], size**w, size ** (1 / 3), size**0.9], lanes)(at)
    same_bits(found, np.array([apply("pow", base, y) for y in (*by_lane, np.array(1 / 3), np.array(0.9))]))


SPECIAL = np.array(
    [0.0, -0.0, 1.0, -1.5, INF, -INF, NAN, 5e-324, -1e-310, 1e308, -1e308, 0.5, 3.0, -710.0, 710.0, 1e-9]
)


@pytest.mark.measured("4")
@pytest.mark.costly
@pytest.mark.one_in(2)
@pytest.mark.parametrize("lanes", LANES)
def test_every_operation_on_all_pairs_of_special_values(lanes: int) -> None:
    """In the part of the code that knows the state, and in those of time and of parameters."""
    for first, second, leaf in (("z", "w", (3, 6)), ("p", "z", (1, 3)), ("p", "p", (1, 2)), ("t", "p", (0, 1))):
        graph: Graph = ((1.0,), tuple((op, *leaf) for op in (*UNARY, *BINARY)))
        inputs, nodes = symbolic(graph)
        native = Native(inputs, nodes, lanes)
        for x in SPECIAL:
            at = {"t": np.array([x]), "p": np.full((2, POINTS), x), "z": np.full((3, POINTS), x)}
            at["w"] = np.full((2, POINTS), 0.25)
            at[second][-1 if first == second else 0] = SPECIAL
            values = native(at)
            check_nodes(graph, at, values)
            same_bits(interpreted(inputs, nodes, at), values)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of this family")
@pytest.mark.parametrize(
    ("processor", "outside"), [("x86-64-v3", set()), ("x86-64-v4", set()), ("x86-64", {"fma", "floor", "ceil"})]
)
@pytest.mark.parametrize("lanes", [1, 4])
def test_no_library_computes(processor: str, outside: set[str], lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the machine code calls: only what an old processor lacks, and that has one right result."""
    monkeypatch.setenv("HGORUN_CPU", processor)
    inputs, nodes = symbolic(((1.0,), tuple((op, 3, 6) for op in (*UNARY, *BINARY))))
    declarations: set[str] = set()
    emitted = emit(ca.Function("f", inputs, [ca.vertcat(*nodes)]), "f", lanes, declarations)
    text = "\n".join([*sorted(declarations), emitted.text.replace("define internal", "define")])
    assembly = _target_machine().emit_assembly(llvm.parse_assembly(text))
    called = set(re.findall(r"(?:callq?\s+\*?|movabsq\s+\$)([A-Za-z_]\w*)@", assembly))
    assert {name for name in called if not name.startswith(("hgorun_", "_GLOBAL"))} == outside


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_code_is_refused(name: str) -> None:
    x = ca.SX.sym("x")
    op = REFUSED[name]
    node = ca.SX.unary(op, x) if name.startswith("erf") else ca.SX.binary(op, x, x + 1)
    f = ca.Function("f", [ca.SX.sym("t"), ca.SX.sym("p"), x, ca.SX.sym("w")], [node])
    with pytest.raises(HgorunError, match=rf"CasADi operation {op} has no native code; abs, sign, sqrt"):
        emit(f, "f", 1, set())


def test_what_is_divided_by_one_value_costs_one_division() -> None:
    """x/z and y/z by one reciprocal; by parameters alone with none in a step, but once a run."""
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p", 2), ca.SX.sym("z", 3), ca.SX.sym("w")

    def divisions(*outputs: ca.SX) -> tuple[int, int]:
        text = emit(ca.Function("f", [t, p, z, w], [ca.vertcat(*outputs)]), "f", 1, set()).text
        parts = [part.count(" fdiv ") for part in text.split("define ")[1:]]
        return parts[-1], sum(parts)

    assert divisions(z[0] / z[2], z[1] / z[2], p[0] / z[2]) == (1, 1)
    assert divisions(z[0] / p[0], z[1] / p[0]) == (0, 1)
    assert divisions(z[0] / z[1], z[1] / z[0]) == (2, 2)
