"""The server of the page: where it listens, who may look, who may act, and how it ends."""

from __future__ import annotations

import hmac
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import app, ui
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from swingid.errors import UsageError

LOCAL = ("127.0.0.1", "localhost", "::1")
COOKIE = "swingid_token"
VENDOR = Path(__file__).with_name("vendor")


@dataclass(frozen=True, slots=True)
class Place:
    """Where the page is served. token: what a browser must know, "" where only this machine can reach it."""

    host: str = "127.0.0.1"
    port: int = 8080
    token: str = ""

    @property
    def address(self) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/" + (f"?token={quote(self.token)}" if self.token else "")


def free_port(host: str, wanted: int) -> int:
    """The wanted port, or the next free one of twenty; UsageError where none is."""
    for port in range(wanted, wanted + 20):
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                trial.bind((host, port))
            except OSError as error:
                last = error
            else:
                return port
    text = f"no port from {wanted} to {wanted + 19} of {host} is free ({last.strerror}); give another --port"
    raise UsageError(text, code="port-busy")


class TokenRequired(BaseHTTPMiddleware):
    """Pages and files only for who knows the token: once in the address, then in a cookie."""

    def __init__(self, application: Any, token: str) -> None:
        super().__init__(application)
        self.token = token

    async def dispatch(self, request: Request, call_next: Callable[[Request], Any]) -> Response:
        """Answer a request, or refuse it."""
        given = request.query_params.get("token") or request.cookies.get(COOKIE) or ""
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            text = "This page needs the token that swingid dashboard printed: open the whole address, with ?token=…"
            return PlainTextResponse(text, status_code=403)
        response: Response = await call_next(request)
        response.set_cookie(COOKIE, self.token, httponly=True, samesite="strict")
        return response


def serve(build: Callable[[], None], place: Place, *, show: bool, closing: Callable[[], None]) -> None:
    """Serve the page that `build` lays out for each browser, until Ctrl-C; `closing` is called at the end."""
    app.add_static_files("/swingid/vendor", str(VENDOR))
    if place.token:
        app.add_middleware(TokenRequired, token=place.token)
    app.on_shutdown(closing)
    ui.run(
        build,
        host=place.host,
        port=place.port,
        title="swingid",
        favicon="⚖️",
        dark=None,
        language="en-US",
        reload=False,
        show=show,
        show_welcome_message=False,
        reconnect_timeout=10.0,
    )
