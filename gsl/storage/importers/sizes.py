"""What reading a file would take, told before it is read; packed files are counted while they are unpacked."""

from __future__ import annotations

import contextlib
import gzip
import io
import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from gsl.core.budget import open_file
from gsl.errors import TrajectoryError

GB = 1e9
LONGEST_LINE = 4_000_000
"""Bytes; a text file without line ends would fill the memory."""
FEW, PACKED = 2e8, 100.0
"""Bytes that come out of any packed file, and for one of a larger file: text of logs packs by 10."""
PICKLE = b"\x80"
DAMAGED = "truncated or damaged; copy it again, or log it again if its logger was killed"
OPEN_END = "the file ends within this line, as that of a killed logger does: delete the line"
PIECE = 1_000_000  # bytes that are read at once where lines are counted


def check_need(path: Path, need: float, memory: float) -> None:
    """Refuse to read what needs more memory than allowed, both in [bytes]."""
    if need > memory:
        problem = f"would need about {need / GB:.2g} GB of memory, {memory / GB:.2g} GB are allowed"
        raise TrajectoryError(path, f"{problem}; cut it into several files, or say memory={1.1 * need / GB:.2g}")


@contextlib.contextmanager
def open_log(path: Path, *, most: float, lines: bool = False) -> Iterator[IO[bytes]]:
    """Open a file for reading, unpacked if its name ends with gz.

    Args:
        path: The file.
        most: Bytes that may come out of it.
        lines: Whether it has to have line ends.

    Raises:
        TrajectoryError: It is empty, damaged, a pickle, or holds more.
    """
    try:
        packed = path.name.endswith(".gz")
        most = min(most, max(FEW, PACKED * path.stat().st_size)) if packed else most
        with open_file(path) as raw:
            source = gzip.GzipFile(fileobj=raw) if packed else raw
            reader = io.BufferedReader(_Counted(path, source, most, lines))
            start = reader.peek(1)[:1]
            if not start:
                raise TrajectoryError(path, "is empty; log it again")
            if start == PICKLE:
                raise TrajectoryError(path, "is a Python pickle, which can run code: none is read; export it as CSV")
            yield reader
    except EOFError as error:
        problem = "is cut off, as that of a killed logger is; copy it again, or unpack what is whole with zcat"
        raise TrajectoryError(path, problem) from error
    except (gzip.BadGzipFile, zlib.error) as error:
        raise TrajectoryError(path, "is no gzip file, or truncated or damaged; copy it again") from error
    except OSError as error:
        raise TrajectoryError(path, f"cannot be read: {error.strerror or error}") from error


def is_open_line(path: Path, line: int) -> bool:
    """Whether a text file ends within a line, counted from 1, as it does whose logger was killed.

    A disk that lost its power pads with zeros. What follows that line is not read, nor more than `open_log` allows.
    """
    count, last = 1, b"\n"
    try:
        with open_log(path, most=math.inf, lines=True) as source:
            while count <= line and (piece := source.read(PIECE)):
                count, last = count + piece.count(b"\n"), piece[-1:]
    except TrajectoryError:
        return False
    return count == line and last not in b"\r\n"


class _Counted(io.RawIOBase):
    """Counts what is read and refuses more than `most` bytes, and lines that do not end."""

    def __init__(self, path: Path, source: io.BufferedIOBase | gzip.GzipFile, most: float, lines: bool) -> None:
        self.path, self.source, self.most, self.lines = path, source, most, lines
        self.count = self.line = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        size = self.source.readinto(buffer)
        self.count += size
        if self.count > self.most:
            problem = f"unpacks to more than {self.most / GB:.2g} GB; cut it into several files, or say memory=..."
            raise TrajectoryError(self.path, problem)
        end = max(bytes(buffer[:size]).rfind(mark) for mark in (b"\n", b"\r"))
        self.line = self.line + size if end < 0 else size - end
        if self.lines and self.line > LONGEST_LINE:
            raise TrajectoryError(self.path, f"has a line of more than {LONGEST_LINE:,} bytes; it is no text table")
        return size
