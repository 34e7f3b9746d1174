"""Methods of integration as tableaux: explicit Runge-Kutta methods, and Rosenbrock methods for stiff systems."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, eq=False, repr=False)
class Row:
    """z + h * scale * sum_j weights[j] k_j: weights of one cost no multiplication."""

    weights: tuple[float, ...]
    scale: float = 1.0


@dataclass(frozen=True, eq=False, repr=False)
class Method:
    """An explicit Runge-Kutta method.

    Attributes
    ----------
    order : int
        Global order of convergence.
    c : tuple of float
        Stage times, as parts of the step.
    stages : tuple of Row
        From the second stage on.
    result : Row
        The step.
    error : tuple of float, optional
        Weights of an embedded error estimate, over the stages and the derivative at the end of the step.
    dense : tuple of float, optional
        Weights of the fifth coefficient of Dormand and Prince's continuous extension, same stages.
    """

    name: str
    order: int
    c: tuple[float, ...]
    stages: tuple[Row, ...]
    result: Row
    error: tuple[float, ...] = ()
    dense: tuple[float, ...] = ()


EULER = Method("euler", 1, (0.0,), (), Row((1.0,)))

RK4 = Method(
    "rk4",
    4,
    (0.0, 0.5, 0.5, 1.0),
    (Row((1.0,), 0.5), Row((0.0, 1.0), 0.5), Row((0.0, 0.0, 1.0))),
    Row((1.0, 2.0, 2.0, 1.0), 1 / 6),
)

# Dormand and Prince 1980; the continuous extension is Hairer, Norsett and Wanner's (II.6), fourth order.
DOPRI5 = Method(
    "dopri5",
    5,
    (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
    (
        Row((1 / 5,)),
        Row((3 / 40, 9 / 40)),
        Row((44 / 45, -56 / 15, 32 / 9)),
        Row((19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729)),
        Row((9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)),
    ),
    Row((35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)),
    error=(71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
    dense=(
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ),
)


@dataclass(frozen=True, eq=False, repr=False)
class Rosenbrock:
    """A Rosenbrock method, linearly implicit: one matrix W = 1/(h gamma) - df/dz a step, and no iteration.

    W u_i = f(t + c_i h, z + sum_j a_ij u_j) + sum_j (coupling_ij / h) u_j + h drift_i df/dt, i = 1 to the number of
    stages, W and df/dt at the start of the step. The step is z + sum_i result_i u_i; for 0 <= s <= 1

        z(t + s h) = (1 - s) z + s (z_new + (1 - s) (d_1 + s (d_2 + s d_3))),  d_r = sum_i dense_ri u_i.

    Attributes
    ----------
    order : int
        Global order of convergence.
    gamma : float
    c, drift : tuple of float
        Of every stage.
    stages, coupling : tuple of tuple of float
        The rows of a and of the coupling, from the second stage on.
    result, error : tuple of float
        Weights of the step, and of an embedded error estimate.
    dense : tuple of tuple of float
    """

    name: str
    order: int
    gamma: float
    c: tuple[float, ...]
    drift: tuple[float, ...]
    stages: tuple[tuple[float, ...], ...]
    coupling: tuple[tuple[float, ...], ...]
    result: tuple[float, ...]
    error: tuple[float, ...]
    dense: tuple[tuple[float, ...], ...]


# Steinebach 2023 (BIT Numer. Math. 63:27): L-stable and stiffly accurate. It keeps order 5 for differential-algebraic
# equations of index 1, which is what a stiff system comes close to.
_RODAS5P_LAST = (
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
)
RODAS5P = Rosenbrock(
    "rodas5p",
    5,
    gamma=0.21193756319429014,
    c=(0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0),
    drift=(
        0.21193756319429014,
        -0.42387512638858027,
        -0.3384627126235924,
        1.8046452872882734,
        2.325825639765069,
        0.0,
        0.0,
        0.0,
    ),
    stages=(
        (3.0,),
        (2.849394379747939, 0.45842242204463923),
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        _RODAS5P_LAST,
        (*_RODAS5P_LAST, 1.0),
        (*_RODAS5P_LAST, 1.0, 1.0),
    ),
    coupling=(
        (-14.155112264123755,),
        (-17.97296035885952, -2.859693295451294),
        (147.12150275711716, -1.41221402718213, 71.68940251302358),
        (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
        (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
        (
            30.91273214028599,
            -3.1208243349937974,
            77.79954646070892,
            34.28646028294783,
            -19.097331116725623,
            -28.087943162872662,
        ),
        (
            37.80277123390563,
            -3.2571969029072276,
            112.26918849496327,
            66.9347231244047,
            -40.06618937091002,
            -54.66780262877968,
            -9.48861652309627,
        ),
    ),
    result=(*_RODAS5P_LAST, 1.0, 1.0, 1.0),
    error=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    dense=(
        (
            25.948786856663858,
            -2.5579724845846235,
            10.433815404888879,
            -2.3679251022685204,
            0.524948541321073,
            1.1241088310450404,
            0.4272876194431874,
            -0.17202221070155493,
        ),
        (
            -9.91568850695171,
            -0.9689944594115154,
            3.0438037242978453,
            -24.495224566215796,
            20.176138334709044,
            15.98066361424651,
            -6.789040303419874,
            -6.710236069923372,
        ),
        (
            11.419903575922262,
            2.8879645146136994,
            72.92137995996029,
            80.12511834622643,
            -52.072871366152654,
            -59.78993625266729,
            -0.15582684282751913,
            4.883087185713722,
        ),
    ),
)

METHODS: dict[str, Method | Rosenbrock] = {method.name: method for method in (EULER, RK4, DOPRI5, RODAS5P)}
