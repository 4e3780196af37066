# SPDX-License-Identifier: GPL-3.0-or-later
"""A page in headless Chromium, driven over the pipe of its DevTools protocol
(https://chromedevtools.github.io/devtools-protocol/)."""

import base64
import itertools
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time

LIMIT = 60.0  # of one answer [s]


def program():
    """The browser's path; None where there is none."""
    return next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))),
                None)


class Page:
    """One page of a browser of its own, which ends with the `with` block. `requests` are the addresses that
    were asked for, `complaints` what the console holds of errors and warnings."""

    def __init__(self):
        self.requests, self.complaints = [], []
        self._numbers, self._answers, self._buffer, self._loaded = itertools.count(1), {}, b"", 0
        self._folder = tempfile.TemporaryDirectory(prefix="chromium_", ignore_cleanup_errors=True)
        from_us, self._write = os.pipe()
        self._read, to_us = os.pipe()

        def at_its_numbers():  # the browser reads 3 and writes 4
            high = (os.dup(from_us), os.dup(to_us))
            for number, wanted in zip(high, (3, 4), strict=True):
                os.dup2(number, wanted)

        command = [program(), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                   "--hide-scrollbars", "--no-first-run", "--disable-background-networking",
                   "--disable-component-update", "--disable-sync", "--remote-debugging-pipe",
                   f"--user-data-dir={self._folder.name}", "about:blank"]
        # The pipes are there before Popen makes one of its own, which is therefore not at 3 or 4.
        self._process = subprocess.Popen(command, close_fds=False, preexec_fn=at_its_numbers, start_new_session=True,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                         env={**os.environ, "HOME": self._folder.name})
        os.close(from_us)
        os.close(to_us)
        self._session = None
        target = next(t for t in self._call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self._call(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            os.killpg(self._process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self._process.wait()
        os.close(self._read)
        os.close(self._write)
        self._folder.cleanup()

    def _call(self, method, **arguments):
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": arguments}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        self._until(lambda: number in self._answers, method)
        answer = self._answers.pop(number)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def _until(self, condition, what):
        end = time.monotonic() + LIMIT
        while not condition():
            if not select.select([self._read], [], [], max(0.0, end - time.monotonic()))[0]:
                raise RuntimeError(f"chromium: no answer to {what} within {LIMIT:.0f} s")
            part = os.read(self._read, 1 << 20)
            if not part:
                raise RuntimeError(f"chromium ended before it answered {what}")
            *whole, self._buffer = (self._buffer + part).split(b"\0")
            for message in whole:
                self._heard(json.loads(message))

    def _heard(self, message):
        said, given = message.get("method"), message.get("params", {})
        if "id" in message:
            self._answers[message["id"]] = message
        elif said == "Network.requestWillBeSent":
            self.requests.append(given["request"]["url"])
        elif said == "Page.loadEventFired":
            self._loaded += 1
        elif said == "Runtime.exceptionThrown":
            self.complaints.append(given["exceptionDetails"]["text"])
        elif said == "Runtime.consoleAPICalled" and given["type"] in ("error", "warning", "assert"):
            self.complaints.append(str(given["args"]))
        elif said == "Log.entryAdded" and given["entry"]["level"] in ("error", "warning"):
            self.complaints.append(given["entry"]["text"])

    def open(self, address, width, height, phone=False):
        """Loads the page anew in a window of that size; `phone`: two pixels a point, as a phone has it."""
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                   deviceScaleFactor=2 if phone else 1, mobile=phone)
        before = self._loaded
        self._call("Page.navigate", url=address)
        self._until(lambda: self._loaded > before, address)

    def value(self, expression):
        """What JavaScript says."""
        found = self._call("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in found:
            raise RuntimeError(f"{expression[:80]}: {found['exceptionDetails']['text']}")
        return found["result"].get("value")

    def picture(self, path):
        """The whole page as a PNG."""
        shot = self._call("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))
