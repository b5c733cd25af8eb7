"""Who may ask the server: only requests with its token, addressed to this machine, and not sent by the page of another site."""

from __future__ import annotations

import hmac
import ipaddress
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

_TOKEN = "token"
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "no-referrer",
}


@dataclass(frozen=True)
class Gate:
    """Around the whole server: pages, static files, uploads and websockets."""

    app: ASGIApp
    token: str
    # The address that was asked for; requests may also name an IP address or localhost.
    host: str
    port: int

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
        elif (refusal := self._refusal(scope)) is None:
            await self.app(scope, receive, _adding(send, _HEADERS) if scope["type"] == "http" else send)
        elif scope["type"] == "websocket":
            await WebSocketClose(1008)(scope, receive, send)
        else:
            await refusal(scope, receive, send)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        # A page of another site whose name was made to point here sends that name.
        if not self._is_this_machine(host):
            return PlainTextResponse(
                "rigsight: this server answers only under the address that it printed.", 421
            )
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host and not _reads_a_file(scope, origin):
            return PlainTextResponse("rigsight: sent by the page of another site.", 403)
        if self._is_known(_cookie(headers, self._cookie_name)):
            return None
        query = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        if scope["type"] == "http" and self._is_known(query.pop(_TOKEN, "")):
            # The token leaves the address bar, and with it the history and what is copied from there.
            answer = RedirectResponse(f"{scope['path']}?{urlencode(query)}".rstrip("?"), 303, _HEADERS)
            answer.set_cookie(self._cookie_name, self.token, httponly=True, samesite="strict")
            return answer
        return PlainTextResponse(
            "rigsight: open the address that 'rigsight app' printed when it started, with its token.", 403
        )

    @property
    def _cookie_name(self) -> str:
        # Cookies do not distinguish ports, and two folders may be open at once.
        return f"rigsight_{self.port}"

    def _is_known(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())

    def _is_this_machine(self, host: str) -> bool:
        name = host.rpartition(":")[0] if not host.endswith("]") and ":" in host else host
        if name in ("localhost", self.host):
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True


def _reads_a_file(scope: Scope, origin: str) -> bool:
    """Return whether a report, which is shown without an origin of its own, asks for a file."""
    return origin == "null" and scope["type"] == "http" and scope["method"] in ("GET", "HEAD")


def _cookie(headers: Headers, name: str) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _adding(send: Send, headers: dict[str, str]) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(headers)
        await send(message)

    return sent
