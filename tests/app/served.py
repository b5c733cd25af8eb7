"""A server of the pages in a process of its own, and a visitor who clicks and types as a person does."""

from __future__ import annotations

import http.client
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from ..chromium import Chromium

_PATIENCE = 120.0


def wait_for(condition: Callable[[], object], what: str = "a condition", patience: float = _PATIENCE) -> None:
    """Wait until something is true, for at most this time [s]."""
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, f"never: {what}"
        time.sleep(0.05)


class Server:
    """`rigsight app` on a folder."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "rigsight", "app", str(folder), "--no-browser", *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        assert self.address.startswith("http://127.0.0.1:"), self.address

    @property
    def origin(self) -> str:
        """The address without its token."""
        return self.address.partition("/?")[0]

    def ask(self, method: str, path: str, body: object = None, **headers: str) -> tuple[int, str]:
        """Ask as a program does that knows the token, and return code and text of the answer."""
        place = urlsplit(self.address)
        cookie = f"rigsight_{place.port}={place.query.partition('=')[2]}"
        connection = http.client.HTTPConnection("127.0.0.1", place.port, timeout=_PATIENCE)
        connection.request(method, path, body, {"Cookie": cookie, **headers})  # type: ignore[arg-type]
        answer = connection.getresponse()
        return answer.status, answer.read().decode("utf-8", "replace")

    def end(self, number: int = signal.SIGINT) -> None:
        """End the server."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        self.process.wait(timeout=_PATIENCE)
        assert self.process.stdout is not None
        self.process.stdout.close()


class Visitor:
    """One window."""

    def __init__(self, chromium: Chromium, server: Server) -> None:
        self.chromium, self.server = chromium, server
        self.go("/")

    def go(self, path: str) -> None:
        """Open a page; the token is known from the first one on."""
        address = self.server.address if path == "/" else self.server.origin + path
        self.chromium.open(address, 1280, 800)
        self._arrive()

    def follow(self, link: str) -> None:
        """Click a link, and wait for its page."""
        self.chromium.evaluate("window.isLeft = true")
        self.press(link)
        self.chromium.wait("!window.isLeft")
        self._arrive()

    def _arrive(self) -> None:
        # What is clicked before the page is connected is not heard.
        self.chromium.wait("!!document.querySelector('main.content h1') && window.socket?.connected === true")

    def step(self, title: str) -> None:
        """Go to a step by its title."""
        self.follow(next(name for name in self._steps() if name[2:].partition("\n")[0] == title))

    def is_done(self, title: str) -> bool:
        """Return whether the step of this title is marked as done."""
        return f"{title}\ndone" in {name[2:] for name in self._steps()}

    def _steps(self) -> list[str]:
        names = self.chromium.evaluate(
            "[...document.querySelectorAll('nav a')].map((e) => e.innerText.trim())"
        )
        return [str(name) for name in names]

    def sees(self, words: str) -> bool:
        """Return whether words are on the page."""
        return bool(self.chromium.evaluate(f"document.body?.innerText.includes({words!r})"))

    def wait_to_see(self, words: str, patience: float = _PATIENCE) -> None:
        """Wait until words are on the page, for at most this time [s]."""
        wait_for(lambda: self.sees(words), f"'{words}' on the page", patience)

    def press(self, name: str) -> None:
        """Click what has this name: a button, a link or an entry of a list."""
        found = (
            "[...document.querySelectorAll('button, a, [role=option]')]"
            f".find((e) => (e.getAttribute('aria-label') || e.innerText).trim().startsWith({name!r}))"
        )
        self.chromium.wait(f"!!{found}")
        self.chromium.evaluate(f"{found}.click()")

    def choose(self, name: str) -> None:
        """Choose an entry of the list of the page."""
        self.chromium.evaluate("document.querySelector('.q-select').click()")
        self.press(name)

    def text_of_campaign(self) -> str:
        """Return what the editor shows; lines that are not on the screen are not in the page."""
        self.chromium.wait("!!document.querySelector('.cm-content')")
        return str(self.chromium.evaluate("document.querySelector('.cm-content').innerText"))

    def type_campaign(self, text: str) -> None:
        """Replace the text in the editor by typing over it."""
        self.text_of_campaign()
        self.chromium.evaluate("document.querySelector('.cm-content').focus()")
        self.chromium.key("a", modifiers=2)
        self.chromium.send("Input.insertText", text=text)
