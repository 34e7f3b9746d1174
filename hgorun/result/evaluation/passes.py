"""The passes over the rows of a run that its metrics are made of, in machine code for the columns of one vector."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from hgorun.native.ir import Function

# The rows of what they find, one number a column: sums of e^2, |differences| of xhat and of x, and squares of the
# deviation of e - mean(e) from its mean; maxima of |e|; the last row above the limit; zero where all e are finite.
FOUND = ("squares", "way", "true_way", "rough", "largest", "peak", "last", "nothing")


class Passes:
    """The code for the columns of one vector.

    Parameters
    ----------
    f : Function
    arrays : dict of str to str
        ``work`` and ``error``, for one vector a row and one more, and ``found``.
    numbers : dict of str to str
        ``rows``, the windows' numbers, ``settled``, and the ``width`` of ``found``.
    place : str
        Where in a row of ``found`` the columns stand.
    xhat, x : callable
        The estimates and the truth of a row.
    """

    def __init__(
        self,
        f: Function,
        arrays: Mapping[str, str],
        numbers: Mapping[str, str],
        place: str,
        xhat: Callable[[str], str],
        x: Callable[[str], str],
    ) -> None:
        self.f, self.arrays, self.numbers, self.place = f, arrays, numbers, place
        self.xhat, self.x = xhat, x
        self.kept = {name: f.slot(f.real) for name in ("a", "b", "c", "x", "xhat", "peak")}

    def passes(self) -> None:
        """One after the other: errors and differences, the windows, settling, roughness."""
        self.errors()
        self.transient()
        self.steady()
        self.settling()
        self.roughness()

    def errors(self) -> None:
        """e = xhat - x of all rows; whether it is finite, and what it is differences of in the steady window."""
        f, n = self.f, self.numbers
        after = f.scalar("add", n["first"], "1")
        for name in "abc":
            self.start(name)
        with f.count(0, n["rows"]) as i:
            xhat, x = self.xhat(i), self.x(i)
            e = f.sub(xhat, x)
            self.write("error", i, e)
            self.add("c", f.mul(e, f.constant(0.0)))
            with f.when(f.test("sge", i, after)), f.when(f.test("slt", i, n["stop"])):
                self.add("a", self.size(f.sub(xhat, self.now("xhat"))))
                self.add("b", self.size(f.sub(x, self.now("x"))))
            self.keep("xhat", xhat)
            self.keep("x", x)
        for name, kept in (("way", "a"), ("true_way", "b"), ("nothing", "c")):
            self.give(name, self.now(kept))

    def transient(self) -> None:
        """The largest |e|, which is kept for settling."""
        self.start("peak")
        with self.f.count(self.numbers["early"], self.numbers["late"]) as i:
            self.grow("peak", self.size(self.read("error", i)))
        self.give("peak", self.now("peak"))

    def settling(self) -> None:
        """The number of the last row where |e| is above a part of the peak; -1 without one."""
        f = self.f
        limit = f.mul(f.splat(self.numbers["settled"]), self.now("peak"))
        self.start("a", -1.0)
        self.start("b")
        with f.count(0, self.numbers["rows"]) as i:
            above = f.compare("ogt", self.size(self.read("error", i)), limit)
            self.keep("a", f.select(above, self.now("b"), self.now("a")))
            self.add("b", f.constant(1.0))
        self.give("last", self.now("a"))

    def steady(self) -> None:
        """Squares and maxima; and in ``work`` the sums of e over all rows before each."""
        f, n = self.f, self.numbers
        for name in "abc":
            self.start(name)
        self.write("work", "0", f.constant(0.0))
        with f.count(n["first"], n["stop"]) as i:
            e = self.read("error", i)
            self.add("a", f.mul(e, e))
            self.grow("b", self.size(e))
            self.add("c", e)
            self.write("work", f.scalar("add", f.scalar("sub", i, n["first"]), "1"), self.now("c"))
        self.give("squares", self.now("a"))
        self.give("largest", self.now("b"))

    def roughness(self) -> None:
        """e minus its moving mean, in place of the sums in ``work`` that are no longer needed; then its deviation."""
        f, n = self.f, self.numbers
        length = f.scalar("sub", n["stop"], n["first"])
        count = f.scalar("add", f.scalar("sub", length, n["points"]), "1")
        middle = f.scalar("add", n["first"], f.scalar("sdiv", n["points"], "2"))
        points, many = (f.splat(f.let(f"sitofp i64 {number} to double")) for number in (n["points"], count))
        self.start("a")
        with f.count(0, count) as k:
            ahead = self.read("work", f.scalar("add", k, n["points"]))
            mean = f.div(f.sub(ahead, self.read("work", k)), points)
            rough = f.sub(self.read("error", f.scalar("add", middle, k)), mean)
            self.add("a", rough)
            self.write("work", k, rough)
        centre = f.div(self.now("a"), many)
        self.start("b")
        with f.count(0, count) as k:
            aside = f.sub(self.read("work", k), centre)
            self.add("b", f.mul(aside, aside))
        self.give("rough", self.now("b"))

    def read(self, name: str, row: str) -> str:
        """A row of an array of one vector a row."""
        return self.f.load(self.f.at(self.arrays[name], self.f.scalar("mul", row, str(self.f.lanes))), self.f.real)

    def write(self, name: str, row: str, value: str) -> None:
        place = self.f.at(self.arrays[name], self.f.scalar("mul", row, str(self.f.lanes)))
        self.f.store(value, place, self.f.real)

    def size(self, value: str) -> str:
        return self.f.intrinsic("fabs", value)

    def start(self, name: str, value: float = 0.0) -> None:
        self.keep(name, self.f.constant(value))

    def keep(self, name: str, value: str) -> None:
        self.f.store(value, self.kept[name], self.f.real)

    def now(self, name: str) -> str:
        return self.f.load(self.kept[name], self.f.real)

    def add(self, name: str, value: str) -> None:
        self.keep(name, self.f.add(self.now(name), value))

    def grow(self, name: str, value: str) -> None:
        """Keep the larger of what is kept and a value."""
        f, old = self.f, self.now(name)
        self.keep(name, f.select(f.compare("ogt", value, old), value, old))

    def give(self, name: str, value: str) -> None:
        """Write a number for each column."""
        f = self.f
        row = f.scalar("mul", self.numbers["width"], str(FOUND.index(name)))
        f.store(value, f.at(f.at(self.arrays["found"], row), self.place), f.real)
