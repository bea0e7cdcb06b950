"""A page in Chromium without a window: what a reader sees at some width, and what the browser complains of."""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import os
import select
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

DESK, PHONE = 1280, 390  # widths [px]
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--remote-debugging-pipe",
)  # fmt: skip
PATIENCE = 120  # with a browser that says nothing [s]
FREE = 10  # file descriptors from here on are nobody's
CUT_OR_COVERED = """
(() => {
  const found = [];
  for (const svg of document.querySelectorAll("svg")) {
    const edge = svg.getBoundingClientRect();
    if (!edge.width) continue;
    const level = [...svg.querySelectorAll("text")].filter(one => Math.abs(one.getScreenCTM().b) < 1e-6);
    const boxes = level.map(one => [one.textContent.trim(), one.getBoundingClientRect()]);
    const shown = boxes.filter(([text, box]) => text && box.width);
    for (const [text, box] of shown)
      if (box.left < edge.left - 1 || box.right > edge.right + 1 ||
          box.top < edge.top - 2 || box.bottom > edge.bottom + 2) found.push(`cut: ${text}`);
    shown.forEach(([text, box], k) => {
      for (const [other, beside] of shown.slice(k + 1)) {
        const wide = Math.min(box.right, beside.right) - Math.max(box.left, beside.left);
        const high = Math.min(box.bottom, beside.bottom) - Math.max(box.top, beside.top);
        if (wide > 2 && high > 0.4 * Math.min(box.height, beside.height)) found.push(`${text} covers ${other}`);
      }
    });
  }
  return found;
})()
"""


class Browser:
    """Chromium, spoken to over two pipes by its DevTools protocol.

    Attributes:
        wrong: What it complained of since a page was opened, and what the page asked for outside of files.
    """

    def __init__(self, program: str, home: str) -> None:
        read, write = os.pipe()
        answers, say = os.pipe()
        theirs = [fcntl.fcntl(end, fcntl.F_DUPFD, FREE) for end in (read, say)]
        words = [program, *FLAGS, f"--user-data-dir={home}", "about:blank"]
        line = f'exec "$0" "$@" 3<&{theirs[0]} 4>&{theirs[1]}'
        self._process = subprocess.Popen(["bash", "-c", line, *words], pass_fds=theirs, stderr=subprocess.DEVNULL)
        for end in (read, say, *theirs):
            os.close(end)
        self._to, self._from, self._heard = write, answers, b""
        self._number, self._session, self._loaded = 0, "", False
        self.wrong: list[str] = []
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable")

    def open(self, path: Path, width: int) -> None:
        """Show a file in a window of so many pixels."""
        self.wrong, self._loaded = [], False
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < DESK}
        self._ask("Emulation.setDeviceMetricsOverride", **size)
        self._ask("Page.navigate", url=path.resolve().as_uri())
        while not self._loaded:
            self._hear()

    def print(self) -> None:
        """Show the page as paper would."""
        self._ask("Emulation.setEmulatedMedia", media="print")

    def value(self, script: str) -> Any:
        """Return what a script says in the page."""
        answer = self._ask("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def photograph(self, path: Path) -> None:
        """Write the whole page as a picture."""
        shot = self._ask("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def close(self) -> None:
        """End it."""
        with contextlib.suppress(OSError, EOFError):
            self._session = ""
            self._ask("Browser.close")
        for end in (self._to, self._from):
            os.close(end)
        self._process.wait(timeout=PATIENCE)

    def _ask(self, method: str, **settings: Any) -> dict[str, Any]:
        self._number += 1
        at = {"sessionId": self._session} if self._session else {}
        message = {"id": self._number, "method": method, "params": settings, **at}
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._hear()).get("id") != self._number:
            pass
        assert "error" not in answer, answer
        result: dict[str, Any] = answer["result"]
        return result

    def _hear(self) -> dict[str, Any]:
        """Return the next message, and note what it complains of."""
        while b"\0" not in self._heard:
            if not select.select([self._from], [], [], PATIENCE)[0]:
                raise TimeoutError("the browser does not answer")
            if not (more := os.read(self._from, 1 << 16)):
                raise EOFError("the browser has ended")
            self._heard += more
        text, _, self._heard = self._heard.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        said = message.get("params", {})
        match message.get("method"):
            case "Page.loadEventFired":
                self._loaded = True
            case "Runtime.consoleAPICalled":
                self.wrong.append(str(said["args"]))
            case "Runtime.exceptionThrown":
                self.wrong.append(str(said["exceptionDetails"]))
            case "Log.entryAdded":
                self.wrong.append(str(said["entry"]["text"]))
            case "Network.requestWillBeSent" if not said["request"]["url"].startswith(("file:", "data:")):
                self.wrong.append(str(said["request"]["url"]))
        return message


def chromium() -> str | None:
    """The program, if this computer has it."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@contextlib.contextmanager
def browser() -> Iterator[Browser]:
    """A browser of this computer; without one the test is skipped."""
    program = chromium()
    if program is None:
        pytest.skip("no Chromium is installed")
    with TemporaryDirectory() as home:
        started = Browser(program, home)
        try:
            yield started
        finally:
            started.close()


def check_seen(path: Path, *figures: str) -> None:
    """Fail if a page does not show a reader these words, on a desk and on a phone.

    No error in its console, nothing from outside, no horizontal scroll, no label that is cut or covered.
    """
    with browser() as shown:
        for width in (DESK, PHONE):
            shown.open(path, width)
            text = " ".join(str(shown.value("document.body.innerText")).split())
            assert [figure for figure in figures if figure not in text] == []
            assert shown.value("document.documentElement.scrollWidth") <= width
            assert shown.value(CUT_OR_COVERED) == []
            assert shown.wrong == []
