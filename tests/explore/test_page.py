"""The report of an ensemble: what is on the page, and the page in a real browser."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from collected_files import write
from shell import Shell

pytest.importorskip("bokeh", reason="needs hgorun[explore]")

import browser

from hgorun.ensemble.growing import read_sweep
from hgorun.explore import drawing, page, statistics
from hgorun.figures.ensemble import Cast
from hgorun.tables import ensemble

THETA, PERIOD = "observers.F.theta", "measurement.sampling.period"
FEW_BYTES = 10_000_000


def made(path: Path, seeds: int = 12, other: str = "S") -> Path:
    """Gains, periods and seeds; two observers, one of which is lost at the largest gain; trajectories of some."""
    random = np.random.default_rng(4)
    shape = (3, 2, seeds, 2, 2)
    metrics = {name: random.lognormal(sigma=0.3, size=shape) for name in ("rmse", "hf", "settling")}
    status = np.zeros(shape[:-1])
    status[2, :, 3:, 1] = 2
    for values in metrics.values():
        values[status > 1] = np.inf
    time = np.linspace(0, 4, 101)
    followed = np.arange(0, 6 * seeds, seeds)
    x = np.stack([np.sin(time), np.cos(time)], axis=-1)[None].repeat(len(followed), axis=0)
    xhat = x[:, None] + random.normal(size=(len(followed), 2, 101, 2))
    axes = {THETA: [2.0, 4.0, 8.0], PERIOD: [0.1, 0.2], "seed": range(seeds)}
    return write(
        path,
        axes,
        metrics,
        observers=["F", other],
        states=["x1", "x2"],
        status=status,
        trajectories={"member": followed, "time": time, "x": x, "xhat": xhat},
        types={"F": ("fhgo2", 1), other: ("shgo", -1)},
        units={"time": "h", "x1": "g/L", "x2": "1"},
    )


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    made(tmp_path / "a.sweep.h5")
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.measured
@pytest.mark.slow
def test_the_page_needs_nothing_but_itself(shell: Shell) -> None:
    code, out, err = shell("report", "a.sweep.h5", "-o", "page.html")
    assert (code, err, out) == (0, "", "written: page.html\n")
    html = (shell.folder / "page.html").read_text()
    assert len(html.encode()) < FEW_BYTES
    assert re.search(r"<(script[^>]+src|link[^>]+href)\s*=", html) is None
    for heading in ("Statistics", "Paired differences", f"Against {THETA}", "Maps", "Along time"):
        assert f"<h2>{heading}</h2>" in html


@pytest.mark.slow
def test_names_from_a_file_are_text_on_the_page(shell: Shell) -> None:
    made(shell.folder / "b.sweep.h5", other="</script><i>")
    pages = []
    for name in "ab":
        shell("report", f"{name}.sweep.h5", "--metric", "rmse")
        pages.append((shell.folder / "results" / f"{name}.html").read_text())
    assert pages[0].count("</script>") == pages[1].count("</script>")


def test_only_some_members_and_metrics(shell: Shell) -> None:
    code, _, _ = shell("report", "a.sweep.h5", "--at", "theta=4", "--at", "period=0.1", "--metric", "hf", "-q")
    assert code == 0
    html = (shell.folder / "results" / "a.html").read_text()
    assert "<h2>Spread</h2>" in html
    assert "<h2>Maps</h2>" not in html
    assert "rmse" not in html


def test_what_does_not_fit_is_refused(shell: Shell) -> None:
    assert shell("report", "missing.sweep.h5")[0] == 2
    write(shell.folder / "p.sweep.h5", {"seed": range(2)}, {"sup": np.ones((2, 0, 1))}, observers=[], states=["x1"])
    code, _, err = shell("report", "p.sweep.h5")
    assert code == 2
    assert "it has no observers" in err
    code, _, err = shell("report", "a.sweep.h5", "-o", "page.pdf")
    assert code == 2
    assert ".html" in err


def drawn_of(plot: drawing.Plot, kind: str) -> list[dict[str, np.ndarray]]:
    """The points of all glyphs of a kind."""
    glyphs = [one for one in plot.renderers if type(one.glyph).__name__ == kind]
    return [{name: np.asarray(values) for name, values in one.data_source.data.items()} for one in glyphs]


def test_what_is_lost_leaves_the_figures_of_the_report(tmp_path: Path) -> None:
    """Of S more than half are lost at the largest gain: its bands go beyond an axis that ends with the others."""
    members = read_sweep(made(tmp_path / "a.sweep.h5"))
    cast = Cast(members)
    plot = drawing.against(cast, THETA, "rmse", "x1")
    largest = float(np.max(members.metrics["rmse"][members.sound]))
    assert plot.y_range.end < 2 * largest
    wide = drawn_of(plot, "VArea")[2]
    assert wide["high"].max() > 100 * largest
    crosses = [one for one in plot.renderers if getattr(one.glyph, "marker", "") == "x"]
    assert [one.data_source.data["x"] for one in crosses] == [[8.0]]
    notes = {heading: note for heading, note, _ in page._figures(members, ["rmse"])}
    said = f"estimates are lost in {int(np.sum(~members.sound.all(axis=1)))} of 72 members and count as infinite"
    assert f"{said}; bands leave the panel there; ×: half or more are lost" in notes[f"Against {THETA}"]
    seeds = members.where((members.axes[THETA] == 8) & (members.axes[PERIOD] == 0.1))
    boxes = drawing.boxes(Cast(seeds), "rmse", "x1")
    assert drawn_of(boxes, "Text")[0]["told"].tolist() == ["", "9 lost"]
    none = drawing.boxes(Cast(members.where(np.zeros(len(members), dtype=bool))), "rmse", "x1")
    assert (none.y_range.start, none.y_range.end) == (0.0, 1.0)


def test_the_report_has_the_integration_error(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    members = read_sweep("a.sweep.h5")
    errors = np.full((len(members), 3), np.nan)
    errors[3:5] = [[1e-4, 0.2, 0.3], [2e-4, 0.1, 0.4]]
    members = replace(members, integration_error=errors)
    monkeypatch.setattr("hgorun.commands.ensembles.read_sweep", lambda _: members)
    monkeypatch.setattr(page, "write_page", lambda found, path: path)
    code, _, err = shell("report", "a.sweep.h5", "-o", "a.html")
    assert code == 0
    assert [line.split("; ")[0] for line in err.splitlines()] == [
        f"hgorun: {members.name}: observer {label}: the integration error is about {error} in the worst member checked"
        for label, error in (("F", 0.2), ("S", 0.4))
    ]
    said = "integration error, the largest of the 2 members checked: plant 2.0e-04, F 2.0e-01, S 4.0e-01."
    notes = {heading: note for heading, note, _ in page._sections(ensemble.compared(members, [THETA], ["hf"]))}
    assert said in notes["Statistics"]


def test_the_report_tells_of_times_that_never_come(tmp_path: Path) -> None:
    """All members of F at the smallest gain, in x1; a few at the next one."""
    members = read_sweep(made(tmp_path / "a.sweep.h5"))
    theta, seed = members.axes[THETA], members.axes["seed"]
    settling = members.metrics["settling"].copy()
    settling[(theta == 2) | ((theta == 4) & (seed < 3)), 0, 0] = 40.0
    members = replace(members, metrics={**members.metrics, "settling": settling}, end=40.0)
    found = ensemble.compared(members, [THETA], ["settling", "hf"])
    table = statistics.of_observers(found).source.data
    keys = zip(*(table[name] for name in ("theta", "observer", "state", "metric")), strict=True)
    counts = dict(zip(keys, table["never"], strict=True))
    assert [counts[at, "F", "x1", "settling"] for at in (2.0, 4.0, 8.0)] == [24, 6, 0]
    assert counts[2.0, "F", "x1", "hf"] == 0
    assert "never" not in statistics.of_observers(ensemble.compared(members, [THETA], ["hf"])).source.data
    notes = {heading: note for heading, note, _ in page._sections(found)}
    assert "settling: never, where noise" in notes["Statistics"]
    assert "settling of F x1: 6 of 24 members never settle, in the row with most" in notes["Statistics"]
    assert "integration error" not in notes["Statistics"]
    maps = drawing.heat_maps(Cast(members), (THETA, PERIOD), "settling", "x1")
    assert drawn_of(maps[0], "Rect")[0]["shown"].tolist().count("lost or never") == 2
    points = [drawn["y"] for drawn in drawn_of(drawing.trade_off(Cast(members), ("hf", "settling"), "x1"), "Scatter")]
    assert np.nanmax(np.concatenate(points)) < 40


@pytest.mark.parametrize("error", [False, True])
def test_trajectories_that_are_lost_leave_the_figures_of_the_report(tmp_path: Path, error: bool) -> None:
    members = read_sweep(made(tmp_path / "a.sweep.h5"))
    assert members.trajectories is not None
    members.trajectories.xhat[2:, 1, 50] = 1e8
    members.trajectories.xhat[2:, 1, 51:] = np.nan
    plot = drawing.along_time(Cast(members), "x1", error=error)
    assert plot.y_range.end < 100
    crosses = [one for one in plot.renderers if getattr(one.glyph, "marker", "") == "x"]
    assert [one.data_source.data["x"] for one in crosses] == [pytest.approx([2.04])]
    start, end = plot.y_range.start, plot.y_range.end
    (height,) = crosses[0].data_source.data["y"]
    assert start < height < end


def test_axes_and_columns_have_their_units(tmp_path: Path) -> None:
    """Also what a sweep varies besides times; means have the digits of their uncertainty."""
    std = "measurement.noise.0.std"
    assert drawing.axis_name(std, {"time": "h", std: "g/L"}) == "std of noise [g/L]"
    assert drawing.axis_name(THETA, {"time": "h"}) == "theta of F"
    of_phi = "measurement.outputs.phi"
    assert drawing.axis_name(f"{of_phi}.noise.0.std", {}) == "std of noise of phi"
    assert drawing.axis_name(f"{of_phi}.delay", {"time": "h"}) == "delay of phi [h]"
    assert drawing.axis_name(PERIOD, {"time": "h"}) == "period [h]"
    found = ensemble.compared(read_sweep(made(tmp_path / "a.sweep.h5")), [PERIOD, THETA])
    columns = statistics.of_observers(found).source.data
    assert columns["period [h]"][0] == 0.1
    assert columns["unit"][:2] == ["g/L", "1"]
    text = ensemble.text([ensemble.compared(found.members, [PERIOD, THETA], ["rmse"])])
    assert f"{columns['mean as text'][0]} ± {columns['± as text'][0]}" in text
    assert ", over all values of period [h]" in page._pooled(found.members, [THETA])
    pairs = statistics.of_pairs(found).source.data
    assert pairs["unit"][0] == "g/L"


def test_without_units_no_column_has_them(tmp_path: Path) -> None:
    values = np.array([[1.0, 2.0], [1.5, 2.25]])[:, :, None]
    path = write(tmp_path / "s.sweep.h5", {"seed": range(2)}, {"rmse": values}, observers=["F", "S"], states=["x1"])
    columns = statistics.of_observers(ensemble.compared(read_sweep(path), [])).source.data
    assert "unit" not in columns


LOGARITHMIC = [(0.9, 9.2, [1, 2, 5]), (0.005, 0.17, [0.005, 0.01, 0.02, 0.05, 0.1]), (1e-6, 9, [1e-6, 1e-4, 0.01, 1])]
_RIM_OF_FIGURE = """(() => {
  const canvas = deep('.bk-events')[0].getRootNode().querySelector('canvas');
  return Math.max(...canvas.getContext('2d').getImageData(0, 0, 1, canvas.height).data);
})()"""


@pytest.mark.unmeasured
@pytest.mark.slow
@pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium")
def test_in_a_real_browser(shell: Shell) -> None:
    """It shows its figures and tables, asks nobody for anything, complains of nothing, and sorts when clicked."""
    shell("report", "a.sweep.h5", "-o", "page.html")
    path = shell.folder / "page.html"
    seen: dict[str, object] = {}
    rims: dict[str, list[tuple[str, str, float, float]]] = {"dark": [], "light": []}

    async def look(page: browser.Page) -> None:
        await page.until("window.Bokeh !== undefined && Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle")
        await page.value(_DEEP)
        column = "deep('.slick-cell.r3').slice(0, 8).map(cell => cell.textContent).join()"
        seen["before"] = await page.value(column)
        head = "deep('.slick-header-column').find(head => head.textContent.trim() == 'state').click()"
        await page.value(head)
        await page.until(f"({column}) != {seen['before']!r}")
        seen["after"] = await page.value(column)
        metric = "deep('.slick-header-column').find(head => head.textContent.trim() == 'metric')"
        await page.until(f"{metric}.tabIndex == 0")
        await page.value(f"{metric}.focus()")
        await page.press("Enter")
        await page.until("deep('.slick-cell.r4').slice(0, 8).every(cell => cell.textContent.trim() == 'hf')")
        await page.value("document.querySelector('.tabs').scrollIntoView()")
        await page.until("deep('.bk-events').length && deep('.bk-events').every(one => one.getAttribute('aria-label'))")
        tools = "deep('[class*=Button][tabindex]')"
        await page.until(f"{tools}.length > 8 && {tools}.every(one => one.getAttribute('role') == 'button')")
        columns = await page.value("deep('.bk-data-table')[0].querySelectorAll('.slick-header-column').length")
        for scheme in ("dark", "light"):
            await page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            assert float(await page.value(_CELLS)) >= 4.5
            await page.value("document.querySelector('.part').focus()")
            for _ in range(columns + 4):  # past the heads of the columns, and out of the table
                rims[scheme].append(json.loads(await page.value(_RIM)))
                await page.press("Tab")
        assert await page.value("!document.querySelector('.part').contains(document.activeElement)")
        for low, high, ticks in LOGARITHMIC:
            asked = f"new Function('cb_data', 'most', {json.dumps(drawing._ticks())})({{start: {low}, end: {high}}}, 5)"
            assert await page.value(asked) == ticks
        assert await page.value(_RIM_OF_FIGURE) == 0  # the page is seen: a colour would stay when the scheme changes
        made_before = int(await page.value("Bokeh.documents.length"))
        await page.value("document.querySelectorAll('.tabs button')[1].click()")
        await page.value("document.querySelector('.tabs').scrollIntoView()")
        await page.until(f"Bokeh.documents.length > {made_before} && document.querySelector('.panel').hidden")
        assert await page.value("document.querySelectorAll('.tabs button')[1].ariaSelected") == "true"
        seen["unmade"] = await page.value("document.querySelectorAll('.panel > script').length")
        await page.resize(320, 800)  # 1280 at 400 %
        await page.until("document.documentElement.scrollWidth <= 320")
        figures = "[...document.querySelectorAll('.part')].filter(part => part.querySelector('.tabs'))"
        await page.until(f"{figures}.every(part => part.scrollWidth <= part.clientWidth)")  # one below the other
        cut = "deep('.slick-cell').filter(one => one.scrollWidth > one.clientWidth).map(one => one.textContent)"
        assert await page.value(cut) == []

    page = browser.opened(path, look)
    assert page.complaints == []
    assert page.requests == [path.resolve().as_uri()]
    for found in rims.values():
        assert any("slick-pane" in name for name, *_ in found)  # what scrolls
        assert all(style == "solid" and width >= 2 and contrast >= 3 for _, style, width, contrast in found)
    assert int(str(seen["unmade"])) > 4  # figures behind tabs and below are not made in vain
    assert seen["before"] == "x1,x2,x1,x2,x1,x2,x1,x2"
    assert seen["after"] == ",".join(["x1"] * 8)


@pytest.mark.slow
@pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium")
def test_numbers_have_significant_digits(shell: Shell) -> None:
    """However small they are; a mean has those of its uncertainty, as in a terminal; what is not known is a dash."""
    values = 1e-5 * np.array([[1.23456, 1.25], [1.3, 3.0]])[:, :, None]
    write(shell.folder / "s.sweep.h5", {"seed": range(2)}, {"rmse": values}, observers=["F", "S"], states=["x1"])
    shell("report", "s.sweep.h5", "-o", "s.html")
    seen: dict[str, object] = {}

    async def look(page: browser.Page) -> None:
        await page.until("window.Bokeh !== undefined && Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle")
        await page.value(_DEEP)
        seen["cells"] = await page.value("deep('.slick-cell').map(cell => cell.textContent.trim()).join()")

    page = browser.opened(shell.folder / "s.html", look)
    assert page.complaints == []
    cells = str(seen["cells"]).split(",")
    assert {"1.27e-05", "0.42e-05"} <= set(cells)  # the mean of F, and half its interval
    assert "3.272e-7" in cells  # its standard error
    assert "0.0000" not in cells


# what has the focus: its class, and of its outline the style, the width, and the contrast to what is behind
_RIM = """(() => {
  let one = document.activeElement;
  while (one.shadowRoot?.activeElement) one = one.shadowRoot.activeElement;
  const light = (text) => { const [r, g, b] = text.match(/[\\d.]+/g).slice(0, 3).map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  let behind = 'rgb(255, 255, 255)';
  for (let at = one; at; at = at.parentElement ?? at.getRootNode().host) {
    const colour = getComputedStyle(at).backgroundColor;
    if (!/, 0\\)$/.test(colour)) { behind = colour; break; }
  }
  const { outlineStyle, outlineWidth, outlineColor } = getComputedStyle(one);
  const [x, y] = [light(outlineColor), light(behind)].sort((p, q) => q - p);
  return JSON.stringify([one.className, outlineStyle, parseFloat(outlineWidth), (x + 0.05) / (y + 0.05)]);
})()"""

# the least contrast of cells of a table to the rows behind them
_CELLS = """Math.min(...deep('.slick-cell').map(cell => {
  const light = (text) => { const [r, g, b] = text.match(/[\\d.]+/g).slice(0, 3).map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const [x, y] = [getComputedStyle(cell).color, getComputedStyle(cell.parentElement).backgroundColor].map(light)
    .sort((p, q) => q - p);
  return (x + 0.05) / (y + 0.05); }))"""

# everything of a kind on the page, inside its components, too
_DEEP = """
var deep = (what, root = document) => [...root.querySelectorAll(what)].concat(
  ...[...root.querySelectorAll('*')].filter(one => one.shadowRoot).map(one => deep(what, one.shadowRoot)));
true
"""


def test_logarithmic_axes_have_few_ticks_with_short_numbers() -> None:
    """Bokeh's own are evenly spaced where a range is short, and crowd at its upper end."""
    plot = drawing._plot("hf", "rmse", x_axis_type="log")
    assert plot.xaxis[0].ticker.args == {"most": 5}
    assert "toPrecision" in plot.xaxis[0].formatter.code
    assert plot.yaxis[0].ticker.desired_num_ticks > 4
