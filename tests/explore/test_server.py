"""The server of a live page: who is answered, with what, and how it ends."""

from __future__ import annotations

import asyncio
import gc
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from live import OSCILLATOR
from shell import Shell

pytest.importorskip("bokeh", reason="needs hgorun[explore]")

from tornado.websocket import WebSocketClosedError, websocket_connect

from hgorun import load
from hgorun.errors import HgorunError
from hgorun.explore.keeping import Keeper
from hgorun.explore.server import HOST, Channel, LivePage
from hgorun.explore.simulated import SimulatedBench

OTHERS = (
    "/", "/favicon.ico", "/static/js/bokeh.min.js", "/ws", "/figure.png", "/autoload.js", "/metadata",
    "/{short}/", "/{wrong}/", "/{wrong}/static/js/bokeh.min.js", "/{wrong}/ws", "/{wrong}/figure.png", "//{secret}/",
    "/channel?key=x", "/{wrong}/channel?key=x", "/x/../{wrong}/", "/{secret}",
)  # fmt: skip


# Little to compile: what is simulated does not matter here.
SERVED = """\
title: <b>A & B</b>
time: {unit: min, end: 1, output_step: 0.05}
plant: {type: integrator_chain, n: 2, phi: 0, initial: {x1: 1, x2: 0}}
observers:
  F: {type: shgo, theta: 2, poles: -1}
  S: {type: shgo, theta: 3, poles: -1}
solver: {method: rk4, step: 0.05}
"""


class Served:
    """A page that is served by a thread, with an event loop of its own."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        assert self._ready.wait(60)

    def _serve(self) -> None:
        bench = SimulatedBench(self.path, load(self.path))
        self.page = LivePage(bench, Keeper(bench, self.path.parent / "results", "a.explored.yaml"))
        self.page.serve(self._ready.set)

    def stop(self) -> None:
        self.page.stop()
        self._thread.join(30)
        assert not self._thread.is_alive()

    def get(self, path: str, headers: dict[str, str] | None = None) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and body of an answer."""
        connection = HTTPConnection(HOST, self.page.port, timeout=60)
        connection.request("GET", path, headers=headers or {})
        answer = connection.getresponse()
        found = answer.status, dict(answer.getheaders()), answer.read()
        connection.close()
        return found


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    path = tmp_path_factory.mktemp("served") / "a.yaml"
    path.write_text(SERVED)
    found = Served(path)
    yield found
    found.stop()


def test_bounds_are_computed_while_the_browser_begins(tmp_path: Path) -> None:
    """They take longest at the start: nothing has asked for them."""
    (tmp_path / "a.yaml").write_text(SERVED)
    found = Served(tmp_path / "a.yaml")
    try:
        bench, base = found.page.bench, found.page._base
        end = time.monotonic() + 60
        while not all(bench.known(base, label) for label in ("F", "S")):
            assert time.monotonic() < end
            time.sleep(0.02)
    finally:
        found.stop()


def test_only_this_machine(served: Served) -> None:
    """No other address of this machine answers, and the secret is long."""
    assert urlsplit(served.page.address).hostname == "127.0.0.1"
    assert re.fullmatch(r"[\w-]{32}", served.page.secret)
    (bound,) = served.page.http._sockets.values()
    assert bound.getsockname() == ("127.0.0.1", served.page.port)


@pytest.mark.parametrize("path", OTHERS)
def test_nothing_is_served_without_the_secret(served: Served, path: str) -> None:
    secret = served.page.secret
    wrong = secret[:-1] + ("A" if secret[-1] != "A" else "B")
    asked = path.format(secret=secret, wrong=wrong, short=secret[:-1])
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
               "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": "bokeh, x"}  # fmt: skip
    for headers in ({}, upgrade):
        status, _, body = served.get(asked, headers)
        assert status == 404
        assert secret.encode() not in body
        assert b"theta" not in body


def test_a_socket_is_not_for_other_pages(served: Served) -> None:
    """A page of another site that knows the address may not speak either."""
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
               "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": "bokeh, x"}  # fmt: skip
    for origin in ("http://example.org", f"http://{HOST}:1", "null"):
        for socket_ in ("ws", "channel?key=x"):
            status, _, _ = served.get(f"/{served.page.secret}/{socket_}", upgrade | {"Origin": origin})
            assert status == 403


def test_a_page_has_one_channel(served: Served) -> None:
    """By the key that is in it, once: what is asked there is answered there, and no other key is one."""
    html = served.get(f"/{served.page.secret}/")[2].decode()
    found = re.search(r'"channel": "([\w-]+)"', html)
    assert found is not None
    address = f"ws://{HOST}:{served.page.port}/{served.page.secret}/channel?key="

    async def asked(key: str) -> list[str | bytes | None]:
        told: list[str | bytes | None] = []
        channel = await websocket_connect(address + key)
        await channel.write_message('{"do": "begin", "number": 1}')
        while not told or (isinstance(told[-1], bytes) and b'"picture"' not in told[-1]):
            told.append(await asyncio.wait_for(channel.read_message(), 60))
        if told[-1] is not None:
            second = await websocket_connect(address + key)
            assert await second.read_message() is None  # it is taken
            second.close()
        channel.close()
        while told[-1] is not None and await channel.read_message() is not None:
            pass
        return told

    last = asyncio.run(asked(found[1]))[-1]
    assert isinstance(last, bytes)
    end = 8 + int.from_bytes(last[:8], "little")
    assert json.loads(last[8:end])["values"]["observers.S.theta"] == 3
    assert np.isfinite(np.frombuffer(last[end:])).any()
    assert asyncio.run(asked("x")) == [None]


@pytest.mark.costly
def test_the_page(served: Served) -> None:
    status, headers, body = served.get(f"/{served.page.secret}/")
    html = body.decode()
    assert status == 200
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert (headers["Referrer-Policy"], headers["Cache-Control"]) == ("no-referrer", "no-store")
    assert "<h1>&lt;b&gt;A &amp; B&lt;/b&gt;</h1>" in html
    for address in re.findall(r'(?:src|href)="([^"]+)"', html):
        assert not re.match(r"(https?:)?//", address)
    assert html.count('<input type="range"') == len(served.page.bench.knobs)
    named = re.findall(r'<input[^>]+type="(?:range|text)"[^>]*>', html)
    assert all("aria-label=" in one or 'id="file"' in one for one in named)


@pytest.mark.measured
@pytest.mark.slow
def test_a_figure_is_of_what_the_address_says(served: Served) -> None:
    begin = f"/{served.page.secret}/figure"
    status, headers, png = served.get(f"{begin}.png?observers.F.theta=3")
    assert (status, headers["Content-Type"], png[:4]) == (200, "image/png", b"\x89PNG")
    assert served.get(f"{begin}.png")[2] != png
    assert served.get(f"{begin}.pdf")[2][:5] == b"%PDF-"
    status, headers, body = served.get(f"{begin}.png?observers.F.theta=-3")
    assert (status, headers["Content-Type"]) == (400, "text/plain; charset=utf-8")
    assert b"expected a number above 0" in body
    assert served.get(f"{begin}.svg")[0] == 404


def test_a_port_in_use_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(OSCILLATOR)
    bench = SimulatedBench(path, load(path))
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(HgorunError, match=f"--port: {port} is in use: choose another"):
            LivePage(bench, Keeper(bench, tmp_path, "b.yaml"), port)


RECORDED = """\
data: {file: a.csv, time: t, outputs: {a: a}}
plant: {states: [a], dynamics: {a: -a}, output: a}
observers: {F: {type: shgo, theta: 3, poles: -1}}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


def test_what_is_refused(shell: Shell) -> None:
    tmp_path = shell.folder
    (tmp_path / "a.yaml").write_text(OSCILLATOR)
    (tmp_path / "log.yaml").write_text(RECORDED)
    (tmp_path / "runs.yaml").write_text(OSCILLATOR + "runs: {one: {}, two: {}}\n")
    (tmp_path / "bad.yaml").write_text(OSCILLATOR.replace("theta: 3", "theta: -3"))
    for arguments, said in {
        ("missing.yaml",): "there is no such file",
        ("bad.yaml",): "bad.yaml:8: observers.S.theta: expected a number above 0",
        ("runs.yaml",): "name one with --run",
        ("a.yaml", "--run", "one"): "the file has no runs",
        ("a.yaml", "-o", "b.h5"): "--output: expected a file .yaml, .yml or a folder",
        ("log.yaml",): "",
    }.items():
        code, out, err = shell("explore", *arguments, "--no-browser")
        assert (code, out) == (2, "")
        assert said in err
        assert "Traceback" not in err


@pytest.mark.parametrize("opens", [True, False])
def test_the_browser_is_told_by_a_private_file(shell: Shell, monkeypatch: pytest.MonkeyPatch, opens: bool) -> None:
    """The command line of a browser is seen by all users of a machine: the address is not in it."""
    made: list[SimulatedBench | Keeper | int] = []
    opened: list[str] = []

    class Page:
        address = "http://127.0.0.1:1/secret/"

        def __init__(self, bench: SimulatedBench, keeper: Keeper, port: int, **_: object) -> None:
            made.extend((bench, keeper, port))

        def serve(self, ready: Callable[[], None]) -> None:
            ready()

        def stop(self) -> None: ...

    def open_it(address: str) -> bool:
        file = Path(urlsplit(address).path)
        assert file.stat().st_mode & 0o077 == 0
        assert "secret" not in address
        assert f"url={Page.address}" in file.read_text()
        opened.append(address)
        return opens

    monkeypatch.setattr("hgorun.explore.server.LivePage", Page)
    monkeypatch.setattr("webbrowser.open", open_it)
    (shell.folder / "a.yaml").write_text(OSCILLATOR)
    code, out, err = shell("explore", "a.yaml", "-o", "out/b.yaml", "--port", "7")
    assert (code, out) == (0, f"{Page.address}\n")
    assert ("no browser could be opened" in err) is not opens
    assert err.endswith("hgorun: the page is closed\n")
    assert not Path(urlsplit(opened[0]).path).exists()
    _, keeper, port = made
    assert isinstance(keeper, Keeper)
    assert (str(keeper.folder), keeper.first, port) == ("out", "b.yaml", 7)
    code, out, err = shell("explore", "a.yaml", "--no-browser", "-q")
    assert (code, out, err, len(opened)) == (0, f"{Page.address}\n", "", 1)


def started(path: Path, *more: str) -> tuple[subprocess.Popen[str], str]:
    """The command in a process of its own, and the address that it has printed."""
    command = [sys.executable, "-m", "hgorun", "explore", path.name, "--no-browser", *more]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen(
        command, cwd=path.parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_ctrl_c_ends_it(tmp_path: Path, number: signal.Signals, code: int) -> None:
    (tmp_path / "a.yaml").write_text(OSCILLATOR)
    process, address = started(tmp_path / "a.yaml")
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", address)
    process.send_signal(number)
    out, err = process.communicate(timeout=8)  # without a page that is open, nothing else would wake it for a while
    assert (process.returncode, out) == (code, "")
    assert "Traceback" not in err
    assert err.endswith("hgorun: the page is closed\n" if code == 0 else "no file is left half-written\n")


class _Leaving:
    """A connection that breaks while a message is sent."""

    def is_closing(self) -> bool:
        return False

    def write_message(self, message: bytes, *, binary: bool) -> asyncio.Task[None]:
        async def sent() -> None:
            await asyncio.sleep(0)
            raise WebSocketClosedError

        return asyncio.ensure_future(sent())


def test_a_page_may_go_while_it_is_told() -> None:
    """Nothing is written to the terminal then, neither at once nor when Python tidies up."""
    heard: list[dict[str, object]] = []

    async def told() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: heard.append(context))
        channel = Channel.__new__(Channel)
        channel.ws_connection = _Leaving()  # type: ignore[assignment]
        channel.give(b"numbers")
        await asyncio.sleep(0.01)
        gc.collect()

    asyncio.run(told())
    assert heard == []
