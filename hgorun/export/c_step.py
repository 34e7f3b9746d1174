"""What moves an observer in C from one time to another: the steps of an explicit Runge-Kutta method."""

from __future__ import annotations

import re
from collections.abc import Iterator

from hgorun.engine.methods import Row
from hgorun.export.c_code import LAST, Real
from hgorun.export.c_functions import Part
from hgorun.export.equations import Output

_UNROLLED = 64  # states


class StepWriter(Part):
    """Writes ``predict``, and what it calls."""

    def text(self) -> Iterator[str]:
        """All lines."""
        if not self.functions.written_out:
            yield from self._slope()
        yield from self._advance()
        yield from self._predict()

    def _slope(self) -> Iterator[str]:
        """The right-hand side as a function of its own."""
        p, real = self.prefix, self.real.name
        tau = f"const {real} tau[], " if self.functions.timed else ""
        body = self._evaluated("z", "dz")
        text = "\n".join(body)
        yield f"static void {p}slope(const {p}observer *s, double time,"
        yield f"    {tau}const {real} z[], {real} dz[])"
        yield from ("{", *body)
        yield from [] if "s->" in text or "(s," in text else ["    (void)s;"]
        yield from [] if _mentions(text, "time") else ["    (void)time;"]
        yield from ("}", "")

    def _slope_at(self, time: str, z: str, dz: str) -> list[str]:
        """Lines that fill dz with the right-hand side at a time and a state."""
        if not self.functions.written_out:
            tau = "tau, " if self.functions.timed else ""
            return [f"        {self.prefix}slope(s, {time}, {tau}{z}, {dz});"]
        body = self._evaluated(z, dz)
        needed = [f"            const double time = {time};"] if _mentions("\n".join(body), "time") else []
        return ["        {", *needed, *(f"        {line}" for line in body), "        }"]

    def _evaluated(self, z: str, dz: str) -> list[str]:
        """The innovation of every output, and what follows from it."""
        observer, real, functions = self.observer, self.real, self.functions.all
        rate, q = functions["rate"], len(observer.outputs)
        compared = [functions["guess"]] if any(o.continuous and o.delay is None for o in observer.outputs) else []
        late = [functions["delay"]] if any(o.delay is not None for o in observer.outputs) else []
        told = any("u" in function.arrays for function in (rate, *compared, *late))
        body = self.functions.told_at("time") if told else []
        body += [f"    {real.name} {f.output}[{f.size}];" for f in (*compared, *late)]
        body += [f"    {real.name} past;"] if late else []
        body += [f"    {real.name} e[{q}];", ""] if "e" in rate.arrays else []
        body += [f"    {f.call(f.output, z=z)}" for f in (*compared, *late)]
        if "e" in rate.arrays:
            body += [line for i, output in enumerate(observer.outputs) for line in self._innovation(i, output, z)]
        if not self.functions.written_out:
            return [*body, f"    {rate.call(dz, z=z)}"]
        return [*body, "    {", *(f"        {line}" for line in rate.lines(z, dz)), "    }"]

    def _innovation(self, i: int, output: Output, z: str) -> Iterator[str]:
        """Lines that set e[i]."""
        observer, zero = self.observer, self.real.number(0.0)
        alpha = "" if observer.alpha is None else f"{z}[{observer.alpha + i}]"
        yield f"    e[{i}] = {zero};"
        if output.sampled:
            yield f"    if (s->mode[{i}] == {self.upper}HELD) {{"
            yield f"        e[{i}] = (s->s[{i}] + {alpha}) - s->y[{i}];"
            yield "    }"
        if output.continuous:
            value = f"{self.prefix}value(&s->line[{i}], time)"
            yield f"    if (s->mode[{i}] == {self.upper}CONTINUOUS) {{"
            if output.delay is None:
                yield f"        e[{i}] = guess[{i}] - {value};"
            else:
                late = [k for k, o in enumerate(observer.outputs) if o.delay is not None].index(i)
                place = observer.remembered.index(i)
                yield f"        (void){self.prefix}recall(s, {place}U, time - (double)delay[{late}], &past);"
                yield f"        e[{i}] = (past + {alpha}) - {value};"
            yield "    }"
        if output.period is not None:
            period, half = self.real.number(output.period), self.real.number(0.5)
            yield f"    e[{i}] -= {period} * {self.real.function('floor')}((e[{i}] / {period}) + {half});"

    def _advance(self) -> Iterator[str]:
        """n equal steps; the state stays in local variables meanwhile."""
        observer, real, p = self.observer, self.real, self.prefix
        names = [f"k{j + 1}" for j in range(len(observer.method.c))]
        yield f"static void {p}advance({p}observer *s, double t, uint32_t n)"
        yield "{"
        yield "    const double start = s->t;"
        yield "    const double h = (t - start) / (double)n;"
        yield f"    const {real.name} dt = ({real.name})h;" if real.single else "    const double dt = h;"
        first = "start"
        if observer.sides and self.functions.timed:
            yield "    /* functions of time may jump at both ends: they are evaluated inside */"
            yield "    const double margin = 8.0 * DBL_EPSILON * (fabs(t) + h);"
            first = "start + margin"
        if self.functions.timed:
            yield f"    {real.name} tau[{len(observer.equations.clocked)}];"
        arrays = ["z", *(["stage"] if self._reads_stages else []), *names]
        yield from (f"    {real.name} {name}[{observer.size}];" for name in arrays)
        yield "    uint32_t k;"
        yield ""
        yield from self._each("z[#] = s->z[#];", "    ")
        if self.functions.timed:
            yield f"    {p}clock({first}, tau);"
        if observer.remembered:
            yield from (line[4:] for line in self._slope_at("start", "z", "k1"))
        yield "    for (k = 0U; k < n; ++k) {"
        yield from self._step(names, "t - margin" if first != "start" else "to")
        yield "    }"
        yield from self._each("s->z[#] = z[#];", "    ")
        yield "    s->t = t;"
        yield from ("}", "")

    @property
    def _reads_stages(self) -> bool:
        """Whether the slope depends on the state: that of an observer that holds still between samples may not."""
        return len(self.observer.method.c) > 1 and _mentions("\n".join(self._slope_at("from", "stage", "k2")), "stage")

    def _step(self, names: list[str], last: str) -> Iterator[str]:
        """The step from time ``from``; functions of time are evaluated at ``last`` at the end of the last step."""
        observer, method, p, timed = self.observer, self.observer.method, self.prefix, self.functions.timed
        end = "end" if last != "to" else "to"
        body: list[str] = []
        if observer.remembered:
            body += [f"        {p}piece piece;", ""]
            body += self._kept("0", "from")
        else:
            body += self._slope_at("from", "z", "k1")
        ticked = 0.0
        for c, row, name in zip(method.c[1:], method.stages, names[1:], strict=True):
            if self._reads_stages:
                body += self._combined(row, "stage", names)
            time = end if c == 1.0 else f"from + (h * {Real().number(c)})"
            if timed and c != ticked:
                body.append(f"        {p}clock({time}, tau);")
                ticked = c
            body += self._slope_at(time, "stage", name)
        body += self._combined(method.result, "z", names)
        if timed and ticked != 1.0:
            body.append(f"        {p}clock({end}, tau);")
        if observer.remembered:
            body += [*self._slope_at(end, "z", "k1"), *self._kept("1", end)]
            body += ["        piece.from = from;", "        piece.to = to;", f"        {p}remember(s, &piece);"]
            body += self._counted_anew()
        text = "\n".join(body)
        if _mentions(text, "from"):
            yield "        const double from = start + ((double)k * h);"
        if end == "end" or _mentions(text, "to"):
            yield "        const double to = ((k + 1U) == n) ? t : (start + ((double)(k + 1U) * h));"
        if end == "end":
            yield f"        const double end = ((k + 1U) == n) ? ({last}) : to;"
        yield from body

    def _kept(self, which: str, time: str) -> list[str]:
        """Lines that keep what the observer thinks of its outputs at one end of a step, and how that changes."""
        past, rate = self.functions.all["past"], self.functions.all["past_rate"]
        told = self.functions.told_at(time, slopes=True) if {"u", "du"} & {*past.arrays, *rate.arrays} else []
        calls = [past.call(f"piece.s{which}", z="z"), rate.call(f"piece.r{which}", z="z", dz="k1")]
        return [
            "        {",
            *(f"        {line}" for line in told),
            *(f"            {call}" for call in calls),
            "        }",
        ]

    def _counted_anew(self) -> list[str]:
        """Lines that now and then count alpha of late continuous outputs from zero again."""
        observer = self.observer
        late = [i for i, output in enumerate(observer.outputs) if output.delay is not None]
        if not late:
            return []
        assert observer.alpha is not None
        lines = [
            "        if (s->newest == 0U) {",
            "            /* alpha is counted from zero again, to keep its digits */",
        ]
        for i in late:
            alpha = f"z[{observer.alpha + i}]"
            lines.append(f"            {self.prefix}rebase(s, {observer.remembered.index(i)}U, {alpha});")
            if observer.outputs[i].sampled:
                lines.append(f"            s->s[{i}] += {alpha};")
            lines.append(f"            {alpha} = {self.real.number(0.0)};")
        return [*lines, "        }"]

    def _combined(self, row: Row, target: str, names: list[str]) -> list[str]:
        """target = z + dt scale sum_j weights[j] k_j, rounded as the engine rounds."""
        real, total = self.real, ""
        for weight, name in zip(row.weights, names, strict=False):
            if weight == 0.0:
                continue
            term, number = f"{name}[#]", real.number(weight)
            if not total:
                total = term if weight == 1.0 else f"{number} * {term}"
            else:
                total = f"({total}) + {term}" if weight == 1.0 else f"{self.prefix}muladd({number}, {term}, {total})"
        factor = "dt" if row.scale == 1.0 else f"dt * {real.number(row.scale)}"
        return list(self._each(f"{target}[#] = {self.prefix}muladd({factor}, {total}, z[#]);", "        "))

    def _each(self, statement: str, indent: str) -> Iterator[str]:
        """A statement for all states: one after the other, or in a loop where they are many."""
        size = self.observer.size
        if size <= _UNROLLED:
            yield from (indent + statement.replace("#", str(i)) for i in range(size))
            return
        yield f"{indent}{{"
        yield f"{indent}    uint32_t i;"
        yield ""
        yield f"{indent}    for (i = 0U; i < {size}U; ++i) {{"
        yield f"{indent}        {statement.replace('#', 'i')}"
        yield f"{indent}    }}"
        yield f"{indent}}}"

    def _go(self) -> Iterator[str]:
        """In equal steps to a later time, with what is needed to go on in shorter ones first."""
        p, early, number = self.prefix, self.observer.early, Real().number
        yield f"static void {p}go({p}observer *s, double t)"
        yield "{"
        yield f"    const double count = ceil(((t - s->t) / {number(self.observer.step)}) * (1.0 - 1e-9));"
        yield ""
        yield f"    {p}advance(s, t, (count > 1.0) ? (uint32_t)count : 1U);"
        yield from ("}", "")
        yield "/* close behind the start steps end at these times, too */"
        yield f"static void {p}begin({p}observer *s, double t)"
        yield "{"
        yield f"    static const double early[{early.times.size}] = {{"
        yield from (f"        {number(value)}," for value in early.times.tolist())
        yield "    };"
        yield "    uint32_t i;"
        yield ""
        yield f"    for (i = 0U; i < {early.times.size}U; ++i) {{"
        apart = number(early.apart)
        yield f"        if ((early[i] > (s->t + {apart})) && (early[i] < (t - {apart}))) {{"
        yield f"            {p}go(s, early[i]);"
        yield "        }"
        yield "    }"
        yield from ("}", "")

    def _predict(self) -> Iterator[str]:
        p, u, real, early = self.prefix, self.upper, self.real, self.observer.early.times
        if early.size:
            yield from self._go()
        yield f"uint32_t {p}predict({p}observer *s, double t)"
        yield "{"
        yield f"    const double count = ceil(((t - s->t) / {Real().number(self.observer.step)}) * (1.0 - 1e-9));"
        yield f"    uint32_t status = {u}OK;"
        yield ""
        yield f"    if (!((t >= s->t) && (t <= {LAST}))) {{"
        yield f"        status = {u}BAD_TIME;"
        yield f"    }} else if (!(count <= (double){u}MAX_STEPS)) {{"
        yield f"        status = {u}TOO_FAR;"
        yield "    } else if (t > s->t) {"
        yield "        uint32_t i;"
        yield ""
        if early.size:
            yield f"        if (s->t < {Real().number(float(early[-1]))}) {{"
            yield f"            {p}begin(s, t);"
            yield "        }"
            yield f"        {p}go(s, t);"
        else:
            yield f"        {p}advance(s, t, (count > 1.0) ? (uint32_t)count : 1U);"
        yield f"        for (i = 0U; i < {self.observer.size}U; ++i) {{"
        yield f"            if (!({real.function('fabs')}(s->z[i]) <= {real.largest})) {{"
        yield f"                status = {u}NOT_FINITE;"
        yield "            }"
        yield "        }"
        yield "    } else {"
        yield "        /* it is there already */"
        yield "    }"
        yield "    return status;"
        yield from ("}", "")


def _mentions(text: str, name: str) -> bool:
    """Whether a name stands in some lines by itself: it may be a part of the label that all functions are called by."""
    return re.search(rf"\b{name}\b", text) is not None
