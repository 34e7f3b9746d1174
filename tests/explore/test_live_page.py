"""A live page in a real browser: sliders by mouse and by keyboard, numbers, requests, labels, contrast, zoom."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from live import OSCILLATOR, recorded
from test_server import started

pytest.importorskip("bokeh", reason="needs hgorun[explore]")

import signal

import browser
from matplotlib.colors import to_hex

from hgorun import load, simulate
from hgorun.config.reading import read_source
from hgorun.estimate.estimate import estimate
from hgorun.estimate.holdout import thinned
from hgorun.estimate.log import log_of
from hgorun.figures.page import dark

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium"),
]

IDLE = "window.hgorun && hgorun.idle"
SEEN = """(() => {
  const found = {};  // a table that has no room has several blocks
  for (const row of document.querySelectorAll('#metrics tr[data-label]'))
    for (const cell of row.querySelectorAll('td[data-value]'))
      (found[row.dataset.label] ??= []).push(cell.dataset.value);
  return JSON.stringify(found);
})()"""
BEYOND = "(table => table.scrollWidth - table.parentElement.clientWidth)(document.querySelector('#metrics'))"
CURVE = """JSON.stringify(Bokeh.documents[0].get_model_by_name('estimate1').renderers.map(
  one => Array.from(one.data_source.data.v)))"""
SAID = "document.getElementById('said').textContent"


def shown(tmp_path: Path, look: Callable[[browser.Page], Awaitable[None]], text: str = OSCILLATOR) -> browser.Page:
    """Serve a configuration, and look at it."""
    path = tmp_path / "a.yaml"
    path.write_text(text)
    process, address = started(path, "-o", "out")

    async def begun(page: browser.Page) -> None:
        await page.resize(1300, 1000)
        await page.until(f"{IDLE} && document.querySelectorAll('#theory tbody:first-child tr[data-label]').length == 2")
        await look(page)

    try:
        page = browser.opened(address, begun)
    finally:
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert "Traceback" not in err
    assert page.complaints == []
    hosts = {urlsplit(one).netloc for one in page.requests}
    assert hosts == {urlsplit(address).netloc}  # nobody else is asked for anything
    return page


async def numbers(page: browser.Page) -> dict[str, list[str]]:
    await page.until(IDLE)
    await asyncio.sleep(0.3)
    return dict(json.loads(await page.value(SEEN)))


def simulated(path: Path) -> dict[str, list[str]]:
    """All digits of the metrics that ``hgorun simulate`` has."""
    result = simulate(load(path))
    return {
        label: sorted(repr(float(v)) for values in o.metrics.values() for v in values)
        for label, o in result.observers.items()
    }


def test_sliders_by_mouse_and_by_keyboard(tmp_path: Path) -> None:
    """They move the curve and the numbers, which are those of the file that is written."""
    found: list[dict[str, list[str]]] = []

    async def look(page: browser.Page) -> None:
        found.append(await numbers(page))
        await bounds_of_all(page)
        before = await page.value(CURVE)
        x, y = await page.middle('[data-knob="0"]')
        await page.drag((x, y), (x + 10, y), (x + 25, y))
        found.append(await numbers(page))
        moved = await page.value(CURVE)
        assert moved != before
        theta = float(await page.value("document.querySelector('[data-number=\"0\"]').value"))
        assert theta > 2
        for _ in range(3):
            await page.press("ArrowRight")
        found.append(await numbers(page))
        assert await page.value(CURVE) != moved
        assert float(await page.value("document.querySelector('[data-number=\"0\"]').value")) > theta
        await page.press("z", control=True)
        await page.press("z", control=True)
        await page.press("z", control=True)
        assert await numbers(page) == found[1]
        await page.press("y", control=True)
        await page.press("y", control=True)
        await page.press("y", control=True)
        assert await numbers(page) == found[2]
        address = await page.value("location.href")
        assert "observers.F.theta=" in address
        await page.click("#write button")
        await page.until(f"{SAID}.startsWith('written')")
        await page.call("Page.navigate", url=address)
        await page.until(f"{IDLE} && {SAID} == 'ok'")
        assert await numbers(page) == found[2]
        await page.click('[data-observer="S"]')
        assert list(await numbers(page)) == ["F"]
        await page.click("#reset")
        assert await numbers(page) == found[0]

    shown(tmp_path, look)
    written = tmp_path / "out" / "a.explored.yaml"
    assert {label: sorted(digits) for label, digits in found[2].items()} == simulated(written)
    assert {label: sorted(digits) for label, digits in found[0].items()} == simulated(tmp_path / "a.yaml")


def test_the_plant_is_folded_and_can_be_varied(tmp_path: Path) -> None:
    """By the keyboard alone; an address opens what it changes."""
    found: list[dict[str, list[str]]] = []
    inside = "document.getElementById('Plant-values').hidden"

    async def look(page: browser.Page) -> None:
        assert await page.value(inside)
        await page.value("document.querySelector('.fold').focus()")
        await page.press(" ")
        assert not await page.value(inside)
        before = await numbers(page)
        labels = "[...document.querySelectorAll('#Plant-values input[type=range]')].map(one => one.ariaLabel)"
        assert "initial x1 of the plant" in await page.value(labels)
        await page.value("document.querySelector('#Plant-values [aria-label=\"initial x1 of the plant\"]').focus()")
        for _ in range(3):
            await page.press("ArrowRight")
        found.append(await numbers(page))
        assert found[0] != before
        assert await page.value("document.querySelector('.moved').textContent") == "1 changed"
        await page.click("#write button")
        await page.until(f"{SAID}.startsWith('written')")
        await page.call("Page.navigate", url=await page.value("location.href"))
        await page.until(f"{IDLE} && {SAID} == 'ok'")
        assert not await page.value(inside)
        assert await numbers(page) == found[0]

    shown(tmp_path, look)
    written = simulated(tmp_path / "out" / "a.explored.yaml")
    assert {label: sorted(digits) for label, digits in found[0].items()} == written


def test_recorded_data(tmp_path: Path) -> None:
    """A slider changes innovations and scores, which are those of the command for the file that is written."""
    path = recorded(tmp_path / "demo")
    process, address = started(path, "-o", "out")
    curve = CURVE.replace("estimate1", "innovation0")
    ready = f"{IDLE} && document.getElementById('metrics').dataset.columns.includes('sensitivity')"
    found: list[dict[str, list[str]]] = []

    async def look(page: browser.Page) -> None:
        await page.resize(1300, 1000)
        await page.until(ready)
        before, first = await page.value(curve), await numbers(page)
        await page.value("document.querySelector('[data-knob=\"0\"]').focus()")
        for _ in range(3):
            await page.press("ArrowRight")
        await page.until(f"{ready} && {SEEN} != {json.dumps(json.dumps(first, separators=(',', ':')))}")
        await asyncio.sleep(2)  # how the scores depend on gains comes last
        found.append(await numbers(page))
        assert found[0] != first
        assert await page.value(curve) != before
        await page.click("#write button")
        await page.until(f"{SAID}.startsWith('written')")
        assert await page.value("document.getElementById('theory')") is None

    try:
        page = browser.opened(address, look)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert page.complaints == []
    written = path.parent / "out" / "a.explored.yaml"
    source = read_source(written)[1]
    samples = thinned(log_of(source, written).read(), 0.3)
    result = estimate(source, samples[0], held_out=samples[1])
    for label, observer in result.observers.items():
        assert observer.assessed is not None
        scores = [repr(value) for of in observer.assessed.scores.values() for value in of.values()]
        assert sorted(digits for digits in found[0][label] if digits) == sorted(scores)


async def bounds_of_all(page: browser.Page) -> None:
    """Where those of more than one observer change, it is said as long as the ones before are in sight."""
    await page.value("""hgorun.busy = []; new MutationObserver(
      (records) => hgorun.busy.push(...records.map((one) => one.target.hasAttribute('aria-busy'))),
    ).observe(document.getElementById('error0'), {attributes: true, attributeFilter: ['aria-busy']})""")
    noise = "JSON.parse(document.getElementById('known').textContent).knobs.findIndex(k => k.name.includes('noise'))"
    await page.value(f'document.querySelector(`[data-knob="${{{noise}}}"]`).focus()')
    await page.press("ArrowRight")
    await page.until(f"{IDLE} && hgorun.busy.length >= 2 && !document.querySelector('[aria-busy]')")
    assert await page.value("hgorun.busy[0]")
    await page.press("z", control=True)
    await page.until(f"{IDLE} && document.getElementById('undo').disabled")


def test_what_is_typed(tmp_path: Path) -> None:
    """A number that does not fit is a message; what was there stays."""

    async def look(page: browser.Page) -> None:
        before = await numbers(page)
        await page.click('[data-number="0"]')
        await page.value("document.querySelector('[data-number=\"0\"]').select()")
        for key in "-3":
            await page.press(key)
        await page.press("Enter")
        await page.until(f"{SAID}.includes('expected a number above 0')")
        assert await numbers(page) == before
        assert await page.value("document.querySelector('[data-number=\"0\"]').getAttribute('aria-invalid')") == "true"
        assert await page.value("document.querySelector('[data-number=\"0\"]').value") == "2"
        await page.value("document.querySelector('[data-number=\"0\"]').select()")
        for key in "1+2":
            await page.press(key)
        await page.press("Enter")
        await page.until(f"{IDLE} && {SAID} == 'ok' && document.querySelector('[data-number=\"0\"]').value == '3'")
        await page.value("document.getElementById('file').value = '../b.yaml'")
        await page.click("#write button")
        await page.until(f"{SAID}.includes('without a folder')")
        image = "fetch(document.getElementById('png').href).then(one => one.headers.get('content-type'))"
        assert await page.value(image) == "image/png"

    shown(tmp_path, look)


DARK = {"name": "prefers-color-scheme", "value": "dark"}
# of the lines of a figure, and of the words at its axes
COLOURS = """(() => { const plot = Bokeh.documents[0].get_model_by_name('estimate1');
  return JSON.stringify([...plot.renderers.map(one => one.glyph.line_color.value ?? one.glyph.line_color),
    plot.left[0].axis_label_text_color, plot.below[0].major_label_text_color]); })()"""
# names that a screen reader says, and contrast of what is written, against (4.5 for text, 3 for what can be used)
LOOKED_AT = """(() => {
  const light = (text) => { const [r, g, b] = text.match(/[\\d.]+/g).slice(0, 3).map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = (one) => { for (; one; one = one.parentElement) { const c = getComputedStyle(one).backgroundColor;
    if (!/, 0\\)$/.test(c) && c != 'transparent') return c; } return 'rgb(255, 255, 255)'; };
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p);
    return (x + 0.05) / (y + 0.05); };
  const texts = [...document.querySelectorAll(
    'h1, h2, p, label, legend, button:enabled, a, th, td, li, figcaption, input[type=text]')];
  const inside = (root) => [...root.querySelectorAll('*')].flatMap(
    one => one.shadowRoot ? [one, ...inside(one.shadowRoot)] : [one]);  // a figure's parts stand in roots of their own
  const used = inside(document).filter(one => one.matches('input, button, a[href], select, [tabindex="0"]'));
  const named = (one) => one.getAttribute('aria-label') || one.labels?.[0]?.textContent.trim()
    || one.textContent.trim() || one.title;
  return JSON.stringify({
    faint: texts.filter(one => one.textContent.trim() || one.value)
      .filter(one => ratio(getComputedStyle(one).color, behind(one)) < 4.5).map(one => one.outerHTML.slice(0, 100)),
    nameless: used.filter(one => !named(one)).map(one => one.outerHTML.slice(0, 100)),
    tools: inside(document).filter(one => one.matches('[class*=Button][tabindex]'))
      .map(one => [one.getAttribute('role'), one.getAttribute('aria-label'), one.getAttribute('aria-pressed')]),
    figures: [...document.querySelectorAll('figure')].filter(one => !one.getAttribute('aria-label')).length,
    status: document.getElementById('said').getAttribute('role'),
    language: document.documentElement.lang,
  });
})()"""


# the tools of figures, which Bokeh builds after the page, and the second of the first figure used by the space bar
TOOLS = """(() => {
  const inside = (root) => [...root.querySelectorAll('*')].flatMap(
    one => one.shadowRoot ? [one, ...inside(one.shadowRoot)] : [one]);
  return inside(document.querySelector('figure')).filter(one => one.matches('[class*=Button][tabindex]'));
})()"""
NAMED = f"{TOOLS}.length > 1 && {TOOLS}.every(one => one.getAttribute('role'))"


def test_labels_contrast_and_zoom(tmp_path: Path) -> None:
    seen: dict[str, Any] = {}

    async def look(page: browser.Page) -> None:
        await page.until(NAMED)
        seen.update(json.loads(await page.value(LOOKED_AT)))
        light = json.loads(await page.value(COLOURS))
        await page.call("Emulation.setEmulatedMedia", features=[DARK])
        await page.until(f"({COLOURS}) != {json.dumps(json.dumps(light, separators=(',', ':')))}")
        seen["colours"] = [*zip(light, json.loads(await page.value(COLOURS)), strict=True)]
        seen["faint when dark"] = json.loads(await page.value(LOOKED_AT))["faint"]
        await page.call("Emulation.setEmulatedMedia", features=[])
        await page.value(f"{TOOLS}[1].focus()")
        await page.press(" ")
        seen["pressed"] = await page.value(f"{TOOLS}.map(one => one.getAttribute('aria-pressed'))")
        await page.value("document.querySelector('#reset').focus()")
        reached = []
        for _ in range(12):
            await page.press("Tab")
            reached.append(await page.value("document.activeElement.getAttribute('data-knob')"))
        seen["reached"] = [one for one in reached if one is not None]
        await page.resize(1500, 1000)
        seen["beyond"] = await page.value(BEYOND)
        seen["head"] = await page.value("document.querySelectorAll('#metrics th')[1].textContent")
        await page.resize(320, 800)  # a small telephone: curves stay in sight above the slider
        await page.middle('[data-knob="5"]')
        await asyncio.sleep(1)
        seen["strip"] = await page.value(
            "['#estimate0', '[data-knob=\"5\"]'].map(one => document.querySelector(one).getBoundingClientRect().bottom)"
        )
        seen["telephone"] = await page.value("document.documentElement.scrollWidth")
        seen["heads"] = await page.value(
            """['metrics-head', 'theory-head'].map(id => { document.getElementById(id).scrollIntoView();
            return document.getElementById(id).getBoundingClientRect().top
              - document.querySelector('.plots').getBoundingClientRect().bottom; })"""
        )
        await page.resize(320, 500)  # 1280 at 400 %
        await asyncio.sleep(1)
        seen["width"] = await page.value("document.documentElement.scrollWidth")
        seen["narrow"] = await page.value(f"{BEYOND} + ' ' + document.querySelectorAll('#metrics tbody').length")
        lefts = (
            "[...document.querySelectorAll('figure:not([hidden])')].map(f => Math.round(f.getBoundingClientRect().x))"
        )
        seen["columns"] = len(set(await page.value(lefts)))

    shown(tmp_path, look)
    assert seen["faint"] == []
    assert seen["faint when dark"] == []
    assert len(seen["colours"]) > 4
    assert all(to_hex(dark(light)) == own for light, own in seen["colours"])
    assert seen["nameless"] == []
    assert len(seen["tools"]) >= 16
    assert all(role == "button" and ": " in label for role, label, _ in seen["tools"])
    assert seen["tools"][0] == ["button", "Pan: x1 and its estimates over time", "true"]
    assert seen["pressed"][:2] == ["false", "true"]
    assert (seen["figures"], seen["status"], seen["language"]) == (0, "status", "en")
    assert seen["reached"][:3] == ["0", "1", "2"]
    assert seen["beyond"] <= 0  # the table of metrics fits into its box
    assert seen["head"] == "status"  # in sight also where it is wider
    assert 200 < seen["strip"][0] < seen["strip"][1] < 800
    assert seen["telephone"] <= 320
    assert all(0 <= below < 40 for below in seen["heads"]), seen["heads"]  # what is scrolled to is not hidden by them
    assert seen["width"] <= 320
    assert seen["columns"] == 1
    beyond, blocks = map(int, seen["narrow"].split())
    assert beyond <= 0
    assert blocks > 1
