"""A real browser without a window: Chromium, spoken to in its own protocol."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import tempfile
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
_SECONDS = 90.0


@dataclass
class Page:
    """A page that is open.

    Attributes
    ----------
    requests : list of str
        The addresses that it has asked for.
    complaints : list of str
        Errors and warnings of its console, and exceptions.
    """

    socket: WebSocketClientConnection
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    _numbers: count[int] = field(default_factory=lambda: count(1))

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What the browser answers; what it tells meanwhile is written down."""
        number = next(self._numbers)
        await self.socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            text = await asyncio.wait_for(self.socket.read_message(), _SECONDS)
            message = json.loads(text or "{}")
            if message.get("id") == number:
                return dict(message.get("result", {}))
            self._heard(message.get("method", ""), message.get("params", {}))

    def _heard(self, method: str, told: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            if not told["request"]["url"].startswith(("data:", "blob:")):  # those ask nobody
                self.requests.append(told["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(told["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(json.dumps(told["args"]))
        elif method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(told["entry"]["text"])

    async def value(self, expression: str) -> Any:
        """The value of JavaScript on the page."""
        found = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    async def until(self, expression: str) -> None:
        """Wait until JavaScript on the page is true."""
        for _ in range(int(_SECONDS * 5)):
            if await self.value(expression):
                return
            await asyncio.sleep(0.2)
        raise AssertionError(f"never true: {expression}")

    async def middle(self, selector: str) -> tuple[float, float]:
        """Where the middle of an element is, once it is in view."""
        script = f"""(() => {{ const one = document.querySelector({json.dumps(selector)});
          one.scrollIntoView({{block: 'center'}});
          const box = one.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; }})()"""
        x, y = await self.value(script)
        return float(x), float(y)

    async def drag(self, start: tuple[float, float], *way: tuple[float, float]) -> None:
        """Press the mouse at a point, move it along a way, and let go."""
        await self._mouse("mousePressed", start)
        for point in way:
            await self._mouse("mouseMoved", point)
        await self._mouse("mouseReleased", way[-1] if way else start)

    async def click(self, selector: str) -> None:
        """Click the middle of an element."""
        await self.drag(await self.middle(selector))

    async def _mouse(self, kind: str, at: tuple[float, float]) -> None:
        held = 0 if kind == "mouseReleased" else 1
        where = {"x": at[0], "y": at[1], "button": "left", "buttons": held, "clickCount": 1}
        await self.call("Input.dispatchMouseEvent", type=kind, **where)

    async def press(self, key: str, *, control: bool = False) -> None:
        """Press a key: ``ArrowRight``, ``Tab``, ``z``."""
        code, text = _KEYS.get(key, (ord(key[0].upper()), "" if control else key))
        named = {"key": key, "windowsVirtualKeyCode": code, "modifiers": 2 if control else 0}
        named |= {"text": text} if text else {}
        await self.call("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", **named)
        await self.call("Input.dispatchKeyEvent", type="keyUp", **named)

    async def resize(self, width: int, height: int) -> None:
        """Give the page a size; at 400 % zoom a window of 1280 is 320 wide."""
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )

    async def picture(self, path: Path, *, whole: bool = False) -> None:
        """What is seen of the page, or all of it, as a PNG."""
        found = await self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(found["data"]))


# keys without a character of their own: their codes, and what they type
_KEYS = {
    "ArrowLeft": (37, ""), "ArrowUp": (38, ""), "ArrowRight": (39, ""), "ArrowDown": (40, ""), "Home": (36, ""),
    "End": (35, ""), "PageUp": (33, ""), "PageDown": (34, ""), "Tab": (9, ""), "Enter": (13, "\r"), " ": (32, " "),
}  # fmt: skip


def opened(address: Path | str, look: Callable[[Page], Awaitable[None]]) -> Page:
    """Open a file or an address in Chromium, look at it, and close it."""
    assert CHROMIUM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--window-size=1300,1000",
            "--remote-debugging-port=0", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            return asyncio.run(_look(Path(profile), address, look))
        finally:
            process.terminate()
            process.wait(30)


async def _look(profile: Path, address: Path | str, look: Callable[[Page], Awaitable[None]]) -> Page:
    from tornado.httpclient import AsyncHTTPClient

    ready = profile / "DevToolsActivePort"
    for _ in range(int(_SECONDS * 5)):
        if ready.is_file() and ready.read_text().strip():
            break
        await asyncio.sleep(0.2)
    port = ready.read_text().split()[0]
    answer = await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/json/list")
    target = next(one for one in json.loads(answer.body) if one["type"] == "page")
    page = Page(await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=2**26))
    for domain in ("Network", "Runtime", "Log", "Page"):
        await page.call(f"{domain}.enable")
    await page.call("Page.navigate", url=address if isinstance(address, str) else address.resolve().as_uri())
    try:
        await look(page)
    finally:
        page.socket.close()
        await page.socket.read_message()  # the end of it
    return page
