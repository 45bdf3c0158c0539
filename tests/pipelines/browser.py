# SPDX-License-Identifier: LGPL-2.1-or-later
"""Headless Chromium, driven through its DevTools pipe."""
import contextlib
import json
import os
import select
import signal
import subprocess
import time

OPTIONS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
           "--disable-background-networking", "--disable-renderer-backgrounding",
           "--disable-background-timer-throttling", "--remote-debugging-pipe"]


class Browser:
    def __init__(self, profile):
        commands, self._commands = os.pipe()
        self._results, results = os.pipe()
        # Chromium reads commands from descriptor 3 and answers on 4.
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{commands} 4>&{results}', "bash", "chromium", *OPTIONS,
             f"--user-data-dir={profile}", "about:blank"],
            pass_fds=(commands, results), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, start_new_session=True)
        os.close(commands)
        os.close(results)
        self._received = b""
        self._calls = 0

    def call(self, method, session=None, timeout=120, **parameters):
        self._calls += 1
        message = {"id": self._calls, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + timeout
        while answer := self._next_message(method, deadline):
            if answer.get("id") == self._calls:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _next_message(self, method, deadline):
        while b"\0" not in self._received:
            if not select.select([self._results], [], [], max(deadline - time.monotonic(), 0))[0]:
                raise TimeoutError(f"Chromium did not answer {method}")
            part = os.read(self._results, 1 << 16)
            if not part:
                raise RuntimeError("Chromium has ended")
            self._received += part
        message, self._received = self._received.split(b"\0", 1)
        return json.loads(message)

    def open(self, url):
        return Page(self, url)

    def close(self):
        with contextlib.suppress(OSError, RuntimeError, subprocess.TimeoutExpired):
            self.call("Browser.close", timeout=20)
            self._process.wait(20)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._commands)
        os.close(self._results)


class Page:
    def __init__(self, browser, url):
        self._browser = browser
        self._target = browser.call("Target.createTarget", url=url)["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=self._target, flatten=True)["sessionId"]
        deadline = time.monotonic() + 60
        while self.evaluate("document.readyState") != "complete" or self.evaluate("location.href") != url:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{url} was not loaded")
            time.sleep(0.1)

    def evaluate(self, expression):
        """The value of a JavaScript expression; of a promise, what it resolves to."""
        answer = self._browser.call("Runtime.evaluate", self._session, expression=expression,
                                    awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def resize(self, width, height):
        self._browser.call("Emulation.setDeviceMetricsOverride", self._session, width=width, height=height,
                           deviceScaleFactor=1, mobile=False)

    def close(self):
        self._browser.call("Target.closeTarget", targetId=self._target)
