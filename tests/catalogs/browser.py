"""A page in Chromium without a window: what it asks, what goes wrong in it, and what a reader would do.

Chromium is spoken to over two pipes (its DevTools protocol, messages that end in a zero byte), so nothing but the
standard library is needed.
"""

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 60.0  # s, for one answer and for a condition of the page
OPTIONS = (
    "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
    "--proxy-server=127.0.0.1:9", "--proxy-bypass-list=<-loopback>",  # nothing listens there
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--disable-gpu-compositing",  # pages are drawn without the detour over WebGL's software
)  # fmt: skip


def find_browser() -> str:
    """Path of a Chromium; skips the test where there is none."""
    found = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(PROGRAMS)} is installed")
    return found


class Browser:
    """One page of a Chromium of its own. Use as a context: it ends with it.

    errors: what scripts threw, and what the browser reported as an error; requests: addresses that pages asked for.
    """

    def __init__(self, profile: Path, *options: str, size: tuple[int, int] = (1366, 768)):
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.count, self.received, self.answers = 0, b"", {}
        command = [
            find_browser(),
            *OPTIONS,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            *options,
        ]
        # Chromium reads commands from file 3 and writes to file 4: the shell makes them of its input and output.
        started = 'exec "$@" 3<&0 4>&1 </dev/null >/dev/null'
        self.process = subprocess.Popen(
            ["bash", "-c", started, "bash", *command, "about:blank"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, bufsize=0,
        )  # fmt: skip
        self.session = ""
        pages = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in pages if target["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False
        )

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE)
        self.process.stdin.close()
        self.process.stdout.close()

    def call(self, method: str, **parameters: Any) -> dict:
        """The result of a command; events that arrive meanwhile are kept. Raises RuntimeError for what it refuses."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.process.stdin.write(json.dumps(message).encode() + b"\0")
        until = time.monotonic() + PATIENCE
        while self.count not in self.answers:
            self._receive(until - time.monotonic())
        answer = self.answers.pop(self.count)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def _receive(self, seconds: float) -> None:
        """Read what the browser says within so many seconds."""
        if not select.select([self.process.stdout], [], [], max(seconds, 0.0))[0]:
            raise TimeoutError("the browser does not answer")
        part = os.read(self.process.stdout.fileno(), 1 << 20)
        if not part:
            raise RuntimeError("the browser has ended")
        *messages, self.received = (self.received + part).split(b"\0")
        for message in map(json.loads, messages):
            parameters = message.get("params", {})
            if "id" in message:
                self.answers[message["id"]] = message
            elif message["method"] == "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                self.errors.append(details.get("exception", {}).get("description") or details["text"])
            elif message["method"] == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
                self.errors.append(" ".join(str(one.get("value", "")) for one in parameters["args"]))
            elif message["method"] == "Log.entryAdded" and parameters["entry"]["level"] == "error":
                self.errors.append(parameters["entry"]["text"])
            elif message["method"] == "Network.requestWillBeSent":
                self.requests.append(parameters["request"]["url"])

    def value(self, expression: str) -> Any:
        """What a JavaScript expression of the page gives, as plain data; a promise is waited for."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def open(self, page: Path) -> None:
        """Open a page from its file."""
        self.call("Page.navigate", url=page.resolve().as_uri())

    def wait_for(self, expression: str) -> Any:
        """The first true value of an expression. Raises TimeoutError, with the page's errors, if it stays false."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            if found := self.value(expression):
                return found
            time.sleep(0.05)
        raise TimeoutError(f"{expression} stays false; errors: {self.errors}")

    def press(self, key: str, code: int = 0) -> None:
        """Press and release a key; code: its Windows key code, for those that the browser acts on itself."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the mouse, move it, release it; a click where both places are one."""
        mouse = {"button": "left", "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], **mouse)
        if end != start:
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=end[0], y=end[1], button="left", buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], **mouse)

    def picture(self, path: Path) -> Path:
        """Save what the window shows, as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
        return path
