"""`swingid dashboard` as a process, and raw requests to it, for tests of the page."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

pytest.importorskip("nicegui", reason="nicegui is not installed: pip install 'swingid[dev]'")


def free_port() -> int:
    """A port that nothing listens at."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


@contextmanager
def served(*arguments: str, **environment: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of `swingid dashboard` with these arguments, once it answers."""
    port = free_port()
    command = [sys.executable, "-m", "swingid", "dashboard", *arguments, "--port", str(port), "--no-browser"]
    # NiceGUI takes another way where it sees pytest
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "NICEGUI"))}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=own | environment
    )
    address = f"http://127.0.0.1:{port}/"
    try:
        until = time.monotonic() + 120
        while time.monotonic() < until and not _answers(address):
            if process.poll() is not None:
                raise AssertionError(process.stdout.read())
            time.sleep(0.2)
        yield address, process
    finally:
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _answers(address: str) -> bool:
    try:
        urllib.request.urlopen(address, timeout=5).close()
    except urllib.error.HTTPError:
        return True
    except OSError:
        return False
    return True


def asked(port: int, path: str, headers: dict[str, str], method: str = "GET", body: bytes = b"") -> tuple[int, str]:
    """Status and all text of the answer to a request with exactly these headers."""
    lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items())]
    if body:
        lines.append(f"Content-Length: {len(body)}")
    if "Upgrade" not in headers:
        lines.append("Connection: close")
    with socket.create_connection(("127.0.0.1", port), timeout=20) as link:
        link.sendall("\r\n".join([*lines, "", ""]).encode() + body)
        link.settimeout(20)
        answer = b""
        while b"\r\n\r\n" not in answer or "Upgrade" not in headers:
            came = link.recv(65536)
            if not came:
                break
            answer += came
    return int(answer.split()[1]), answer.decode("utf-8", "replace")


def upgraded(port: int, headers: dict[str, str]) -> int:
    """Status of the answer to the page's socket being opened with these headers: 101 where it opens."""
    handshake = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    return asked(port, "/_nicegui_ws/socket.io/?EIO=4&transport=websocket", headers | handshake)[0]
