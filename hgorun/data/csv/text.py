"""Text files of any encoding as blocks of lines."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hgorun.errors import ConfigError
from hgorun.native.line_ends import newlines_of

BLOCK = 2**20  # bytes read at once: as many as a cache of the processor holds
LONGEST = 2**20  # bytes of a line
_END = b"\x1a"  # of a text, to programs of DOS
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # which begins as the next one
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
)


class _NotText(Exception):
    """Bytes behind what has been decoded are no text: the encoding, and these."""


@dataclass(frozen=True)
class Block:
    """Whole lines of a file.

    Attributes
    ----------
    text : bytes
        In UTF-8; every line ends in one newline.
    line : int
        Number of the first line, from 1 on.
    """

    text: bytes
    line: int

    @cached_property
    def lines(self) -> int:
        """How many."""
        return newlines_of(self.text)[0]


def blocks(path: Path, encoding: str | None = None, size: int = BLOCK) -> Iterator[Block]:
    """The lines of a text file, a megabyte at a time.

    Parameters
    ----------
    path : Path
    encoding : str, optional
        By default what the mark at the beginning says, else UTF-8.
    size : int
        Bytes read at once.

    Raises
    ------
    ConfigError
        When it cannot be read, is empty or binary, has another encoding, or a line of more than 1 MiB.
    """
    line, rest = 1, b""
    try:
        for piece in _decoded(path, encoding, size):
            whole, rest = _cut(rest, piece)
            if whole.find(b"\n") > LONGEST:
                raise _too_long(path, line)
            if whole:
                block = _block(whole, line, path)  # counted here: who reads ahead does so meanwhile
                line += block.lines
                yield block
            if len(rest) > LONGEST:
                raise _too_long(path, line)
    except _NotText as error:
        coded, wrong = error.args
        message = f"not text in {coded}: {wrong} is no character of it"
        raise ConfigError(message, file=str(path), line=line + _unix(rest).count(b"\n")) from None
    rest = rest.rstrip(_END)
    if rest:
        yield _checked(Block(_unix(rest) if rest.endswith((b"\n", b"\r")) else _unix(rest) + b"\n", line), path)
    elif line == 1:
        raise ConfigError("this file is empty", file=str(path), line=1)


def _too_long(path: Path, line: int) -> ConfigError:
    return ConfigError("a line of more than 1 MiB: this is not a table of numbers", file=str(path), line=line)


def _cut(before: bytes, piece: bytes) -> tuple[bytes, bytes]:
    """What ends with a line, and the rest; a carriage return at the very end may be half of a line end."""
    if end := piece.rfind(b"\n") + 1:
        return b"".join((before, memoryview(piece)[:end])), piece[end:]  # copied once
    text = before + piece
    end = text.rfind(b"\r", 0, -1) + 1
    return text[:end], text[end:]


def _unix(text: bytes) -> bytes:
    """Line ends of any kind as newlines."""
    return text.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in text else text


def _block(whole: bytes, line: int, path: Path) -> Block:
    """Whole lines, from a line on, with newlines at their ends; checked as by :func:`_checked`."""
    count, plain = newlines_of(whole)
    if not plain:
        return _checked(Block(_unix(whole), line), path)
    block = Block(whole, line)
    vars(block)["lines"] = count  # which is known already
    return block


def _checked(block: Block, path: Path) -> Block:
    """UTF-8, without zero bytes.

    Raises
    ------
    ConfigError
    """
    if (place := block.text.find(b"\0")) >= 0:
        raise ConfigError(_of_zeros(block.text, place), file=str(path), line=_line(block, place))
    if not block.text.isascii():
        try:
            block.text.decode("utf-8")
        except UnicodeDecodeError as error:
            found = block.text[error.start]
            other = "csv: {encoding: cp1252}, or latin-1"
            message = f"byte 0x{found:02x} is not UTF-8; text of older programs is read with {other}"
            raise ConfigError(message, file=str(path), line=_line(block, error.start)) from None
    return block


def _of_zeros(text: bytes, place: int) -> str:
    """What is told of the first zero byte: in UTF-16 every second one of a table is zero."""
    count = len(text[place:]) - len(text[place:].lstrip(b"\0"))
    if count > 1 or b"\0" not in text[place + 2 : place + 3]:
        bytes_ = "a zero byte" if count == 1 else f"{count:,} zero bytes"
        return f"{bytes_} in a text: nothing was written there, as where power fails; cut them out, with their line"
    return "a zero byte: this is binary data, or text in UTF-16 without its mark (csv: {encoding: utf-16})"


def _line(block: Block, place: int) -> int:
    return block.line + block.text.count(b"\n", 0, place)


def _decoded(path: Path, encoding: str | None, size: int) -> Iterator[bytes]:
    """The bytes of a file in UTF-8, without a mark."""
    try:
        with path.open("rb") as stream:
            first = stream.read(size)
            mark, found = next(((m, name) for m, name in _MARKS if first.startswith(m)), (b"", None))
            coded = found or (_utf_16(first) if encoding == "utf-16" else encoding) or "utf-8"
            while mark and first.startswith(mark):  # more than one where programs have added theirs
                first = first[len(mark) :]
            if coded == "utf-8":
                yield first
                while piece := stream.read(size):
                    yield piece
                return
            decoder = codecs.getincrementaldecoder(coded)()
            while True:
                try:
                    yield decoder.decode(first, final=not first).encode("utf-8")
                except UnicodeDecodeError as error:
                    yield error.object[: error.start].decode(coded).encode("utf-8")
                    wrong = error.object[error.start : error.end][:4].hex(" ")
                    raise _NotText(coded, wrong) from None
                if not first:
                    return
                first = stream.read(size)
    except OSError as error:
        raise ConfigError(f"cannot be read: {error.strerror}", file=str(path)) from None


def _utf_16(first: bytes) -> str:
    """The order of bytes in UTF-16 without a mark: most characters of a table are ASCII, whose upper byte is zero."""
    zeros = first[::2].count(0), first[1::2].count(0)
    return "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
