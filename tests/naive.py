"""A slow, plain simulator of one plant and one constant-gain high-gain observer: the tests' oracle.

It shares no code with the package, and it is written to be checked by eye against the equations

    x'     = f(t, x)                                                    the plant, disturbance included
    xhat'  = fhat(t, xhat) - J^-1(xhat) kappa,      kappa = theta Delta^-1 K_n eta_1
    eta'   = theta ((A_r - K_r C_r) eta + B_r e_y)
    alpha' = -kappa_1
    e_y(t) = s(t - d) + alpha(t) - y_d(t),          s = h(xhat) - alpha,    y_d(t) = h(x(t - d)) + v(t)

(the filtered high-gain observer redesigned for delayed and sampled outputs). With r = 0 there is no eta and
e_y itself takes the place of eta_1: the standard high-gain observer. kappa_i = theta^i k_{r+i} eta_1.

Plant and observer are one ordinary differential equation in z = (x, xhat, eta, alpha), stepped together.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Run = dict[str, Vector]  # the result of a run, by name
Field = Callable[[float, Vector], Sequence[float] | Vector]


def binomial_gains(count: int, pole: float = 1.0) -> list[float]:
    """(K_r; K_n) of length `count` = r + n with all poles at -pole: (s + pole)^count without its first 1."""
    return [math.comb(count, j) * pole**j for j in range(1, count + 1)]


def saturated(fhat: Field, box: Sequence[tuple[float, float]]) -> Field:
    """A chain xhat_i' = xhat_{i+1} + phi_i(t, sat xhat): the linear xhat_{i+1} itself is not saturated.

    phi_i(t, w) = fhat_i(t, w) - w_{i+1} at w = sat xhat, so nothing but fhat is needed from the caller.
    """
    low, high = np.array(box, dtype=float).T

    def chain(t: float, xhat: Vector) -> Vector:
        w = np.clip(xhat, low, high)
        phi = np.array(fhat(t, w), dtype=float)
        phi[:-1] -= w[1:]
        return np.asarray(phi + np.append(xhat[1:], 0.0))

    return chain


def hermite(t: float, t_a: float, t_b: float, a: Vector, b: Vector, da: Vector, db: Vector) -> Vector:
    """The cubic through a at t_a and b at t_b with slopes da and db: exactly a and b at the ends."""
    w = t_b - t_a
    p = (t - t_a) / w
    values = (1 + 2 * p) * (1 - p) ** 2 * a + p**2 * (3 - 2 * p) * b
    return values + w * p * (1 - p) ** 2 * da - w * p**2 * (1 - p) * db


def increment(rate: Callable[[float, Vector], Vector], t: float, z: Vector, w: float, method: str) -> Vector:
    if method == "euler":
        return w * rate(t, z)
    k1 = rate(t, z)
    k2 = rate(t + w / 2, z + w / 2 * k1)
    k3 = rate(t + w / 2, z + w / 2 * k2)
    k4 = rate(t + w, z + w * k3)
    return w / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def step_count(gap: float, step: float) -> int:
    """ceil(gap / step), where a quotient such as 250.0000001 is a rounded 250 and not 251 steps."""
    return max(1, math.ceil(gap / step * (1 - 1e-9)))


def breakpoints(sources: Iterable[float], delay: Callable[[float], float], scan: Vector) -> list[float]:
    """Every t with t - delay(t) = source, between the first and last point of `scan`, four times over.

    A kink at a source comes back, one derivative weaker, when the delayed signal passes it; after four
    times it is too smooth to be seen by a method of order four.
    """
    lagged = np.array([t - delay(t) for t in scan])
    found: list[float] = []
    level = list(sources)
    for _ in range(4):
        roots = []
        for source in level:
            for i in np.flatnonzero((lagged[:-1] <= source) != (lagged[1:] <= source)):
                left, right = float(scan[i]), float(scan[i + 1])
                left_is_before = lagged[i] <= source
                while left < (middle := (left + right) / 2) < right:
                    if (middle - delay(middle) <= source) == left_is_before:
                        left = middle
                    else:
                        right = middle
                roots.append(right)
        level = merged(roots)
        found += level
    return found


def merged(times: Iterable[float]) -> list[float]:
    """Sorted, with times that differ by rounding only (0.3 and 0.1 + 0.2) made one."""
    result: list[float] = []
    for t in sorted(times):
        if not result or t - result[-1] > 1e-13 * max(1.0, abs(t)):
            result.append(float(t))
    return result


def schedule(
    sampling: Sequence[float] | Vector,
    delay: float | Sequence[float] | Vector | Callable[[float], float],
    noise: Sequence[float] | Vector | None,
    t0: float,
    t_end: float,
) -> list[tuple[float, float, float]]:
    """(t_k, taken_k, v_k) of every sample that arrives until t_end."""
    count = len(sampling)
    lags = [delay(t) for t in sampling] if callable(delay) else np.broadcast_to(delay, count)
    values = np.zeros(count) if noise is None else noise
    rows = [(float(t), float(d), float(v)) for t, d, v in zip(sampling, lags, values, strict=True)]
    if any(t < t0 or d < 0 for t, d, _ in rows):
        raise ValueError("a sample before the start, or a negative delay")
    return [(t, max(t - d, t0), v) for t, d, v in rows if t <= t_end]


def simulate(
    f: Field,
    h: Callable[[Vector], float],
    fhat: Field,
    x0: Sequence[float] | Vector,
    xhat0: Sequence[float] | Vector,
    *,
    theta: float,
    gains: float | Sequence[float],
    r: int,
    t_end: float,
    step: float,
    output_times: Sequence[float] | Vector,
    t0: float = 0.0,
    jinv: Callable[[Vector], Vector] | None = None,
    dh: Callable[[Vector], Vector] | None = None,
    eta0: Sequence[float] | Vector | None = None,
    box: Sequence[tuple[float, float]] | None = None,
    sampling: Sequence[float] | Vector | None = None,
    delay: float | Sequence[float] | Vector | Callable[[float], float] = 0.0,
    noise: Callable[[float, float], float] | Sequence[float] | Vector | None = None,
    multiplicative: bool = False,
    events: Sequence[float] | Vector = (),
    method: str = "rk4",
) -> Run:
    """Simulate plant and observer from t0 to t_end; t, x, xhat, eta, alpha at `output_times`.

    gains     (K_r; K_n) as r + n numbers, or one number p: all poles at -p (at theta = 1)
    jinv      J^-1(xhat), n x n; None: the identity, a chain
    dh        gradient of h, needed for continuous delays only; None: h(x) = x[0]
    box       [(lo, hi), ...] of every state: see `saturated`; chains only; J is not saturated
    sampling  None: continuous; otherwise the arrival times t_k, increasing
    delay     continuous: a number or d(t), continuous in t. Sampled: a number, d(t) evaluated at t_k, or d_k
    noise     continuous: v(t, mid), mid being the middle of the segment between two events that the step
              belongs to: a held v takes its value from mid, so that the last stage of a segment does not
              see the next value. Sampled: the numbers v_k. Never delayed
    events    what else to land on: kinks of f, fhat, d in t (which must be continuous), kinks and jumps of v

    Sampled runs also return `taken` and `y`: what each sample speaks of, and what it says.
    """
    n_x, n = len(x0), len(xhat0)
    gain = binomial_gains(r + n, gains) if isinstance(gains, int | float) else list(gains)
    if len(gain) != r + n or method not in ("rk4", "euler"):
        raise ValueError(f"{r + n} gains are needed, got {len(gain)}; or no method {method!r}")
    K_r, K_n = gain[:r], gain[r:]
    copy = fhat if box is None else saturated(fhat, box)
    grad = (lambda x: np.eye(len(x))[0]) if dh is None else dh

    def split(z: Vector) -> tuple[Vector, Vector, Vector, float]:
        return z[:n_x], z[n_x : n_x + n], z[n_x + n : -1], z[-1]

    # The times to land on.
    landings = [t0, t_end, *(t for t in events if t0 < t < t_end)]
    samples: list[tuple[float, float, float]] = []

    def lag(t: float) -> float:
        if callable(delay):
            return delay(t)
        assert isinstance(delay, int | float)
        return delay

    if sampling is not None:
        samples = schedule(sampling, delay, None if callable(noise) else noise, t0, t_end)
        landings += [t for t, _, _ in samples] + [taken for _, taken, _ in samples]
    else:
        scan = np.linspace(t0, t_end, max(2000, math.ceil(4 * (t_end - t0) / step)) + 1)
        lags = [lag(t) for t in scan]
        positive = min((d for d in lags if d > 0), default=math.inf)
        if min(lags) < 0 or (callable(delay) and positive < 1e-3 * step):
            raise ValueError("a negative delay, or one that vanishes gradually: then no step is small enough")
        step = min(step, positive)
        if positive < math.inf:
            landings += breakpoints(merged(landings), lag, scan)
    grid = merged(landings)
    grid[-1] = float(t_end)

    # What the observer is told.
    z = z_start = np.concatenate([x0, xhat0, np.zeros(r) if eta0 is None else eta0, [0.0]]).astype(float)
    # Steps made: t_a, t_b, z(t_a), z(t_b), z' right of t_a, z' left of t_b. z' jumps at events.
    steps: list[tuple[float, float, Vector, Vector, Vector, Vector]] = []
    starts: list[float] = []
    held: float | None = None  # s - y of the newest sample; None: nothing has arrived yet

    def s_and_y(z: Vector) -> Vector:
        x, xhat, _, alpha = split(z)
        return np.array([h(xhat) - alpha, h(x)])

    def s_and_y_slopes(z: Vector, dz: Vector) -> Vector:
        x, xhat, _, _ = split(z)
        dx, dxhat, _, dalpha = split(dz)
        return np.array([np.dot(grad(xhat), dxhat) - dalpha, np.dot(grad(x), dx)])

    def past(t: float) -> Vector:
        """(s, y) at an earlier time; both constant before the start."""
        if t <= t0 or not steps:
            return s_and_y(z_start)
        t_a, t_b, a, b, da, db = steps[bisect_right(starts, t) - 1]
        if t - t_b > 1e-6 * step:
            raise ValueError(f"t - d = {t} lies in the step that is being made")
        return hermite(t, t_a, t_b, s_and_y(a), s_and_y(b), s_and_y_slopes(a, da), s_and_y_slopes(b, db))

    def index_of(t: float) -> int:
        return int(np.argmin(np.abs(np.array(grid) - t)))

    def noisy(y: float, v: float) -> float:
        return y * (1 + v) if multiplicative else y + v

    def innovation(t: float, z: Vector, mid: float) -> float:
        x, xhat, _, alpha = split(z)
        if sampling is not None:
            return 0.0 if held is None else held + alpha
        v = noise(t, mid) if callable(noise) else 0.0
        if lag(t) == 0:
            return h(xhat) - noisy(h(x), v)
        s, y = past(t - lag(t))
        return float(s + alpha - noisy(y, v))

    def rates(t: float, z: Vector, mid: float) -> Vector:
        x, xhat, eta, _ = split(z)
        e_y = innovation(t, z, mid)
        signal = eta[0] if r else e_y
        kappa = np.array([theta**i * k * signal for i, k in enumerate(K_n, start=1)])
        correction = kappa if jinv is None else jinv(xhat) @ kappa
        shifted = np.append(eta[1:], e_y)  # A_r eta + B_r e_y
        deta = [theta * (shifted[j] - K_r[j] * eta[0]) for j in range(r)]
        return np.concatenate([f(t, x), copy(t, xhat) - correction, deta, [-kappa[0]]])

    # From event to event.
    at_event: list[Vector] = []
    received: list[float] = []
    arrives_at = [index_of(t) for t, _, _ in samples]
    newest = -math.inf
    for i, t_event in enumerate(grid):
        at_event.append(z)
        for (_, taken, v), where in zip(samples, arrives_at, strict=True):
            if where == i:
                s, y = s_and_y(at_event[index_of(taken)])
                received.append(noisy(y, v))
                # An older sample that comes late changes nothing; of two equally old the later counts.
                if taken >= newest:
                    newest, held = taken, s - received[-1]
        if i + 1 == len(grid):
            break
        t_next = grid[i + 1]
        count = step_count(t_next - t_event, step)
        width = (t_next - t_event) / count

        def rate(t: float, z: Vector, mid: float = (t_event + t_next) / 2) -> Vector:
            return rates(t, z, mid)

        for j in range(count):
            t_a = t_event + j * width
            t_b = t_next if j + 1 == count else t_event + (j + 1) * width
            z_b = z + increment(rate, t_a, z, width, method)
            steps.append((t_a, t_b, z, z_b, rate(t_a, z), rate(t_b, z_b)))
            starts.append(t_a)
            z = z_b

    # What was asked for.
    times = np.array(output_times, dtype=float)
    if np.any(times < t0 - 1e-9) or np.any(times > t_end + 1e-9):
        raise ValueError(f"output outside [{t0}, {t_end}]")
    out = np.array([hermite(t, *steps[bisect_right(starts, t) - 1]) for t in np.clip(times, t0, t_end)])
    parts = dict(zip(("x", "xhat", "eta", "alpha"), split(out.T), strict=True))
    result = {"t": times} | {name: np.asarray(value).T for name, value in parts.items()}
    if sampling is not None:
        result |= {"taken": np.array([taken for _, taken, _ in samples]), "y": np.array(received)}
    return result
