"""An observer as one file of C99: what moves it in time and what tells it of samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from hgorun.export.c_code import LAST, Real
from hgorun.export.c_functions import Functions
from hgorun.export.c_history import HISTORY
from hgorun.export.c_samples import SampleWriter
from hgorun.export.c_step import StepWriter
from hgorun.export.observer import Exported


@dataclass(frozen=True, eq=False, repr=False)
class Source:
    """Writes the file ``<label>.c``.

    Attributes
    ----------
    observer : Exported
    real : Real
    """

    observer: Exported
    real: Real

    @property
    def prefix(self) -> str:
        """Of functions and types."""
        return f"hgo_{self.observer.name}_"

    @property
    def upper(self) -> str:
        """Of macros."""
        return self.prefix.upper()

    @cached_property
    def functions(self) -> Functions:
        """The observer's equations."""
        return Functions(self.observer, self.real, self.prefix)

    def text(self) -> str:
        """The whole file, without the comment at its top."""
        body = "\n".join(self._functions())
        muladd = _MULADD if "~muladd(" in body.replace(self.prefix, "~") else ""
        names = [*(["float"] if "DBL_EPSILON" in body else []), "math", *(["stddef"] if "NULL" in body else [])]
        includes = f'#include "{self.observer.name}.h"\n\n' + "".join(f"#include <{name}.h>\n" for name in names) + "\n"
        return includes + self._filled(muladd) + body

    def _functions(self) -> Iterator[str]:
        observer = self.observer
        yield from self.functions.text()
        if observer.continuous or observer.inputs:
            yield self._filled(_LINES)
        if observer.remembered:
            yield self._filled(HISTORY)
        interface = list(self._interface())
        if f"{self.prefix}inputs(" in "\n".join(interface):  # an observer may do without the inputs
            yield self._filled(_INPUTS)
        yield from interface

    def _interface(self) -> Iterator[str]:
        """What is called from outside, and the steps."""
        observer = self.observer
        yield from self._init()
        yield from StepWriter(self.functions).text() if observer.flows else [self._filled(_WAIT)]
        if observer.sampled:
            yield from SampleWriter(self.functions).update()
        if observer.continuous:
            yield from SampleWriter(self.functions).measure()
        if observer.inputs:
            yield self._filled(_INPUT)
        if observer.compares:
            yield self._filled(_SILENCE)
        yield from self._estimate()

    def _filled(self, template: str) -> str:
        """A template with the names of this observer: ~ stands for the prefix, REAL for the type of numbers."""
        fast = "FP_FAST_FMAF" if self.real.single else "FP_FAST_FMA"
        text = template.replace("FAST_FMA", fast).replace("FMA(", f"{self.real.function('fma')}(")
        text = text.replace("ZERO", self.real.number(0.0)).replace("ONE", self.real.number(1.0))
        text = text.replace("LAST", LAST)
        return text.replace("REAL", self.real.name).replace("~~", self.upper).replace("~", self.prefix)

    def _init(self) -> Iterator[str]:
        observer, real = self.observer, self.real
        numbers = ", ".join(real.number(value) for value in observer.start)
        zero = real.number(0.0)
        yield f"void {self.prefix}init({self.prefix}observer *s)"
        yield "{"
        yield f"    static const {real.name} start[{observer.size}] = {{{numbers}}};"
        yield "    uint32_t i;"
        yield ""
        yield "    s->t = 0.0;"
        yield f"    for (i = 0U; i < {observer.size}U; ++i) {{"
        yield "        s->z[i] = start[i];"
        yield "    }"
        yield f"    for (i = 0U; i < {len(observer.outputs)}U; ++i) {{"
        if observer.compares:
            yield f"        s->mode[i] = {self.upper}SILENT;"
        if observer.sampled:
            yield f"        s->y[i] = {zero};"
            yield "        s->taken[i] = 0.0;"
            if observer.compares:
                yield f"        s->s[i] = {zero};"
        if observer.continuous:
            yield f"        {self.prefix}hold(&s->line[i], 0.0, {zero});"
        yield "    }"
        if observer.joins:
            yield f"    for (i = 0U; i < {observer.size}U; ++i) {{"
            yield "        s->before[i] = start[i];"
            yield "    }"
            yield "    s->joined = 0.0;"
            yield "    s->which = 0U;"
        if observer.clocks:
            yield "    s->samples = 0U;"
            yield "    s->sampled = 0.0;"
        if observer.inputs:
            yield f"    for (i = 0U; i < {len(observer.inputs)}U; ++i) {{"
            yield f"        {self.prefix}hold(&s->input[i], 0.0, {zero});"
            if observer.jump is not None and not observer.corrected:
                yield f"        s->before[i] = {zero};"
            yield "    }"
        if observer.remembered:
            yield "    s->pieces = 0U;"
            yield "    s->newest = 0U;"
            past = self.functions.all["past"]
            yield "    {"
            yield from (f"    {line}" for line in self.functions.read_now(past))
            yield f"        {past.call('s->first', z='s->z')}"
            yield "    }"
        yield from ("}", "")

    def _estimate(self) -> Iterator[str]:
        estimate = self.functions.all["estimate"]
        yield f"void {self.prefix}estimate(const {self.prefix}observer *s, {self.real.name} xhat[])"
        yield "{"
        yield from self.functions.read_now(estimate)
        yield f"    {estimate.call('xhat', z='s->z')}"
        yield from ("}", "")


_MULADD = """\
/* a b + c, rounded once where the processor can do so at once */
static inline REAL ~muladd(REAL a, REAL b, REAL c)
{
#ifdef FAST_FMA
    return FMA(a, b, c);
#else
    return (a * b) + c;
#endif
}

"""

_LINES = """\
/* a signal that has a value from now on */
static void ~hold(~line *line, double now, REAL value)
{
    line->since = now;
    line->until = now;
    line->level = value;
    line->slope = ZERO;
    line->last = value;
}

static REAL ~value(const ~line *line, double t)
{
    REAL value = line->last;

    if (t < line->until) {
        value = ~muladd(line->slope, (REAL)(t - line->since), line->level);
    }
    return value;
}

/* a signal that goes to a value at time t on a straight line, and stays there */
static void ~lead(~line *line, double now, double t, REAL value)
{
    const REAL level = ~value(line, now);

    ~hold(line, now, value);
    if (t > now) {
        line->until = t;
        line->level = level;
        line->slope = (value - level) / (REAL)(t - now);
    }
}
"""

_INPUTS = """\
/* the inputs at a time, and their slopes */
static void ~inputs(const ~observer *s, double t, REAL u[], REAL du[])
{
    uint32_t i;

    for (i = 0U; i < ~~INPUTS; ++i) {
        u[i] = ~value(&s->input[i], t);
        if (du != NULL) {
            du[i] = (t <= s->input[i].until) ? s->input[i].slope : ZERO;
        }
    }
}
"""

_INPUT = """\
uint32_t ~input(~observer *s, double t, const REAL u[])
{
    uint32_t status = ~~OK;
    uint32_t i;

    if (!((t >= 0.0) && (t <= LAST))) {
        status = ~~BAD_TIME;
    }
    for (i = 0U; i < ~~INPUTS; ++i) {
        if (!(fabs((double)u[i]) <= 1e300)) {
            status = ~~NOT_FINITE;
        }
    }
    for (i = 0U; (i < ~~INPUTS) && (status == ~~OK); ++i) {
        ~lead(&s->input[i], s->t, t, u[i]);
    }
    return status;
}
"""

_SILENCE = """\
void ~silence(~observer *s, uint32_t which)
{
    uint32_t i;

    for (i = 0U; i < ~~OUTPUTS; ++i) {
        if ((which & ((uint32_t)1U << i)) != 0U) {
            s->mode[i] = ~~SILENT;
        }
    }
}
"""

_WAIT = """\
uint32_t ~predict(~observer *s, double t)
{
    uint32_t status = ~~OK;

    if (!((t >= s->t) && (t <= LAST))) {
        status = ~~BAD_TIME;
    } else {
        s->t = t;
    }
    return status;
}
"""
