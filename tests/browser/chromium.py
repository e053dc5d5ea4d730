"""A headless Chromium driven through its own pipe, with nothing but the standard library.

With ``--remote-debugging-pipe`` Chromium reads JSON commands from file descriptor 3 and writes
answers and events to 4, each ended by a zero byte.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from pathlib import Path

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")


class BrowserError(Exception):
    """Chromium refused a command, or is no longer there."""


class Chromium:
    """One browser with one blank page; a context manager."""

    def __init__(self, timeout: float = 60.0) -> None:
        """Waits at most `timeout` seconds for any answer."""
        self.timeout = timeout
        self.events: list[dict] = []
        self._count = 0
        self._buffer = b""
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)

    def __enter__(self) -> Self:
        """Starts the browser and opens a blank page."""
        program = next((path for name in NAMES if (path := shutil.which(name))), None)
        if program is None:
            sentence = "no Chromium found: run tests/browser/install.sh"
            raise SystemExit(sentence)
        commands_out, self._commands = os.pipe()
        self._answers, answers_in = os.pipe()
        # The shell moves our pipe ends, whatever their numbers, to the descriptors 3 and 4.
        arguments = [
            program,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
            "--no-first-run",
            f"--user-data-dir={self._profile.name}",
            "--remote-debugging-pipe",
            "about:blank",
        ]
        script = f'exec "$@" 3<&{commands_out} 4>&{answers_in}'
        self._process = subprocess.Popen(
            [shutil.which("bash") or "/bin/bash", "-c", script, "chromium", *arguments],
            pass_fds=(commands_out, answers_in),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(commands_out)
        os.close(answers_in)
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the browser and forgets its profile."""
        self._process.kill()
        self._process.wait()
        os.close(self._commands)
        os.close(self._answers)
        self._profile.cleanup()

    _session: str | None = None

    def send(self, method: str, **parameters: object) -> dict:
        """Sends a command and waits for its answer; events that come meanwhile are kept."""
        self._count += 1
        message: dict = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise BrowserError(method, answer["error"]["message"])
                return answer["result"]

    def open(self, page: Path, width: int, scheme: str, media: str = "screen") -> None:
        """Loads a page at a window width in CSS pixels in a colour scheme, and forgets earlier events."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=800,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.send("Emulation.setEmulatedMedia", media=media, features=[feature])
        self.events.clear()
        self.send("Page.navigate", url=page.resolve().as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self._read()
        self.evaluate("document.fonts.ready.then(() => true)")

    def evaluate(self, expression: str) -> object:
        """The value of a JavaScript expression on the page."""
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise BrowserError(expression, answer["exceptionDetails"]["text"])
        return answer["result"].get("value")

    def screenshot(self, file: Path) -> None:
        """Saves the whole page, not only what the window shows, as PNG."""
        size = self.send("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": min(size["height"], 16000), "scale": 1}
        answer = self.send("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)
        file.write_bytes(base64.b64decode(answer["data"]))

    def complaints(self) -> list[str]:
        """Console errors and warnings, exceptions, log entries and requests beyond the page itself."""
        found = []
        for event in self.events:
            method, content = event["method"], event["params"]
            if method == "Runtime.consoleAPICalled" and content["type"] in ("error", "warning"):
                found.append(f"console {content['type']}: {content['args']}")
            elif method == "Runtime.exceptionThrown":
                found.append(f"exception: {content['exceptionDetails']['text']}")
            elif method == "Log.entryAdded":
                found.append(f"log: {content['entry']['text']}")
            elif method == "Network.requestWillBeSent":
                url = content["request"]["url"]
                if content.get("type") != "Document" and not url.startswith("data:"):
                    found.append(f"request: {url}")
        return found

    def _read(self) -> dict:
        end = time.monotonic() + self.timeout
        while b"\0" not in self._buffer:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._answers], [], [], left)[0]:
                sentence = f"silent for {self.timeout} s"
                raise BrowserError(sentence)
            chunk = os.read(self._answers, 1 << 16)
            if not chunk:
                sentence = "ended unexpectedly"
                raise BrowserError(sentence)
            self._buffer += chunk
        text, _, self._buffer = self._buffer.partition(b"\0")
        message = json.loads(text)
        if "method" in message:
            self.events.append(message)
        return message
