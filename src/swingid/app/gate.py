"""Who may reach the page: its names, its own origin, its token; for pages, files and the socket alike.

A page of another site can send requests to a server on this machine, also under its own name where its DNS entry leads
here (DNS rebinding). So a request must name a host that is ours; what acts must come from a page of that same host.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import socket
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOCAL = ("127.0.0.1", "localhost", "::1")
EVERYWHERE = ("0.0.0.0", "::")
"""Addresses to listen at that mean every address of this machine."""

LARGEST_BODY = 220_000_000
"""Bytes of a request: one dropped file of 200 MB, or several together."""

HEADERS = (
    (b"content-security-policy", b"frame-ancestors 'none'"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
)
"""On every answer: no other page shows this one in a frame, or learns its address, in which the token may stand."""


@dataclass(frozen=True, slots=True)
class Place:
    """The address at which the page is served. token: what a browser must know, "" where only this machine can reach
    it.

    names: further hosts under which browsers reach it, as through a proxy.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    token: str = ""
    names: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """What to open on the host, with the token."""
        return "/" + (f"?token={quote(self.token, safe='')}" if self.token else "")

    @property
    def address(self) -> str:
        """What to open in a browser."""
        host = self.host
        if host in EVERYWHERE:
            outer = [name for name in addresses() if ":" not in name and not ipaddress.ip_address(name).is_loopback]
            host = outer[0] if outer else socket.gethostname()
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}{self.path}"

    @property
    def cookie(self) -> str:
        """Name of the cookie that keeps the token; cookies of all ports of a host come together."""
        return f"swingid_token_{self.port}"

    @property
    def kept(self) -> str:
        """What the cookie holds: what only who knows the token can make."""
        return hashlib.sha256(self.token.encode()).hexdigest()

    def is_ours(self, host: str) -> bool:
        """Return whether a name or an address, as in a request, is that of this server."""
        name = plain(host)
        if name in {plain(each) for each in (*LOCAL, self.host, *self.names)}:
            return True
        if self.host not in EVERYWHERE:
            return False
        here = plain(socket.gethostname())
        short = here.partition(".")[0]
        return name in {here, short, f"{short}.local"} or name in addresses()  # as they are now


def plain(host: str) -> str:
    """A host in one spelling: small letters, addresses shortest, without the dot at the end."""
    name = host.strip().lower().removesuffix(".").removeprefix("[").removesuffix("]")
    with suppress(ValueError):
        return str(ipaddress.ip_address(name))
    return name


def addresses() -> list[str]:
    """The addresses of this machine's adapters, those of IPv4 first."""
    try:
        from ifaddr import get_adapters  # which NiceGUI brings
    except ImportError:
        return []
    ips = [ip.ip if isinstance(ip.ip, str) else ip.ip[0] for adapter in get_adapters() for ip in adapter.ips]
    return sorted((plain(address) for address in ips), key=lambda address: (":" in address, address))


def host_of(authority: str) -> str | None:
    """The host of `HOST`, `HOST:PORT` or `[ADDRESS]:PORT`; None for anything else."""
    host, colon, port = authority.rpartition(":")
    if not colon or authority.endswith("]"):
        host, port = authority, ""
    bracketed = host.startswith("[") and host.endswith("]")
    if not host or (port and not (port.isascii() and port.isdigit())) or (":" in host and not bracketed):
        return None
    return host


class Gate:
    """ASGI middleware, outside of all others: refuses what is not for this page, and sets `HEADERS`."""

    def __init__(self, application: ASGIApp, place: Place) -> None:
        self.application, self.place = application, place

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it in one sentence; a socket that is refused is not opened."""
        if scope["type"] not in ("http", "websocket"):
            await self.application(scope, receive, send)
            return
        headers = Headers(scope=scope)
        wrong = self._foreign(scope, headers)
        given = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1")))
        if not wrong and self.place.token and not self._knows(given, headers):
            wrong = "This page needs the token that swingid dashboard printed: open the whole address, with ?token=…"
        if not wrong and _too_large(headers):
            await _answer(send, 413, b"A page takes files of 200 MB at most.\n", [(b"content-type", b"text/plain")])
        elif wrong:
            await _refuse(scope, receive, send, wrong)
        elif scope["type"] == "http" and scope["method"] == "GET" and self.place.token and "token" in given:
            await self._remember(scope, send, given)
        elif scope["type"] == "http":
            await self.application(scope, receive, _with_headers(send))
        else:
            await self.application(scope, receive, send)

    def _foreign(self, scope: Scope, headers: Headers) -> str:
        """Why a request is not one of a page of this server; "" where it is."""
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        host = host_of(hosts[0]) if len(hosts) == 1 else None
        if host is None or not self.place.is_ours(host):
            return (
                "This address is not one of this page: open the one that swingid dashboard printed, "
                "or start it with --allow-host and the name that you use"
            )
        acts = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        allowed = [f"{scheme}://{hosts[0]}".lower() for scheme in ("http", "https")]  # https: behind a proxy
        if len(origins) > 1 or (acts and not origins) or (origins and origins[0].lower() not in allowed):
            return "This comes from a page of another address, which may not reach this one"
        site, mode = headers.getlist("sec-fetch-site"), headers.getlist("sec-fetch-mode")
        if any(word in ("cross-site", "same-site") for word in site) and mode != ["navigate"]:
            return "This comes from a page of another address, which may not reach this one"
        return ""

    def _knows(self, given: Mapping[str, str], headers: Headers) -> bool:
        """Return whether a request has the token, in its address or in a cookie."""
        token, kept, cookie = self.place.token, self.place.kept, self.place.cookie
        known = [_same(given["token"], token)] if "token" in given else []
        with suppress(CookieError):
            for line in headers.getlist("cookie"):
                known += [_same(each.value, kept) for name, each in SimpleCookie(line).items() if name == cookie]
        return any(known)

    async def _remember(self, scope: Scope, send: Send, given: Mapping[str, str]) -> None:
        """Put the token into a cookie and lead to the same address without it."""
        rest = urlencode({name: value for name, value in given.items() if name != "token"})
        path = quote("/" + scope["path"].lstrip("/"))  # one slash: two would lead to another host
        # Lax: a link in a mail leads here, too; the socket of another site's page gets no cookie
        cookie = f"{self.place.cookie}={self.place.kept}; HttpOnly; Path=/; SameSite=Lax"
        headers = [
            (b"location", (path + (f"?{rest}" if rest else "")).encode("ascii")),
            (b"set-cookie", cookie.encode("ascii")),
            (b"cache-control", b"no-store"),
        ]
        await _answer(send, 303, b"", headers)


def _too_large(headers: Headers) -> bool:
    """Return whether the body of a request is larger than `LARGEST_BODY`, or its length is not stated."""
    lengths = headers.getlist("content-length")
    return bool(headers.getlist("transfer-encoding")) or any(
        not length.isdigit() or int(length) > LARGEST_BODY for length in lengths
    )


def _same(first: str, second: str) -> bool:
    """Return whether two texts are the same, in a time that does not tell how far they are."""
    return hmac.compare_digest(first.encode("utf-8", "replace"), second.encode("utf-8", "replace"))


async def _refuse(scope: Scope, receive: Receive, send: Send, text: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})  # before it is accepted: the answer is 403
        return
    await _answer(send, 403, f"{text}.\n".encode(), [(b"content-type", b"text/plain; charset=utf-8")])


async def _answer(send: Send, status: int, body: bytes, headers: Sequence[tuple[bytes, bytes]]) -> None:
    length = (b"content-length", str(len(body)).encode())
    await send({"type": "http.response.start", "status": status, "headers": [*headers, length, *HEADERS]})
    await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    """A `send` that adds `HEADERS`."""
    names = {name for name, _ in HEADERS}

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            kept: list[Any] = [(name, value) for name, value in message["headers"] if name.lower() not in names]
            message = {**message, "headers": [*kept, *HEADERS]}
        await send(message)

    return sent
