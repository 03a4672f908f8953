"""A headless Chromium for tests, spoken to in the DevTools protocol."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import urllib.request
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

from tests.support.live import eventually

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--remote-debugging-port=0",
)


OWN_DOING = "Canvas2D: Multiple readback"
"""How Chromium complains when a test, not the page, looks at what a canvas shows."""


class Chromium:
    """One browser with one page. `troubles` are errors and warnings that the page caused."""

    def __init__(self) -> None:
        assert PROGRAM is not None
        self._folder = tempfile.TemporaryDirectory(prefix="chr", ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [PROGRAM, *FLAGS, f"--user-data-dir={self._folder.name}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        told = Path(self._folder.name) / "DevToolsActivePort"
        assert eventually(lambda: told.exists() and told.read_text().count("\n") > 0, 30.0)
        port = told.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            targets = json.load(answer)
        url = next(item["webSocketDebuggerUrl"] for item in targets if item["type"] == "page")
        self._connecting = connect(url, max_size=None)
        self._socket = self._connecting.__enter__()
        self._number = 0
        self.troubles: list[str] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Result of a DevTools command; events that come meanwhile are noted."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while True:
            said = json.loads(self._socket.recv(timeout=60.0))
            if said.get("id") == self._number:
                assert "error" not in said, said
                return dict(said["result"])
            self._note(said)

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        kind = event.get("method")
        if kind == "Runtime.exceptionThrown":
            self.troubles.append(json.dumps(params["exceptionDetails"]))
        elif kind == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            if not params["entry"]["text"].startswith(OWN_DOING):
                self.troubles.append(params["entry"]["text"])
        elif kind == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.troubles.append(json.dumps(params["args"]))

    def run(self, script: str) -> Any:
        """Value of a JavaScript expression, awaited if it is a promise."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def comes_true(self, script: str, seconds: float = 30.0) -> bool:
        """Whether an expression comes true within the time."""
        return eventually(lambda: bool(self.run(script)), seconds, 0.05)

    def open(self, url: str, width: int = 1280, height: int = 720, scheme: str = "light") -> None:
        """Show a page; returns when it is loaded."""
        self.call("Page.navigate", url="about:blank")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)
        self.troubles.clear()
        self.call("Page.navigate", url=url)
        assert self.comes_true("document.readyState === 'complete'")

    def key(self, name: str, down: bool, *, control: bool = False) -> None:
        """Press or let go a key, maybe with Control held."""
        kind, modifiers = "rawKeyDown" if down else "keyUp", 2 if control else 0
        self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, modifiers=modifiers)

    def close(self) -> None:
        # First it, then the line to it: a living one would let us wait for its farewell.
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._connecting.__exit__(None, None, None)
        self._folder.cleanup()
