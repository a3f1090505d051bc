"""A headless Chromium, driven by its own protocol (Chrome DevTools Protocol) over a WebSocket."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import aiohttp

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
# The limit for everything that the page should do; a busy machine needs a part of it.
_SECONDS = 20
_KEYS = {"Enter": 13, "Tab": 9, "Escape": 27, "Delete": 46, "Backspace": 8, "Home": 36, "End": 35}
_KEYS |= {"ArrowLeft": 37, "ArrowRight": 39, "ArrowDown": 40}
_CONTROL, _SHIFT = 2, 8


class Page:
    """A page of the browser; `trouble` collects its errors and what its policy has refused.

    `context` is the browser's name of its cookies and storage.
    """

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, context: str = "") -> None:
        self.context = context
        self._socket = socket
        self._count = 0
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self._reader = asyncio.create_task(self._read())
        self.trouble: list[str] = []

    async def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol."""
        self._count += 1
        answer = self._answers[self._count] = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": self._count, "method": method, "params": parameters})
        return await asyncio.wait_for(answer, _SECONDS)

    async def open(self, address: str) -> None:
        """Open an address in a window of 1,400 by 1,000 pixels."""
        for domain in "Page", "Runtime", "Log":
            await self.call(f"{domain}.enable")
        window = {"width": 1400, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        await self.call("Emulation.setDeviceMetricsOverride", **window)
        await self.call("Page.navigate", url=address)

    async def evaluate(self, script: str) -> Any:
        """Return the value of an expression in the page."""
        found = await self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, (script, found["exceptionDetails"])
        return found["result"].get("value")

    async def until(self, script: str) -> None:
        """Wait until an expression is true; as long as it throws, for lack of an element, it is not."""
        end = time.monotonic() + _SECONDS
        attempt = f"(() => {{ try {{ return Boolean({script}) }} catch (error) {{ return String(error) }} }})()"
        found: Any = None
        while time.monotonic() < end:
            found = await self.evaluate(attempt)
            if found is True:
                return
            await asyncio.sleep(0.05)
        text = await self.evaluate("document.body.innerText")
        raise AssertionError(f"it did not become true: {script}; {found}; {self.trouble}; {text}")

    async def place(self, selector: str) -> tuple[float, float]:
        """Return the middle of an element, once it is there and at rest."""
        find = f"document.querySelector({json.dumps(selector)})"
        middle = f"(b => b && [b.x + b.width / 2, b.y + b.height / 2])({find}?.getBoundingClientRect())"
        end = time.monotonic() + _SECONDS
        before: Any = None
        while time.monotonic() < end:
            await self.evaluate(f"{find}?.scrollIntoView({{block: 'nearest'}})")
            place = await self.evaluate(middle)
            if place and place == before:
                return place[0], place[1]
            before = place
            await asyncio.sleep(0.1)
        raise AssertionError(f"it does not come to rest: {selector}; {self.trouble}")

    async def click(self, selector: str) -> None:
        """Click on the middle of an element, once it takes clicks."""
        await self.until(f"!document.querySelector({json.dumps(selector)}).disabled")
        await self.drag(selector, None)

    async def drag(self, start: str, end: str | None) -> None:
        """Press the mouse at one element and release it at another."""
        x, y = await self.place(start)
        mouse = {"button": "left", "clickCount": 1}
        await self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        await self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **mouse)
        if end:
            to_x, to_y = await self.place(end)
            for part in range(1, 11):
                way = part / 10
                moved = {"x": x + (to_x - x) * way, "y": y + (to_y - y) * way}
                await self.call("Input.dispatchMouseEvent", type="mouseMoved", buttons=1, **moved)
            x, y = to_x, to_y
        await self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, **mouse)

    async def choose(self, selector: str, value: str) -> None:
        """Choose a value of a list, once it is there."""
        find = f"document.querySelector({json.dumps(selector)})"
        option = f"[...{find}.options].some(option => option.value === {json.dumps(value)})"
        chosen = f"({find}.value = {json.dumps(value)}, {find}.dispatchEvent(new Event('change', {{bubbles: true}})))"
        await self.until(f"{option} && ({chosen}, true)")

    async def press(self, *keys: str, control: bool = False, shift: bool = False) -> None:
        """Press and release keys, one after the other."""
        for key in keys:
            code = _KEYS.get(key) or ord(key.upper())
            common = {"key": key, "windowsVirtualKeyCode": code, "modifiers": _CONTROL * control | _SHIFT * shift}
            text = {"Enter": "\r"}.get(key, "" if key in _KEYS or control else key)
            await self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
            await self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    async def write(self, text: str) -> None:
        """Type a text where the focus is."""
        await self.call("Input.insertText", text=text)

    async def picture(self, path: Path) -> None:
        """Write a picture of the window."""
        path.write_bytes(base64.b64decode((await self.call("Page.captureScreenshot"))["data"]))

    async def _read(self) -> None:
        async for message in self._socket:
            content = message.json()
            method, parameters = content.get("method", ""), content.get("params", {})
            if "id" in content:
                answer = self._answers.pop(content["id"])
                if "error" in content:
                    answer.set_exception(AssertionError(content["error"]))
                else:
                    answer.set_result(content["result"])
            elif method == "Runtime.exceptionThrown" or parameters.get("entry", {}).get("level") == "error":
                self.trouble.append(json.dumps(parameters))


class Browser:
    """A running browser, whose profile is in a folder; within a `with`, after which both are gone."""

    def __init__(self, folder: Path, *options: str) -> None:
        assert PROGRAM
        command = [PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
        command += ["--remote-debugging-port=0", f"--user-data-dir={folder}", *options, "about:blank"]
        self._folder = folder
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._port = folder / "DevToolsActivePort"

    @asynccontextmanager
    async def opened(self, address: str) -> AsyncIterator[Page]:
        """A page that has cookies and storage of its own."""
        end = time.monotonic() + _SECONDS
        while not (self._port.exists() and self._port.read_text().count("\n")):
            assert self._process.poll() is None, "the browser ended"
            assert time.monotonic() < end, "the browser did not start"
            await asyncio.sleep(0.1)
        port, path = self._port.read_text().split()
        base = f"ws://127.0.0.1:{port}"
        async with aiohttp.ClientSession() as session, session.ws_connect(base + path) as own:
            browser = Page(own)
            context = (await browser.call("Target.createBrowserContext"))["browserContextId"]
            try:
                target = await browser.call("Target.createTarget", url="about:blank", browserContextId=context)
                async with session.ws_connect(f"{base}/devtools/page/{target['targetId']}", max_msg_size=0) as socket:
                    page = Page(socket, context)
                    await page.open(address)
                    yield page
            finally:
                await browser.call("Target.disposeBrowserContext", browserContextId=context)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)


@cache
def shared_browser() -> Browser:
    """The browser of the tests of a process, at whose end tests/studio/conftest.py ends it."""
    return Browser(Path(tempfile.mkdtemp(prefix="firm_browser_")))


@asynccontextmanager
async def opened(address: str, folder: Path, *options: str) -> AsyncIterator[Page]:
    """A page in a browser of its own, whose profile is in a folder."""
    with Browser(folder, *options) as browser:
        async with browser.opened(address) as page:
            yield page
