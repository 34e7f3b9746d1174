"""A real browser without a window: Chromium, spoken to in its own protocol."""

from __future__ import annotations

import asyncio
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


def opened(path: Path, look: Callable[[Page], Awaitable[None]]) -> Page:
    """Open a file in Chromium, look at it, and close it."""
    assert CHROMIUM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--window-size=1300,1000",
            "--remote-debugging-port=0", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            return asyncio.run(_look(Path(profile), path, look))
        finally:
            process.terminate()
            process.wait(30)


async def _look(profile: Path, path: Path, look: Callable[[Page], Awaitable[None]]) -> Page:
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
    await page.call("Page.navigate", url=path.resolve().as_uri())
    try:
        await look(page)
    finally:
        page.socket.close()
        await page.socket.read_message()  # the end of it
    return page
