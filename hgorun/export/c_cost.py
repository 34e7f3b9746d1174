"""What an exported observer costs: operations in the worst case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hgorun.export.c_source import Source


@dataclass(frozen=True)
class Cost:
    """Operations in the worst case.

    Attributes
    ----------
    plain : int
        Sums, products, comparisons.
    divisions : int
        Quotients and square roots.
    functions : int
        Calls of functions of libm.
    """

    plain: int = 0
    divisions: int = 0
    functions: int = 0

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.plain + other.plain, self.divisions + other.divisions, self.functions + other.functions)

    def times(self, count: int) -> Cost:
        """So many times the same."""
        return Cost(count * self.plain, count * self.divisions, count * self.functions)

    def __str__(self) -> str:
        return f"{self.plain} sums and products, {self.divisions} divisions and roots, {self.functions} calls of libm"


def costs(source: Source) -> Mapping[str, Cost]:
    """What a step, a sample and an estimate cost at most; a step as a prediction of one step alone does."""
    observer, functions = source.observer, source.functions.all
    equations, size, q = observer.equations, observer.size, len(observer.outputs)
    of_time = [k for name in equations.outputs for k in equations.needed(name) if equations.steps[k].clocked]
    clock = Cost(**equations.count(sorted(set(of_time)))) if source.functions.timed else Cost()

    def evaluated(name: str) -> Cost:
        function = functions.get(name)
        if function is None:
            return Cost()
        ops = function.operations
        return Cost(**ops.count([k for k in ops.needed(name) if not ops.steps[k].clocked]))

    told = Cost(plain=4).times(len(observer.inputs))

    def whole(name: str) -> Cost:
        """With the functions of time and the inputs that it reads."""
        arrays = functions[name].arrays if name in functions else ()
        return evaluated(name) + (clock if "tau" in arrays else Cost()) + (told if "u" in arrays else Cost())

    found: dict[str, Cost] = {}
    if observer.flows:
        periodic = Cost(plain=3, divisions=1, functions=1).times(sum(o.period is not None for o in observer.outputs))
        recalled = Cost(plain=110, divisions=1).times(sum(o.delay is not None for o in observer.outputs))
        slope = evaluated("rate") + evaluated("guess") + evaluated("delay") + Cost(plain=6).times(q) + told
        slope += periodic + recalled
        weights = [sum(w != 0.0 for w in row.weights) for row in (*observer.method.stages, observer.method.result)]
        stages = len(observer.method.c)
        combined = Cost(plain=sum(2 * count + 1 for count in weights)).times(size)
        step = slope.times(stages) + combined + clock.times(len({*observer.method.c, 1.0})) + Cost(8)
        if observer.remembered:
            step += slope + (evaluated("past") + evaluated("past_rate") + told).times(2)
        found["step"] = step
    sample = whole("guess") + Cost(plain=4).times(q)
    if observer.remembered:
        rebased = 2 * observer.pieces
        sample += Cost(plain=rebased + 110, divisions=1).times(len(observer.remembered))
    if observer.jump is not None:
        of_jump = observer.jump.needed("jump")
        sample += Cost(**observer.jump.count(of_jump))
    if observer.period is not None:
        sample += Cost(plain=8, divisions=1, functions=1)
    found["sample"] = sample
    found["estimate"] = whole("estimate")
    return found
