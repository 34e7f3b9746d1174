"""Fit the polynomials of hgorun/native/functions/coefficients.py and print them.

Each one approximates a smooth factor of its function, P in sin r = r + r³ P(r²) for one. The fit is minimax
(Remez exchange) on the relative error of the *function*, in 60 digits. Coefficients are rounded to doubles
one at a time from the constant term up; those not rounded yet are fitted anew to make good the rounding.
The printed error is that of the rounded polynomial evaluated exactly; what an evaluation in doubles adds
comes on top.

    python tools/fit_functions.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from mpmath import mp, mpf

mp.dps = 60
Real = Any  # mpmath publishes no types
POINTS = 24  # grid points per coefficient


class Fit(NamedTuple):
    """``factor(x) ≈ Σ coefficients[i] xⁱ`` on [low, high], its error multiplied by ``weight(x)``."""

    name: str
    degree: int
    low: Real
    high: Real
    factor: Callable[[Real], Real]
    weight: Callable[[Real], Real]


def sine(z: Real) -> Real:
    """P in sin r = r + r³ P(r²), pulled down by a sixteenth of an ulp of the sine at π/2.

    Evaluated in doubles, about one sine in 10⁷ next to π/2 would pass 1, by 2^-52. None of them does when
    lowered so, and that of π/2 itself stays 1 (cos 0 depends on it).
    """
    r = mp.sqrt(z)
    return (mp.sin(r) - r) / r**3 - mpf(2) ** -59


def sine_weight(z: Real) -> Real:
    r = mp.sqrt(z)
    return r**3 / mp.sin(r)


def coth(z: Real) -> Real:
    """P in r coth r = 1 + r² P(r²)."""
    r = mp.sqrt(z)
    return (r * mp.coth(r) - 1) / z


def coth_weight(z: Real) -> Real:
    r = mp.sqrt(z)
    return z / (r * mp.coth(r))


def log(w: Real) -> Real:
    """P in log((1 + s)/(1 - s)) = 2 s + s³ P(s²)."""
    s = mp.sqrt(w)
    return 2 * (mp.atanh(s) - s) / s**3


def log_weight(w: Real) -> Real:
    s = mp.sqrt(w)
    return s**3 / (2 * mp.atanh(s))


def sine_quarter(z: Real) -> Real:
    """P in sin r = r + r³ P(r²)."""
    r = mp.sqrt(z)
    return (mp.sin(r) - r) / r**3


def cosine(z: Real) -> Real:
    """P in cos r = 1 - r²/2 + r⁴ P(r²)."""
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def hyperbolic_sine(z: Real) -> Real:
    """P in sinh r = r + r³ P(r²)."""
    r = mp.sqrt(z)
    return (mp.sinh(r) - r) / r**3


def hyperbolic_sine_weight(z: Real) -> Real:
    r = mp.sqrt(z)
    return r**3 / mp.sinh(r)


def hyperbolic_cosine(z: Real) -> Real:
    """P in cosh r = 1 + r² P(r²)."""
    return (mp.cosh(mp.sqrt(z)) - 1) / z


def ratio(w: Real) -> Real:
    """P in log((2 + s)/(2 - s)) = s (1 + s² P(s²))."""
    s = mp.sqrt(w)
    return (2 * mp.atanh(s / 2) / s - 1) / w


def ratio_square(w: Real) -> Real:
    """P in log((2 + s)/(2 - s)) = s (1 + s²/12 + s⁴ P(s²))."""
    return (ratio(w) - mpf(1) / 12) / w


def arc_tangent(z: Real) -> Real:
    """P in atan r = r + r³ P(r²)."""
    r = mp.sqrt(z)
    return (mp.atan(r) - r) / r**3


def arc_tangent_weight(z: Real) -> Real:
    r = mp.sqrt(z)
    return r**3 / mp.atan(r)


def binary_logarithm(w: Real) -> Real:
    """P in log2((1 + s)/(1 - s)) = s P(s²)."""
    s = mp.sqrt(w)
    return 2 * mp.atanh(s) / (s * LN2)


def power_of_two(r: Real) -> Real:
    """P in 2^r = 1 + r P(r)."""
    return mp.expm1(r * LN2) / r


def inverse_root(h: Real) -> Real:
    """P in (1 - h)^(-1/3) = 1 + h P(h)."""
    return ((1 - h) ** (-mpf(1) / 3) - 1) / h


def inverse_root_square(h: Real) -> Real:
    """P in (1 - h)^(-2/3) = 1 + h P(h)."""
    return ((1 - h) ** (-mpf(2) / 3) - 1) / h


LN2 = mp.log(2)
MARGIN = 1 + mpf(1) / 200  # the reductions leave their ideal interval by a smaller fraction
FITS = [
    Fit("SINE", 7, mpf(0), (MARGIN * mp.pi / 2) ** 2, sine, sine_weight),
    # P in exp r = 1 + r + r² P(r)
    Fit(
        "EXP",
        9,
        -MARGIN * LN2 / 2,
        MARGIN * LN2 / 2,
        lambda r: (mp.expm1(r) - r) / r**2,
        lambda r: r**2 / mp.exp(r),
    ),
    # the longer side of -ln(2)/8 <= r <= 3 ln(2)/8
    Fit("COTH", 5, mpf(0), (MARGIN * 3 * LN2 / 8) ** 2, coth, coth_weight),
    # s = (m - 1)/(m + 1) with √½ <= m <= √2
    Fit("LOG", 6, mpf(0), (3 - mp.sqrt(8)) ** 2, log, log_weight),
    Fit("SINE_QUARTER", 6, mpf(0), (MARGIN * mp.pi / 4) ** 2, sine_quarter, sine_weight),
    Fit("COSINE_QUARTER", 5, mpf(0), (MARGIN * mp.pi / 4) ** 2, cosine, lambda z: z**2 / mp.cos(mp.sqrt(z))),
    # P in exp r = 1 + r + r²/2 + r³ P(r)
    Fit(
        "EXP_CUBIC",
        9,
        -MARGIN * LN2 / 2,
        MARGIN * LN2 / 2,
        lambda r: (mp.expm1(r) - r - r**2 / 2) / r**3,
        lambda r: abs(r) ** 3 / mp.exp(r),
    ),
    Fit("SINH", 4, mpf(0), (MARGIN * LN2 / 2) ** 2, hyperbolic_sine, hyperbolic_sine_weight),
    Fit("COSH", 5, mpf(0), (MARGIN * LN2 / 2) ** 2, hyperbolic_cosine, lambda z: z / mp.cosh(mp.sqrt(z))),
    # s/2 = (m - 1)/(m + 1) with √½ <= m <= √2
    Fit("RATIO", 6, mpf(0), (MARGIN * (6 - 2 * mp.sqrt(8))) ** 2, ratio, lambda w: w),
    Fit("RATIO_SQUARE", 7, mpf(0), (MARGIN * (6 - 2 * mp.sqrt(8))) ** 2, ratio_square, lambda w: w**2),
    # beyond tan(π/8) the reduction takes the distance to π/4
    Fit("ATAN", 11, mpf(0), (MARGIN * (mp.sqrt(2) - 1)) ** 2, arc_tangent, arc_tangent_weight),
    # the error of a logarithm that is the exponent of a power counts as such, not beside the logarithm
    Fit("LOG2", 7, mpf(0), (3 - mp.sqrt(8)) ** 2, binary_logarithm, lambda w: mp.sqrt(w)),
    Fit("EXP2", 10, -MARGIN / 2, MARGIN / 2, power_of_two, lambda r: abs(r) / 2**r),
    # what the bits of x leave of 1 - x y^3, and what the first step leaves of it
    Fit("ROOT_FIRST", 2, -mpf("0.1021"), mpf("0.1021"), inverse_root, lambda h: abs(h) * (1 - h) ** (mpf(1) / 3)),
    Fit("ROOT_SECOND", 1, -mpf("8.3e-6"), mpf("8.3e-6"), inverse_root_square, abs),
]


def value(coefficients: list[Real], x: Real) -> Real:
    return mp.fsum(c * x**i for i, c in enumerate(coefficients))


def remez(target: list[Real], weight: list[Real], grid: list[Real], count: int) -> list[Real]:
    """The minimax coefficients of x⁰ ... x^(count-1) on the grid, exchanging one point at a time."""
    nodes = [round((len(grid) - 1) * (k + 0.5) / (count + 1)) for k in range(count + 1)]
    while True:
        # unknown are the coefficients and the error that the nodes share, of alternating sign
        rows = [[weight[i] * grid[i] ** j for j in range(count)] + [(-1) ** k] for k, i in enumerate(nodes)]
        right = [weight[i] * target[i] for i in nodes]
        solution = list(mp.lu_solve(mp.matrix(rows), mp.matrix(right)))
        coefficients, level = solution[:-1], solution[-1]
        error = [w * (t - value(coefficients, x)) for w, t, x in zip(weight, target, grid, strict=True)]
        worst = max(range(len(grid)), key=lambda i: abs(error[i]))
        if abs(error[worst]) <= abs(level) * (1 + mpf(1) / 1000):
            return coefficients
        # the worst point takes the place of its neighbour of equal sign, or, beyond the last node, pushes
        k = sum(i < worst for i in nodes)
        if k == 0 and error[nodes[0]] * error[worst] < 0:
            nodes = [worst, *nodes[:-1]]
        elif k > count and error[nodes[-1]] * error[worst] < 0:
            nodes = [*nodes[1:], worst]
        else:
            nodes[k if k <= count and error[nodes[k]] * error[worst] > 0 else k - 1] = worst


def nodes(what: Fit) -> list[Real]:
    """An even number of Chebyshev points: none where a weight vanishes, at an end or in the middle."""
    middle, half, points = (what.low + what.high) / 2, (what.high - what.low) / 2, POINTS * (what.degree + 1)
    return [middle - half * mp.cos(mp.pi * (2 * i + 1) / (2 * points)) for i in range(points)]


def fit(what: Fit) -> list[float]:
    """The rounded coefficients."""
    terms, grid = what.degree + 1, nodes(what)
    weight = [what.weight(x) for x in grid]
    rest = [what.factor(x) for x in grid]
    rounded: list[float] = []
    for i in range(terms):
        rounded.append(float(remez(rest, weight, grid, terms - i)[0]))
        # go on with what the higher powers have to make up, divided by x; |x| keeps the weight positive
        rest = [(t - rounded[i]) / x for t, x in zip(rest, grid, strict=True)]
        weight = [w * abs(x) for w, x in zip(weight, grid, strict=True)]
    return rounded


def heading(what: Fit, coefficients: Sequence[float]) -> str:
    """The comment above some coefficients: where they are for, and their largest weighted error."""
    rounded = [mpf(c) for c in coefficients]
    error = max(abs(what.weight(x) * (what.factor(x) - value(rounded, x))) for x in nodes(what))
    interval = f"[{float(what.low):.5f}, {float(what.high):.5f}]"
    return f"# degree {what.degree} on {interval}, relative error 2^{float(mp.log(error, 2)):.1f}"


def main() -> None:
    for what in FITS:
        coefficients = fit(what)
        print(heading(what, coefficients))
        print(f"{what.name} = (\n" + "".join(f"    {c!r},\n" for c in coefficients) + ")")


if __name__ == "__main__":
    main()
