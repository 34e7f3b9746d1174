"""The elementary functions against mpmath and C, on 1, 2, 4 and 8 lanes and for other processors."""

from __future__ import annotations

import importlib.util
import math
import platform
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiled_functions import NAMES, Array, Compiled, bits, compiled
from function_points import HUGE, INF, LEAST, NAN, neighbours, points, special
from mpmath import mp, mpf

from hgorun.native.functions import coefficients

LANES = (1, 2, 4, 8)
C_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh"}
C_NAMES |= {"atanh": "arctanh", "atan2": "arctan2", "pow": "power"}
# measured on 10⁷ to 10⁸ points, rounded up; next to a subnormal result intermediate ones are rounded as such
BOUND = {"sin": 1.7, "cos": 1.7, "exp": 1.1, "tanh": 1.9, "tan": 1.0, "sinh": 1.0, "cosh": 0.8, "pow": 0.7}
FRACTIONS = {1.0: 1.9, 2.0: 3.0}  # of powers whose exponents are fractions up to this, and no halves
BOUND |= {"log": 0.9, "log1p": 0.6, "expm1": 0.7, "asinh": 0.6, "acosh": 0.6, "atanh": 0.6, "hypot": 0.51}
BOUND |= {"asin": 0.8, "acos": 0.8, "atan": 0.8, "atan2": 0.8, "fmod": 0.0}
ODD = ("sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh")

MONOTONIC = ("asin", "atan", "sinh", "tanh", "exp", "expm1", "asinh", "acosh", "atanh", "log", "log1p")


def oracle(name: str, *arguments: Array) -> Array:
    """The C library, through numpy."""
    with np.errstate(all="ignore"):
        result: Array = getattr(np, C_NAMES.get(name, name))(*arguments)
    return result


def ulps(name: str, arguments: tuple[float, ...], y: float) -> float:
    """The distance of y to the true value in units of the true value's last place."""
    with mp.workprec(160):
        if name == "fmod":
            return 0.0 if y == math.fmod(*arguments) else INF
        exact = [mpf(1) / 3 if name == "pow" and a == 1 / 3 else mpf(a) for a in arguments]
        true = getattr(mp, {"pow": "power"}.get(name, name))(*exact)
        unit = mpf(2) ** (max(mp.frexp(true)[1], -1021) - 53)
        return float(abs(mpf(y) - true) / unit)


def bounds(name: str, arguments: Sequence[Array]) -> Array:
    """The stated error of each value."""
    found = np.full(arguments[0].shape, BOUND[name])
    if name == "pow":
        y = arguments[1]
        for largest in sorted(FRACTIONS, reverse=True):
            found[(np.abs(y) <= largest) & (2 * y != np.rint(2 * y))] = FRACTIONS[largest]
    return found


@pytest.mark.slow
@pytest.mark.measured_once
@pytest.mark.parametrize("name", NAMES)
def test_within_the_stated_error(name: str) -> None:
    arguments = points(name)
    y = compiled(8)(name, *arguments)
    finite = np.isfinite(y)
    np.testing.assert_array_equal(y[~finite], oracle(name, *arguments)[~finite])
    places = np.flatnonzero(finite)
    errors = np.array([ulps(name, tuple(a[i] for a in arguments), float(y[i])) for i in places])
    normal = np.abs(y[places]) >= 2.0**-1020
    allowed = bounds(name, arguments)[places]
    worst = places[int(np.argmax(errors / np.maximum(allowed, 0.1)))]
    assert np.all(errors[normal] <= allowed[normal]), [a[worst] for a in arguments]
    assert np.all(errors <= np.maximum(1.0, allowed)), [a[worst] for a in arguments]
    if name in ("sin", "cos", "tanh"):
        assert np.abs(y[finite]).max() <= 1


@pytest.mark.parametrize("name", NAMES)
def test_special_values_are_those_of_c(name: str) -> None:
    arguments = special(name)
    expected, y = oracle(name, *arguments), compiled(4)(name, *arguments)
    exact = ~np.isfinite(expected) | (expected == 0)
    np.testing.assert_array_equal(bits(y)[exact], bits(expected)[exact])
    places = np.maximum(np.frexp(expected[~exact])[1], -1021) - 53
    assert np.all(np.abs(y[~exact] - expected[~exact]) <= np.ldexp(2.0, places))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_same_bits_on_all_lanes(name: str) -> None:
    arguments = [np.concatenate(both) for both in zip(points(name), special(name), strict=True)]
    one = bits(compiled(1)(name, *arguments))
    for lanes in LANES[1:]:
        for turn in range(0, lanes, max(1, lanes // 4)):
            turned = compiled(lanes)(name, *(np.roll(a, turn) for a in arguments))
            np.testing.assert_array_equal(bits(np.roll(turned, -turn)), one)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of this family")
@pytest.mark.parametrize("processor", ["x86-64", "x86-64-v3", "x86-64-v4"])
def test_same_bits_on_other_processors(processor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """SSE2 without fma, AVX2 and AVX-512."""
    if processor == "x86-64-v4" and "avx512f" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor has no AVX-512")
    monkeypatch.setenv("HGORUN_CPU", processor)
    for lanes in (1, 4):
        other = Compiled(lanes)
        for name in NAMES:
            for arguments in (points(name), special(name)):
                expected = compiled(8)(name, *arguments)
                np.testing.assert_array_equal(bits(other(name, *arguments)), bits(expected), name)


@pytest.mark.parametrize("name", ODD)
def test_odd_functions(name: str) -> None:
    x = np.concatenate([*points(name), [0.0, LEAST]])
    np.testing.assert_array_equal(bits(compiled(4)(name, -x)), bits(-compiled(4)(name, x)))


@pytest.mark.parametrize("name", ["cos", "cosh"])
def test_even_functions(name: str) -> None:
    x = points(name)[0]
    np.testing.assert_array_equal(bits(compiled(4)(name, -x)), bits(compiled(4)(name, x)))


@pytest.mark.parametrize("name", ODD)
def test_small_arguments_come_back(name: str) -> None:
    x = np.array([LEAST, 3 * LEAST, 2.0**-1022, 1e-300, 1e-20])
    np.testing.assert_array_equal(compiled(4)(name, x), x)


@pytest.mark.parametrize(
    "name", ["asin", "atan", "sinh", "tanh", "expm1", "asinh", "acosh", "atanh", "log1p", "log", "exp"]
)
def test_no_step_back_between_neighbours(name: str) -> None:
    """Monotonic functions, where pieces of the argument meet and elsewhere, but for the last place."""
    x = np.sort(neighbours(points(name)[0], 3))
    y = compiled(8)(name, x)
    y = y[np.isfinite(y)]
    assert np.all(np.diff(y) >= -np.spacing(np.abs(y[1:])))


def test_power_that_is_a_double_comes_out_exact() -> None:
    power = compiled(4)
    n = np.arange(-1074, 1024)
    np.testing.assert_array_equal(power("pow", np.full(n.size, 2.0), n), np.ldexp(1.0, n))
    base, exponent = (a.ravel() for a in np.meshgrid(np.arange(-40, 41), np.arange(0, 12)))
    exact = np.array([float(int(b) ** int(e)) for b, e in zip(base, exponent, strict=True)])
    small = np.abs(exact) < 2.0**53
    np.testing.assert_array_equal(power("pow", base, exponent)[small], exact[small])
    square = np.arange(1, 3000.0) ** 2
    np.testing.assert_array_equal(power("pow", square, np.full(square.size, 0.5)), np.sqrt(square))


def test_cube_roots() -> None:
    """Those of C, which has one for negative numbers, too."""
    x = np.array([0.0, LEAST, 2.0**-1022, np.nextafter(2.0**-1022, 0), 1e-310, HUGE, INF, NAN, -LEAST, -1.0, -INF])
    found = compiled(4)("pow", x, np.full(x.size, 1 / 3))
    np.testing.assert_allclose(found[:8], np.cbrt(x[:8]), rtol=4e-16, atol=0)
    assert np.all(np.isnan(found[8:]))


def test_second_power_is_the_product() -> None:
    x = points("tan")[0]
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(compiled(4)("pow", x, np.full(x.size, 2.0)), x * x)


@pytest.mark.parametrize("y", [0.5, 1.5, -0.2, 2.0, 3.0])
def test_power_grows_with_its_base(y: float) -> None:
    x = np.sort(neighbours(np.geomspace(1e-90, 1e90, 2001), 3))
    z = compiled(8)("pow", x, np.full(x.size, y))
    assert np.all(np.sign(y) * np.diff(z) >= -np.spacing(z[1:]))


def test_fmod_is_that_of_c_bit_for_bit() -> None:
    rng = np.random.default_rng(7)
    size = np.exp(rng.uniform(-745, 709, (2, 20_000)))
    x, y = size * rng.choice([-1.0, 1.0], size.shape)
    np.testing.assert_array_equal(bits(compiled(8)("fmod", x, y)), bits(np.fmod(x, y)))
    np.testing.assert_array_equal(bits(compiled(1)("fmod", x, y)), bits(np.fmod(x, y)))


def test_a_lane_does_not_care_for_its_neighbours() -> None:
    """A lane that takes long, or is beyond the usual range, beside one that does not."""
    one = compiled(4)("fmod", [HUGE, 5.0, 3.0, INF], [LEAST, 3.0, 5.0, 1.0])
    np.testing.assert_array_equal(one, [math.fmod(HUGE, LEAST), 2.0, 3.0, math.nan])
    many = compiled(4)("sin", [1e22, 1.0, INF, -1e300])
    alone = [compiled(1)("sin", [x])[0] for x in (1e22, 1.0, INF, -1e300)]
    np.testing.assert_array_equal(many, alone)


@pytest.fixture(scope="module")
def tool() -> Iterator[Any]:
    """tools/fit_functions.py."""
    path = Path(__file__).parents[2] / "tools" / "fit_functions.py"
    specification = importlib.util.spec_from_file_location("fit_functions", path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    digits = mp.dps
    try:
        specification.loader.exec_module(module)
        yield module
    finally:
        mp.dps = digits  # the tool sets its own, and mpmath keeps it for the whole process


@pytest.mark.costly
def test_polynomials_have_the_errors_that_stand_above_them(tool: Any) -> None:
    text = Path(coefficients.__file__).read_text()
    for what in tool.FITS:
        heading = tool.heading(what, getattr(coefficients, what.name))
        assert f"{heading}\n{what.name} = (" in text


@pytest.mark.slow
def test_coefficients_are_those_of_the_fit(tool: Any) -> None:
    """The quick ones; tools/fit_functions.py prints all of them."""
    for what in tool.FITS:
        if what.degree <= 5:
            assert tuple(tool.fit(what)) == getattr(coefficients, what.name), what.name
