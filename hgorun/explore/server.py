"""The server of a live page: on this machine alone, behind a secret in its address. This module imports bokeh."""

from __future__ import annotations

import asyncio
import hmac
import logging
import os
import secrets
import socket
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from errno import EACCES, EADDRINUSE
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urlsplit

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop, PeriodicCallback
from tornado.web import ErrorHandler, OutputTransform, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from hgorun.errors import HgorunError
from hgorun.explore.bench import Bench, Shown
from hgorun.explore.keeping import Keeper
from hgorun.explore.session import Session
from hgorun.explore.view import View
from hgorun.explore.worker import SOON, Worker

HOST = "127.0.0.1"
_SECRET_BYTES = 24
_TURN = 1e-3  # seconds that the thread that computes keeps Python to itself while the server has something to send
_BEAT = 250  # milliseconds after which the loop wakes where nothing happens
_NOT_FOUND, _BAD_REQUEST = 404, 400
_TYPES = {"png": "image/png", "pdf": "application/pdf"}
# Nothing is loaded from elsewhere, and nobody is told the address. Bokeh makes functions and styles of text.
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class _Headers(OutputTransform):
    """What every answer says of itself."""

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        for name, value in _HEADERS.items():
            headers[name] = value
        return status_code, headers, chunk


class _Guarded(BokehTornado):  # type: ignore[misc]  # bokeh's types are not read
    """Answers to addresses that begin with the secret, and to no others: pages, sockets, scripts alike."""

    def __init__(self, secret: str, application: Application, **options: Any) -> None:
        self._beginning = f"/{secret}/".encode()
        super().__init__({"/": application}, prefix=secret, **options)
        self.add_transform(_Headers)

    def find_handler(self, request: HTTPServerRequest, **more: Any) -> Any:
        beginning = request.path.encode()[: len(self._beginning)]
        if not hmac.compare_digest(beginning, self._beginning):
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": _NOT_FOUND})
        return super().find_handler(request, **more)


class LivePage:
    """A bench on a server.

    Parameters
    ----------
    bench : Bench
    keeper : Keeper
    port : int
        0: any that is free.
    failed : callable
        Is given what went wrong inside, which is a fault of ours.

    Raises
    ------
    HgorunError
        When the port cannot be had, or the configuration cannot be simulated.
    """

    def __init__(
        self, bench: Bench, keeper: Keeper, port: int = 0, *, failed: Callable[[Exception], None] = lambda _: None
    ) -> None:
        self.bench, self.keeper, self.secret = bench, keeper, secrets.token_urlsafe(_SECRET_BYTES)
        logging.getLogger("bokeh").setLevel(logging.CRITICAL)  # what matters is told on the page
        logging.getLogger("tornado").setLevel(logging.CRITICAL)
        listening = _listening(port)
        self.port = int(listening.getsockname()[1])
        try:
            self._base: Shown = bench.shown(bench.state_of(""))
        except BaseException:
            listening.close()
            raise
        self.worker = Worker(failed)
        origins = [f"{HOST}:{self.port}", f"localhost:{self.port}"]
        self.server = _Guarded(
            self.secret,
            Application(FunctionHandler(self._open)),
            extra_websocket_origins=origins,
            extra_patterns=[
                (r"/figure\.(png|pdf)", _Figure, {"page": self}),
                (r"/channel", Channel, {"page": self, "origins": origins}),
            ],
        )
        self.http = HTTPServer(self.server)
        self.http.add_sockets([listening])
        self._opened: dict[str, tuple[View, str]] = {}  # pages without a channel: what is drawn on, and the query
        self._loop = IOLoop.current()
        self._running: asyncio.AbstractEventLoop | None = None
        self._server = BaseServer(self._loop, self.server, self.http)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.port}/{self.secret}/"

    def serve(self, ready: Callable[[], None]) -> None:
        """Serve until it is stopped; ``ready`` is called once pages can be opened."""

        def begun() -> None:
            self._running = asyncio.get_running_loop()
            ready()
            self.worker.submit(self._begin_theory, SOON)

        interval = sys.getswitchinterval()
        sys.setswitchinterval(_TURN)
        self._server.start()
        beat = PeriodicCallback(lambda: None, _BEAT)  # a signal just before the loop waits is answered when it wakes
        beat.start()
        self._loop.add_callback(begun)
        try:
            self._loop.start()
        finally:
            beat.stop()
            sys.setswitchinterval(interval)
            self._server.stop(wait=False)

    def _begin_theory(self) -> None:
        """Compile and compute what takes longest at the start, while the browser reads its scripts."""
        for label in self._base.result.observers if self.bench.theory else ():
            self.bench.promise(self._base, label)

    def stop(self) -> None:
        """End :meth:`serve`; a signal or any thread may ask for it."""
        if self._running is not None:
            self._running.call_soon_threadsafe(self._loop.stop)  # which wakes it, also from its own thread

    def _open(self, document: Document) -> None:
        """A page has been opened: it asks for what it shows, on a channel, once it is there."""
        view = View(document, self.bench, self.keeper, self._base)
        arguments = document.session_context.request.arguments.items()
        pairs = [(name, value.decode("utf-8", "replace")) for name, values in arguments for value in values]
        self._opened[view.key] = view, urlencode(pairs)

        def gone(_: object) -> None:
            self._opened.pop(view.key, None)

        document.on_session_destroyed(gone)

    def begun(self, key: str, channel: Channel) -> Session | None:
        """What answers on a channel; None where no page that was opened has this key, or it has one already."""
        opened = self._opened.pop(key, None)
        if opened is None:
            return None
        view, query = opened
        loop = asyncio.get_running_loop()

        def post(job: Callable[[], None]) -> None:
            if not session.closed:
                loop.call_soon_threadsafe(job)

        view.send = channel.give
        session = Session(self.bench, self.keeper, self.worker, post, view, query)
        return session

    def figure(self, query: str, kind: str) -> bytes:
        """The file of a figure of what an address stands for; by the worker's thread only.

        Raises
        ------
        HgorunError
        """
        from hgorun.figures.drawing import comparison
        from hgorun.figures.files import save

        shown = self.bench.shown(self.bench.state_of(query))
        with tempfile.TemporaryDirectory() as folder:
            (file,) = save(comparison(shown.result), Path(folder) / "figure", (kind,))
            return file.read_bytes()


class Channel(WebSocketHandler):
    """What a page asks, as JSON, and what it is told. Bokeh's own messages take ten times as long as these."""

    def initialize(self, page: LivePage, origins: list[str]) -> None:
        self._page, self._origins = page, origins
        self._session: Session | None = None

    def check_origin(self, origin: str) -> bool:
        return urlsplit(origin).netloc in self._origins

    def open(self, *_arguments: str, **_named: str) -> None:
        self._session = self._page.begun(self.get_query_argument("key", ""), self)
        if self._session is None:
            self.close(reason="no page is open here")

    def on_message(self, message: str | bytes) -> None:
        if self._session is not None and isinstance(message, str):
            self._session.ask(message)

    def on_close(self) -> None:
        if self._session is not None:
            self._session.close()

    def give(self, message: bytes) -> None:
        """Send a message, unless the page is gone."""
        with suppress(WebSocketClosedError):
            sent = self.write_message(message, binary=True)
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())  # it may go while it is told


class _Figure(RequestHandler):
    """A figure as a file."""

    def initialize(self, page: LivePage) -> None:
        self.page = page

    async def get(self, kind: str) -> None:
        loop = asyncio.get_running_loop()
        done: asyncio.Future[bytes | HgorunError] = loop.create_future()

        def job() -> None:
            found: bytes | HgorunError = HgorunError("the figure cannot be drawn")
            try:
                found = self.page.figure(self.request.query, kind)
            except HgorunError as error:
                found = error
            finally:
                loop.call_soon_threadsafe(done.set_result, found)

        self.page.worker.submit(job)
        found = await done
        if isinstance(found, HgorunError):
            self.set_status(_BAD_REQUEST)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(str(found))
        else:
            self.set_header("Content-Type", _TYPES[kind])
            self.finish(found)


def _listening(port: int) -> socket.socket:
    """A socket of this machine alone.

    Raises
    ------
    HgorunError
        When the port cannot be had.
    """
    listening = socket.socket()
    try:
        if os.name == "posix":  # a port that has just been left is free; elsewhere this would share one in use
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((HOST, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise HgorunError(_why(error, port)) from error
    listening.setblocking(False)
    return listening


def _why(error: OSError, port: int) -> str:
    """Why a port cannot be had."""
    if error.errno == EADDRINUSE:
        return f"--port: {port} is in use: choose another, or leave it out, and a free one is taken"
    if error.errno == EACCES:
        return f"--port: {port} needs the rights of an administrator: choose one above 1023, or leave it out"
    return f"--port: {port} cannot be used: {error.strerror}"
