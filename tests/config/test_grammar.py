"""The grammar of expressions: what is refused and why, names, and only ExpressionError comes out."""

import math
import time

import casadi as ca
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun.config.expressions import FUNCTIONS, ExpressionError, check_name, nearest, parse

PIECES = [
    *FUNCTIONS,
    "x",
    "lambda",
    "if",
    "and",
    "or",
    "not",
    "in",
    "is",
    "e",
    "pi",
    "j",
    "_",
    "__a__",
    "True",
    "é",
]
PIECES += [
    *"()[]{}+-*/%^&|~!<>=,.:;@#$?\\'\"` \t\n0159",
    "**",
    "//",
    "<<",
    ":=",
    "1e5",
    "1e999",
    "0x",
    ".5",
    "θ",
    "\0",
]
PIECES += [
    "\ud800",
    "１",
    "²",
    "−",
    "(" * 60,
    ")" * 60,
    "-" * 60,
    "not " * 60,
    "9**" * 60,
    "9" * 400,
    "1+" * 400,
]


@pytest.mark.slow
@given(st.text(max_size=40) | st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
@settings(max_examples=800)
def test_any_text_is_an_expression_or_an_expression_error(text: str) -> None:
    for names in (None, {"x", "alpha"}):
        try:
            expression = parse(text, names=names)
            expression.symbol({name: ca.SX.sym(name) for name in expression.names})
            assert math.isfinite(expression.number(dict.fromkeys(expression.names, 0.3)))
        except ExpressionError as error:
            message = str(error)
            assert message.isprintable()
            assert 0 < len(message) < 700


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *[
            ("x^2", "a power is `**`"),
            ("2x", "`2*x`"),
            ("2 x", "`2*x`"),
            ("x y", "`x*y`"),
            ("(x)(y)", "`)*(`"),
        ],
        *[("2(x)", "`2*(`"), ("x 2", "`x*2`"), ("2e", "`2*e`"), ("1.2.3", "`1.2.3` is not a number")],
        ("lambda*x", "`lambda` cannot be a name: it is a keyword of the expression grammar"),
        ("lambda x: x", "`lambda` cannot be a name"),
        *[
            ("x.real", "no attributes"),
            ("...", "no attributes"),
            ("x[1]", "no subscripts"),
            ("[x]", "no lists"),
        ],
        *[
            ("'x'", "no text"),
            ('f"{x}"', "no text"),
            ("[x for x in y]", "not in the grammar"),
            ("{x}", "`{`"),
        ],
        *[
            ("(x for x in y)", "`for` cannot be a name"),
            ("(x := 1)", "`:=`"),
            ("x if y else 1", "where(condition, a, b)"),
        ],
        *[("min(*x)", "`*`"), ("min(1, **x)", "`*`"), ("min(a=1)", "no keywords"), ("x = 1", "`==`")],
        *[
            ("sine(x)", "Did you mean `sin`? Functions: abs,"),
            ("mu(1 - x)", "`mu*(...)`"),
            ("pi(2)", "`pi*(...)`"),
        ],
        *[
            ("step(t - 1)", "no function `step`. A step at t = 1 is where(t > 1, 1, 0). Functions"),
            ("ln(x)", "The natural logarithm is log(x)"),
            ("pow(x, 2)", "A power is a**b"),
            ("randn()", "{type: gaussian"),
            ("0.2.*x", "write `*` for `.*`"),
            ("x.^2", "write `**` for `.^`"),
            ("x./2", "write `/` for `./`"),
            ("x.y", "there are no attributes"),
            ("12.10.2026 10:00", "a date or a time of day is a number, of time.unit"),
        ],
        *[
            ("sin(1, 2)", "sine of x"),
            ("min(1)", "two or more"),
            ("where(1, 2)", "where(condition, a, b)"),
            ("sin()", "0"),
        ],
        *[
            ("sin", "is a function"),
            ("sin*2", "is a function"),
            ("a//b", "floor(a/b)"),
            ("a % b", "floor(a/b)"),
        ],
        *[
            ("a & b", "`and`"),
            ("a | b", "`or`"),
            ("a << 1", "`<<`"),
            ("~a", "`~`"),
            ("a @ b", "`@`"),
            ("!a", "`not`"),
        ],
        *[("x − 1", "write `-`"), ("2·x", "write `*`"), ("x²", "write `**2`"), ("θ*2", "write `theta`")],
        *[
            ("х + 1", "U+0445, CYRILLIC SMALL LETTER HA"),
            ("１", "U+FF11"),
            ("x\u200b", "U+200B"),
            ("π", "write `pi`"),
        ],
        *[
            ("", "empty"),
            ("  ", "empty"),
            ("1j", "complex"),
            ("2J", "complex"),
            ("True", "`True`"),
            ("None", "`None`"),
        ],
        *[
            ("1_000", "is not a number"),
            ("0x1F", "is not a number"),
            ("0b1", "is not a number"),
            ("1e999", "larger than any number"),
        ],
        *[
            ("x\ny", "one line"),
            ("x # y", "comment"),
            ("x\\", "`\\`"),
            ("x;y", "`;`"),
            ("\0", "not in the grammar"),
        ],
        *[
            ("1 +", "after `+`"),
            ("*x", "at the beginning"),
            ("2 * * 3", "after `*`"),
            ("()", "nothing between"),
        ],
        *[
            ("1, 2", "`,`"),
            ("(1", "not closed"),
            ("1)", "without a `(`"),
            ("f(,)", "after `(`"),
            ("not", "after `not`"),
        ],
        *[
            ("__import__('os')", "`__import__` cannot be"),
            ("__x__", "do not begin with `__`"),
            ("x is y", "`is`"),
            ("await x", "`await`"),
        ],
        *[("1" * 2001, "2,001 characters"), ("9" * 400, "larger than any number")],
    ],
)
def test_refusals(text: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["(" * 101 + "1" + ")" * 101, "-" * 101 + "1", "-" * 1999 + "1", "not " * 499 + "1", "2**" * 600 + "1"],
)
def test_deep_nesting_is_refused(text: str) -> None:
    with pytest.raises(ExpressionError, match=r"nested more than|too deep"):
        parse(text)


def test_what_is_long_but_not_deep_is_fine() -> None:
    assert parse("1+" * 999 + "1").number() == 1000
    assert parse("1*1-" * 499 + "1").number() == -498
    assert parse("max(" + "1," * 900 + "2)").number() == 2
    assert parse("1<" * 900 + "2").number() == 0
    assert parse("1 and " * 300 + "2").number() == 1
    assert parse("(" * 100 + "1" + ")" * 100).number() == 1
    assert parse("-" * 100 + "1").number() == 1


def test_names() -> None:
    with pytest.raises(ExpressionError) as caught:
        parse("mu*x3", names=["x1", "x2", "mu"])
    assert "`x3` is not known. Did you mean `x" in str(caught.value)
    assert "Known names: mu, x1, x2, pi, e" in str(caught.value)
    with pytest.raises(ExpressionError, match="Did you mean `theta`"):
        parse("Thetta", names=["theta"])
    with pytest.raises(ExpressionError, match="and 90 more"):
        parse("zzz", names=[f"x{i}" for i in range(100)])
    with pytest.raises(ExpressionError, match=r"`mu\*\(\.\.\.\)`"):
        parse("mu(1)", names=["mu"])
    assert parse("mu*x1 + pi", names=["x1", "x2", "mu"]).names == {"mu", "x1"}
    assert parse("sin(q)").names == {"q"}
    assert parse("match + type + _").names == {"match", "type", "_"}


@pytest.mark.parametrize("name", ["x1", "D", "k_c", "mu", "lam", "e", "pi", "t", "_", "_x", "match", "x" * 50])
def test_names_that_can_be_used(name: str) -> None:
    check_name(name)
    assert parse(name, names={name}).number({name: 2}) == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("lambda", "`lambda` cannot be a name: it is a keyword of the expression grammar"),
        *[(name, "keyword") for name in ("and", "not", "if", "None", "True", "in", "async")],
        *[(name, "it is a function") for name in ("sin", "where", "min")],
        *[(name, "`__`") for name in ("__class__", "__x")],
        *[(name, "if it is the end of a number, a decimal") for name in ("5*x", "5 + x", "5e-3", "5e3*x")],
        *[(name, "begin with no digit") for name in ("1x", "2nd")],
        *[(name, "ASCII") for name in ("", "1x", "x-1", "x 1", "θ", "x\n", "x.y", "é", "ｘ")],
    ],
)
def test_names_that_cannot_be_used(name: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        check_name(name)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.costly
@given(st.text("abxt_1é. λ", max_size=5) | st.sampled_from(PIECES))
@settings(max_examples=200)
def test_a_name_that_passes_is_an_expression_of_itself(name: str) -> None:
    try:
        check_name(name)
    except ExpressionError:
        return
    assert parse(name, names={name}).names == {name}


def test_nearest() -> None:
    assert nearest("thetha", ["theta", "poles"]) == " Did you mean `theta`?"
    assert nearest("THETA", ["theta", "poles"]) == " Did you mean `theta`?"
    assert (
        nearest("thеta", ["theta"]) == " Did you mean `theta`, without the letter 'е' of another alphabet (Cyrillic)?"
    )
    assert nearest("sghο", ["shgo"]) == " Did you mean `shgo`, without the letter 'ο' of another alphabet (Greek)?"
    assert nearest("ρ", ["p"]) == " Did you mean `p`, without the letter 'ρ' of another alphabet (Greek)?"
    assert nearest("αβγ", ["alpha", "beta"]) == ""
    assert nearest("Unscented Kalman-filter", ["ekf", "ukf"]) == " Did you mean `ukf`?"
    assert nearest("unscented", ["ekf", "ukf"]) == " Did you mean `ukf`?"
    assert nearest("x", ["theta", "poles"]) == ""
    assert nearest("x", []) == ""
    for short in ("OD", "od", "ph"):  # a letter of them is as likely meant as any other
        assert nearest(short, ["t", "d", "p", "h"]) == ""
    assert nearest("OD", ["ode"]) == ""
    assert nearest("D", ["d", "t"]) == " Did you mean `d`?"
    assert nearest("u1", ["u", "t"]) == " Did you mean `u`?"
    assert nearest("sd", ["std", "low"]) == " Did you mean `std`?"
    start = time.perf_counter()
    nearest("a" * 100_000, ["a" * n for n in range(2_000)])
    assert time.perf_counter() - start < 5
