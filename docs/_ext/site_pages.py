"""Pages that follow from the program: one for every observer and plant, and the keys of every block.

They are written into docs/generated/ before the pages are read, and belong to no commit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import site_notebooks
from site_blocks import reference_page
from site_example import Example, of_observer, of_plant
from site_inline import readable
from site_markdown import keys_table, plain, table, without_errata
from site_symbols import symbols
from sphinx.application import Sphinx

from hgorun.analysis.finding import all_findings
from hgorun.commands.described import Description, Quantity, of_class, own_doc
from hgorun.noise.base import NOISE
from hgorun.observers.base import (
    OBSERVERS,
    AnyObserver,
    CorrectedObserver,
    DecidedObserver,
    HybridObserver,
    SampledObserver,
)
from hgorun.observers.capabilities import (
    Averaged,
    Differentiator,
    NoiseInformed,
    NotLinear,
    Punctual,
    SlidingMode,
    Switching,
)
from hgorun.observers.keys import Keys
from hgorun.plants.base import PLANTS, Plant
from hgorun.result.metrics.base import all_metrics

MEASUREMENTS: tuple[tuple[type, str], ...] = (
    (HybridObserver, "samples, of all outputs at the same times and without delay; it follows a flow between them"),
    (
        SampledObserver,
        "samples, of all outputs at the same times and without delay; it holds its estimate between them",
    ),
    (CorrectedObserver, "samples, at any times, with outputs missing at some of them"),
    (DecidedObserver, "continuous, sampled and late outputs, each output at times of its own"),
    (object, "continuous, sampled and late outputs, each output at times of its own"),
)
REMARKS: tuple[tuple[type, str], ...] = (
    (Differentiator, "It does not use the plant's equations."),
    (SlidingMode, "Its right-hand side jumps where the error is zero: no linear theory applies."),
    (Switching, "It needs a given `solver.step`, which is a part of its definition."),
    (Averaged, "It follows the mean of the plant's field over points around the estimate."),
    (NotLinear, "Linear theory may not apply, however small the error is."),
    (Punctual, "Late outputs are refused, unless the text above says that they are replayed."),
    (NoiseInformed, "Its design takes the noise from the block `measurement`, if its own keys do not say it."),
)


def pages(choice: Mapping[str, tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Path below docs/generated/ and text of every page.

    Parameters
    ----------
    choice : mapping of str to (str, str)
        When to take an observer, and when another one.
    """
    observers, plants = OBSERVERS.all(), PLANTS.all()
    for name, cls in observers.items():
        yield f"observers/{name}.md", observer_page(name, cls, choice.get(name))
    for name, kind in plants.items():
        yield f"plants/{name}.md", plant_page(name, kind)
    yield "observers.md", _list("Observers", "observers", {n: own_doc(c) for n, c in observers.items()}, _COMMON)
    yield "plants.md", _list("Plants", "plants", {n: own_doc(c) for n, c in plants.items()}, _OWN)
    yield "noise.md", noise_page()
    yield "blocks.md", reference_page()
    yield "quantities.md", quantities_page()


_COMMON = (
    "Every observer that comes with hgorun has a page: equations, class of plants, keys, references, and errors in the "
    "printed source. [Which observer to take](../choosing.md) compares them. In a terminal `hgorun list observers` and "
    "`hgorun show NAME` say the same, also of your own observers."
)
_OWN = (
    "A page for each plant that comes with hgorun. A plant of your own needs no Python: "
    "[write its equations into the configuration](../configuration.md#plant)."
)


def _list(title: str, folder: str, described: Mapping[str, str], text: str) -> str:
    rows = [(f"[`{name}`]({folder}/{name}.md)", readable(_first(doc))) for name, doc in described.items()]
    tree = "\n".join(["```{toctree}", ":hidden:", "", *(f"{folder}/{name}" for name in described), "```"])
    return f"# {title}\n\n{text}\n\n{table(('name', 'what it is'), rows)}\n\n{tree}\n"


def _first(doc: str) -> str:
    return " ".join(doc.split("\n\n")[0].split())


def observer_page(name: str, cls: type[AnyObserver], choice: tuple[str, str] | None) -> str:
    """What its class says, and a run of it."""
    found = of_class(name, "observer", cls)
    own = [key for key in found["keys"] if key["key"] not in Keys.model_fields]
    parts = [*_head(name, found), "## Measurements", f"It takes {_measurements(cls)}."]
    parts += [sentence for kind, sentence in REMARKS if issubclass(cls, kind)]
    if choice:
        parts += [
            "## When to take it",
            f"Take it when: {symbols(choice[0])}.",
            f"Take another one when: {symbols(choice[1])}.",
        ]
    parts += ["## Keys", keys_table(own, words=readable) if own else "It has no keys of its own."]
    parts.append("All observers also have [the common keys](../../configuration.md#observers).")
    parts += _shown(of_observer(name, cls), "A short run. Its gains are not tuned:")
    return "\n\n".join(part for part in parts if part) + "\n"


def _measurements(cls: type[AnyObserver]) -> str:
    found = next(words for kind, words in MEASUREMENTS if issubclass(cls, kind))
    return (
        found.replace("continuous, sampled and late", "continuous and sampled") if issubclass(cls, Punctual) else found
    )


def plant_page(name: str, cls: type[Plant]) -> str:
    """Its equations, parameters and a run of it alone."""
    found = of_class(name, "plant", cls)
    example = of_plant(name, cls)
    parts = [*_head(name, found), "## Equations as they are computed", example.equations]
    parts.append(f"Valid: {readable(found['valid'])}.")
    units = found["units"]
    if found["states"]:
        names = [(f"`{state}`", plain(units.get(state, ""))) for state in found["states"]]
        parts += ["## States", table(("state", "unit"), names)]
        parts.append("Measured: " + ", ".join(f"`{output}`" for output in found["outputs"]) + ".")
    for title, quantities in (("Parameters", found["parameters"]), ("Inputs", found["inputs"])):
        if quantities:
            rows = [
                (f"`{key}`", _default(q), plain(q.get("unit", "")), readable(q.get("meaning", "")))
                for key, q in quantities.items()
            ]
            parts += [f"## {title}", table(("name", "default", "unit", "meaning"), rows)]
    own = [key for key in found["keys"] if key["key"] not in Plant.model_fields]
    parts += ["## Keys of its own", keys_table(own, words=readable)] if own else []
    parts.append("All plants also have [the common keys](../../configuration.md#plant).")
    parts += _shown(Example(example.config, example.drawing, ""), "A short run, with inputs of 0.1:")
    return "\n\n".join(part for part in parts if part) + "\n"


def _default(q: Quantity) -> str:
    value = q.get("default")
    return "" if value is None else f"{value:g}"


def _head(name: str, found: Description) -> list[str]:
    text, errata = without_errata(found["description"])
    parts = [f"# {name}", text]
    parts += ["## Source", plain(found["reference"]) + "."] if found["reference"] else []
    parts += ["## What is printed, and what is right", "\n".join(f"- {one}" for one in errata)] if errata else []
    return parts


def _shown(example: Example | None, how: str) -> list[str]:
    if example is None:
        return []
    parts = ["## Example", how, f"```yaml\n{example.text}```"]
    parts.append(f"```{{raw}} html\n{example.drawing}\n```")
    if example.equations:
        parts += ["The equations of this example with all numbers:", example.equations]
    return parts


def noise_page() -> str:
    """Every kind of noise with its keys."""
    parts = [
        "# Noise",
        "The kinds of noise that [the block `measurement`](../configuration.md#measurement) can have, with their keys.",
    ]
    for name, cls in NOISE.all().items():
        found = of_class(name, "noise", cls)
        parts += [f"## {name}", without_errata(found["description"])[0], keys_table(found["keys"], words=readable)]
    return "\n\n".join(parts) + "\n"


def quantities_page() -> str:
    """Metrics and findings, from their records."""
    metrics = [(f"`{m.name}`", m.unit, plain(m.meaning)) for m in all_metrics(closed=True).values()]
    findings = [(f"`{f.name}`", plain(f.unit or ""), _marked(f.meaning)) for f in all_findings()]
    parts = [
        "# Metrics and findings",
        "What hgorun computes: metrics of every run, and the findings of [`hgorun analyze`](../analysis.md).",
        "## Metrics",
        "[The block `metrics`](../configuration.md#metrics) sets windows, the part of the peak and the moving mean.",
        table(("name", "unit", "meaning"), metrics),
        "## Findings",
        table(("name", "unit", "meaning"), findings),
    ]
    return "\n\n".join(parts) + "\n"


def _marked(text: str) -> str:
    return plain(text.replace(r"\|", "|"))


def read_choice(text: str) -> dict[str, tuple[str, str]]:
    """From the tables of docs/choosing.md: when to take an observer, and when another one."""
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \|$", text, re.MULTILINE)
    return {name: (take.strip(), other.strip()) for name, take, other in rows}


def report_page(file: Path) -> str:
    """The reproduction report, with its figures where they are."""
    return file.read_text(encoding="utf-8").replace("](report/", "](../../results/report/")


def write(docs: Path, more: Mapping[str, str] | None = None) -> None:
    """Write all pages; one that is the same is left alone, so that Sphinx does not read it again."""
    choosing = docs / "choosing.md"
    choice = read_choice(choosing.read_text(encoding="utf-8")) if choosing.is_file() else {}
    folder = docs / "generated"
    written = {folder / path: text for path, text in (*pages(choice), *(more or {}).items())}
    for old in set(folder.rglob("*.md")) - set(written):
        old.unlink()
    for path, text in written.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _before(app: Sphinx) -> None:
    docs = Path(app.srcdir)
    write(docs, {"report.md": report_page(docs.parent / "results" / "REPORT.md")})
    site_notebooks.write(docs / "tutorials", docs / "generated" / "notebooks")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", _before)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
