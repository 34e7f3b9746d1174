"""Values of expressions: Python's arithmetic is the oracle, and CasADi must agree."""

import ast
import math
import time
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from hgorun.config.expressions import FUNCTIONS, ExpressionError, parse
from hgorun.native.elementary import apply

NO_NUMBER = (ZeroDivisionError, OverflowError, ValueError, TypeError)
ONE_ARGUMENT = [
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "log",
    "log10",
    "sqrt",
]
ONE_ARGUMENT += ["abs", "sign", "floor", "ceil"]


def same_bits(name: str, python: Callable[..., Any]) -> Callable[..., Any]:
    """A function with Python's domain and errors, and with hgorun's last bits, which are tested elsewhere."""

    def function(*values: Any) -> Any:
        result = python(*values)
        if isinstance(result, complex) or not math.isfinite(result):
            return result
        return float(apply(name, *map(float, values)))

    return function


class OwnPowers(ast.NodeTransformer):
    """a**b becomes a call: Python's own takes its last bits from the C library."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Pow):
            return node
        return ast.Call(ast.Name("power", ast.Load()), [node.left, node.right], [])


def value_in_python(text: str, values: dict[str, float]) -> Any:
    tree = ast.fix_missing_locations(OwnPowers().visit(ast.parse(text, mode="eval")))
    return eval(compile(tree, "<reference>", "eval"), REFERENCE | values)


REFERENCE: dict[str, Any] = {name: same_bits(name, getattr(math, name)) for name in FUNCTIONS if hasattr(math, name)}
REFERENCE |= {"power": same_bits("pow", lambda a, b: a**b), "sqrt": math.sqrt}
REFERENCE |= {"log10": lambda x: float(Decimal(x).log10()) if x > 0 else math.log10(x)}
REFERENCE |= {"abs": abs, "min": min, "max": max, "float": float, "bool": bool, "pi": math.pi, "e": math.e}
REFERENCE |= {"floor": lambda x: float(math.floor(x)), "ceil": lambda x: float(math.ceil(x))}
REFERENCE |= {"sign": lambda x: math.copysign(1.0, x) if x else 0.0, "__builtins__": {}}

Pair = tuple[str, str]  # text in our grammar, and in Python


def literals() -> st.SearchStrategy[Pair]:
    integers = st.integers(0, 12).map(lambda n: (str(n), repr(float(n))))
    forms = st.sampled_from(["{:.3f}", "{:.2e}", "{:g}", "{:.0f}."])
    floats = st.tuples(st.floats(0.001, 50), forms).map(lambda pair: pair[1].format(pair[0]))
    return integers | floats.map(lambda text: (text, repr(float(text))))


def atoms() -> st.SearchStrategy[Pair]:
    return literals() | st.sampled_from(["x", "y", "pi", "e"]).map(lambda name: (name, name))


@st.composite
def chains(draw: st.DrawFn, parts: st.SearchStrategy[Pair]) -> Pair:
    """Operands and operators without parentheses: precedence is part of the test."""
    ours, python = "", ""
    for index in range(draw(st.integers(1, 4))):
        sign = draw(st.sampled_from(["+", "-", "*", "/", "**", " * ", " - "])) if index else ""
        sign += draw(st.sampled_from(["", "", "", "-", "+", "--"]))
        part = draw(parts)
        ours, python = ours + sign + part[0], python + sign + part[1]
    return f"({ours})", f"({python})"


@st.composite
def calls(draw: st.DrawFn, parts: st.SearchStrategy[Pair]) -> Pair:
    name = draw(st.sampled_from([*ONE_ARGUMENT, "atan2", "min", "max"]))
    count = 1 if name in ONE_ARGUMENT else 2 if name == "atan2" else draw(st.integers(2, 4))
    arguments = [draw(parts) for _ in range(count)]
    ours, python = (", ".join(a[i] for a in arguments) for i in (0, 1))
    return f"{name}({ours})", f"{name}({python})"


@st.composite
def logic(draw: st.DrawFn, parts: st.SearchStrategy[Pair]) -> Pair:
    a, b, c = (draw(parts) for _ in range(3))
    signs = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    match draw(st.sampled_from(["one", "two", "and", "or", "not", "where"])):
        case "one":
            sign = draw(signs)
            return f"({a[0]} {sign} {b[0]})", f"float({a[1]} {sign} {b[1]})"
        case "two":
            s, t = draw(signs), draw(signs)
            return f"({a[0]}{s}{b[0]}{t}{c[0]})", f"float({a[1]}{s}{b[1]}{t}{c[1]})"
        case "not":
            return f"(not {a[0]})", f"float(not {a[1]})"
        case "where":
            return f"where({a[0]}, {b[0]}, {c[0]})", f"({b[1]} if {a[1]} else {c[1]})"
        case word:
            python = f" {word} ".join(f"bool({part[1]})" for part in (a, b, c))
            return f"({a[0]} {word} {b[0]} {word} {c[0]})", f"float({python})"


expressions = st.recursive(atoms(), lambda parts: chains(parts) | calls(parts) | logic(parts), max_leaves=14)
points = st.fixed_dictionaries({name: st.floats(-9, 9).map(lambda v: round(v, 3)) for name in ("x", "y")})


@pytest.mark.slow
@given(expressions, points)
@example(("log(3)", "log(3.0)"), {"x": 0.0, "y": 0.0})  # the C library's and ours differ in the last bit
@settings(max_examples=500)
def test_numbers_are_pythons(pair: Pair, values: dict[str, float]) -> None:
    ours, python = pair
    assume(len(ours) <= 2000)
    expression = parse(ours, names={"x", "y"})
    assert expression == parse(ours)
    assert expression.names == {"x", "y"} & set(ours.replace("exp", "").replace("max", ""))
    try:
        expected = value_in_python(python, values)
    except NO_NUMBER:
        expected = math.nan
    try:
        found = expression.number(values)
    except ExpressionError:
        # We stop at the first infinite or complex number; Python may get back to a finite one.
        assume(isinstance(expected, complex) or not math.isfinite(expected))
        return
    assert found == expected
    assert type(found) is float


@pytest.mark.slow
@given(expressions, points)
@settings(max_examples=250)
def test_casadi_agrees(pair: Pair, values: dict[str, float]) -> None:
    assume(len(pair[0]) <= 2000)
    expression = parse(pair[0])
    symbols = {name: ca.SX.sym(name) for name in values}
    try:
        number = expression.number(values)
        nearby = [expression.number({n: v + h * (1 + abs(v)) for n, v in values.items()}) for h in (1e-12, -1e-12)]
        symbol = expression.symbol(symbols)
    except ExpressionError:
        return
    assume(all(math.isclose(number, other, rel_tol=1e-6, abs_tol=1e-9) for other in nearby))
    function = ca.Function("f", list(symbols.values()), [symbol])
    assert math.isclose(float(function(*values.values())), number, rel_tol=1e-5, abs_tol=1e-8)
    try:
        partial = expression.symbol({"x": symbols["x"], "y": values["y"]})
    except ExpressionError:  # a part that x rules out, such as log(y) at y = 0, has no value
        return
    function = ca.Function("f", [symbols["x"]], [partial])
    assert math.isclose(float(function(values["x"])), number, rel_tol=1e-5, abs_tol=1e-8)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[
            ("abs(-2)", 2),
            ("acos(1)", 0),
            ("asin(1)", math.pi / 2),
            ("atan(1)", math.pi / 4),
            ("atan2(1, -1)", 2.356194),
        ],
        *[
            ("ceil(1.2)", 2),
            ("cos(pi)", -1),
            ("cosh(0)", 1),
            ("exp(1)", math.e),
            ("floor(-1.2)", -2),
            ("log(e)", 1),
        ],
        *[("log10(1000)", 3), ("max(1, 3, 2)", 3), ("min(1, 3, -2)", -2), ("sign(-3)", -1), ("sign(0)", 0)],
        *[
            ("sin(pi/2)", 1),
            ("sinh(0)", 0),
            ("sqrt(9)", 3),
            ("tan(pi/4)", 1),
            ("tanh(0)", 0),
            ("where(1<2, 5, 6)", 5),
        ],
        *[
            ("-2**2", -4),
            ("2**-1", 0.5),
            ("2**3**2", 512),
            ("7 - 2 - 1", 4),
            ("8/4/2", 1),
            ("+3", 3),
            ("017*2", 34),
        ],
        *[("1 < 2 < 3", 1), ("1 < 3 < 2", 0), ("1 < 2 != 3", 1), ("2 and 3", 1), ("0 or 0", 0), ("not 2", 0)],
        *[("not 1 < 2", 0), ("1or 2", 1), ("0or 2", 1), ("0.95*pi/0.25", 0.95 * math.pi / 0.25), ("\t1 ", 1)],
        *[
            ("where(0, 1/0, 2)", 2),
            ("1 or 1/0", 1),
            ("0 and 1/0", 0),
            ("2 < 1 < 1/0", 0),
            (".5e1", 5),
            ("5.", 5),
        ],
    ],
)
def test_values(text: str, value: float) -> None:
    assert parse(text, names=()).number() == pytest.approx(value, rel=1e-6)
    assert float(parse(text).symbol()) == pytest.approx(value, rel=1e-6)


def test_every_function_is_described_and_works() -> None:
    for name, description in FUNCTIONS.items():
        assert description.startswith(f"{name}(")
        count = description.partition(")")[0].count(",") + 1
        text = f"{name}({', '.join(['0.5'] * count)})".replace("...", "1")
        assert math.isfinite(parse(text).number())
        x = ca.SX.sym("x")
        assert parse(text.replace("0.5", "x", 1)).symbol({"x": x}).is_scalar()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *[
            ("1/0", "1 / 0 divides by zero"),
            ("0**-1", "divides by zero"),
            ("9**9**9", "too large"),
            ("exp(1000)", "large"),
        ],
        *[
            ("1e300*1e300", "too large"),
            ("1e308 + 1e308", "too large"),
            ("sqrt(-1)", "sqrt(-1) is not a real number"),
        ],
        *[
            ("log(0)", "not a real number"),
            ("asin(2)", "not a real"),
            ("(-8)**(1/3)", "(-8) ** 0.333333 is not a real"),
        ],
        *[("1/(1e300*1e300)", "too large"), ("x", "`x` has no value"), ("e + q", "`q` has no value")],
    ],
)
def test_no_number(text: str, words: str) -> None:
    expression = parse(text)
    start = time.perf_counter()
    with pytest.raises(ExpressionError) as caught:
        expression.number()
    assert time.perf_counter() - start < 2  # not hours; a busy machine may take its time
    assert words in str(caught.value)
    with pytest.raises(ExpressionError):
        expression.symbol()


def test_names_shadow_constants() -> None:
    assert parse("2*pi").number() == 2 * math.pi
    assert parse("2*e", names=()).number() == 2 * math.e
    assert parse("2*e", names={"e"}).number({"e": 3}) == 6
    assert parse("2*e", names={"e"}).names == {"e"}
    assert parse("2*e").names == frozenset()
    assert parse("2*e").number({"e": 3}) == 6
    with pytest.raises(ExpressionError, match="`e` has no value"):
        parse("2*e", names={"e"}).number()


def test_values_must_be_finite_numbers() -> None:
    expression = parse("x")
    assert expression.number({"x": np.float64(2)}) == 2
    assert expression.number({"x": 2, "unused": math.nan}) == 2
    for value, found in (
        (math.nan, "is not finite"),
        (math.inf, "is not finite"),
        (10**400, "is larger than any number"),
    ):
        with pytest.raises(ExpressionError, match=f"the value of `x` {found}"):
            expression.number({"x": value})
    with pytest.raises(ExpressionError, match="not a number"):
        expression.number({"x": ca.SX.sym("x")})


def test_integer_powers_stay_products_in_casadi() -> None:
    x = ca.SX.sym("x")
    for text in ("x**3", "x**3.0", "x**(2 + 1)", "x**n"):
        assert ca.is_equal(parse(text).symbol({"x": x, "n": 3}), x**3, 9)
    assert float(ca.Function("f", [x], [parse("x**-2").symbol({"x": x})])(-2)) == 0.25
    assert "pow" not in str(parse("x**3").symbol({"x": x}))


def test_what_is_not_chosen_does_not_matter_in_casadi() -> None:
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [parse("where(x == 0, 1, sin(x)/x)").symbol({"x": x})])
    assert float(function(0)) == 1
    assert float(function(1)) == math.sin(1)
    truth = ca.Function("f", [x], [parse("x and 2").symbol({"x": x})])
    assert [float(truth(value)) for value in (0, 3)] == [0, 1]
