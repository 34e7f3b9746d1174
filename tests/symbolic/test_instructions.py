"""The order in which instructions are emitted: nothing before its arguments, calls of one depth together."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from hgorun.symbolic.instructions import CLOCK, MAIN, SETUP, Instruction, calls_of_state, read, rounds

CALLS = (ca.OP_SIN, ca.OP_EXP)
OPERATIONS = (ca.OP_ADD, ca.OP_MUL, ca.OP_SUB, ca.OP_SIN, ca.OP_EXP, ca.OP_SQ, ca.OP_NEG)


def random_function(seed: int) -> ca.Function:
    """f(t, p, z, w) of shared random subexpressions."""
    rng = np.random.default_rng(seed)
    inputs = [ca.SX.sym(name, size) for name, size in zip("tpzw", (1, 2, 2, 1), strict=True)]
    known = [v[i] for v in inputs for i in range(v.numel())] + [ca.SX(0.3)]
    for _ in range(40):
        op, a, b = int(rng.choice(OPERATIONS)), *(known[i] for i in rng.integers(0, len(known), 2))
        known.append(ca.SX.unary(op, a) if op in (*CALLS, ca.OP_SQ, ca.OP_NEG) else ca.SX.binary(op, a, b))
    return ca.Function("f", inputs, [ca.vertcat(*known[-5:])])


def values(instructions: list[Instruction], arguments: list[list[float]], outputs: int) -> np.ndarray:
    """The list carried out one by one, in its order."""
    unary: dict[int, Callable[..., float]] = {
        ca.OP_SIN: np.sin,
        ca.OP_EXP: np.exp,
        ca.OP_SQ: np.square,
        ca.OP_NEG: np.negative,
    }
    binary: dict[int, Callable[..., float]] = {ca.OP_ADD: np.add, ca.OP_MUL: np.multiply, ca.OP_SUB: np.subtract}
    known: dict[int, float] = {}
    found = np.full(outputs, np.nan)
    for i in instructions:
        given = [known[a] for a in i.arguments]
        if i.op == ca.OP_CONST:
            known[i.value] = i.number
        elif i.op == ca.OP_INPUT:
            known[i.value] = arguments[i.place[0]][i.place[1]]
        elif i.op == ca.OP_OUTPUT:
            found[i.place[1]] = given[0]
        elif i.op == ca.OP_TWICE:
            known[i.value] = 2 * given[0]
        else:
            known[i.value] = unary[i.op](given[0]) if i.op in unary else binary[i.op](*given)
    return found


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.parametrize("seed", range(10))
def test_in_rounds_the_same_is_computed(seed: int) -> None:
    f = random_function(seed)
    arguments = [[0.7], [-0.2, 0.4], [0.1, -0.6], [0.5]]
    expected = np.asarray(f(*arguments)).ravel()
    listed = read(f)
    grouped = [i for some in rounds(listed, CALLS) for i in some]
    for order in (listed, grouped):
        np.testing.assert_allclose(values(order, arguments, expected.size), expected, rtol=1e-12)
    assert sorted(i.value for i in grouped) == sorted(i.value for i in listed)


@pytest.mark.parametrize("seed", range(10))
def test_a_round_has_calls_only_or_none_and_its_calls_do_not_wait_for_each_other(seed: int) -> None:
    for some in rounds(read(random_function(seed)), CALLS):
        made = {i.value for i in some}
        called = [i.op in CALLS for i in some]
        assert all(called) or not any(called)
        if all(called):
            assert not any(a in made for i in some for a in i.arguments)


def test_what_depends_on_parameters_comes_first_then_time_then_the_state() -> None:
    t, p, z, w = (ca.SX.sym(name) for name in "tpzw")
    first = ca.sin(p)
    f = ca.Function("f", [t, p, z, w], [ca.sin(z) + ca.sin(t) * first + ca.sin(first) + w])
    sines = [len(some) for some in rounds(read(f), CALLS) if some[0].op == ca.OP_SIN]
    assert sines == [1, 1, 1, 1]  # sin p, sin sin p, sin t, sin z: none of them of one part and one depth
    assert (SETUP, CLOCK, MAIN) == (0, 1, 2)


def test_calls_that_can_stand_side_by_side_do() -> None:
    t, p, z, w = ca.SX.sym("t"), ca.SX.sym("p"), ca.SX.sym("z", 4), ca.SX.sym("w")
    f = ca.Function("f", [t, p, z, w], [ca.sin(z) + ca.exp(ca.sin(2 * z))])
    called = [[i.op for i in some] for some in rounds(read(f), CALLS) if some[0].op in CALLS]
    assert called == [[ca.OP_SIN] * 8, [ca.OP_EXP] * 4]


def test_only_calls_of_states_are_counted() -> None:
    t, p, z, w = (ca.SX.sym(name, 1) for name in "tpzw")
    of_state = ca.Function("f", [t, p, z, w], [ca.sin(t) * ca.exp(p) + ca.sin(z) + ca.exp(w * t)])
    assert calls_of_state(of_state, CALLS) == 2
    assert calls_of_state(ca.Function("f", [t, p, z, w], [z * w]), CALLS) == 0
