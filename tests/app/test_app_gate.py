"""Who may reach the page: raw requests as another site's page makes them, to pages, files, polling and the socket."""

from __future__ import annotations

import re

import pytest

from page_server import asked, served, upgraded
from swingid.app.gate import HEADERS, Place, host_of
from swingid.app.server import free_port
from swingid.errors import UsageError

for package in ("cantools", "cobs", "fastcrc", "mcap"):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'swingid[live]'")

TOKEN = "s3cret word"
POLLING = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"


def port_of(address: str) -> int:
    return int(re.search(r":(\d+)/", address)[1])


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    with served("--rig", "paper", "--folder", str(tmp_path_factory.mktemp("local"))) as (address, _):
        yield port_of(address)


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    folder = str(tmp_path_factory.mktemp("wide"))
    arguments = ("--rig", "paper", "--folder", folder, "--host", "0.0.0.0", "--allow-host", "rig.lab.example")
    with served(*arguments, SWINGID_TOKEN=TOKEN) as (address, _):
        yield port_of(address)


def framed(answer: str) -> bool:
    """Whether a page of another site may show this answer in a frame."""
    return not all(f"{name.decode()}: {value.decode()}".lower() in answer.lower() for name, value in HEADERS[:2])


FOREIGN_HOSTS = (
    "evil.example",
    "evil.example:{port}",
    "localhost.evil.example:{port}",
    "127.0.0.1.evil.example",
    "localhost:{port}.evil.example",
    "evil@localhost:{port}",
    "10.1.2.3:{port}",
    "",
)


@pytest.mark.parametrize("host", FOREIGN_HOSTS)
def test_a_foreign_name_of_this_machine_reaches_nothing(local, host):
    name = host.format(port=local)
    own = {"Host": name, "Origin": f"http://{name}"}
    for path in ("/", POLLING, "/favicon.ico", "/swingid/vendor/uPlot.min.css"):
        assert asked(local, path, {"Host": name})[0] in (400, 403), path
    assert asked(local, POLLING, own, "POST", b"40")[0] in (400, 403)
    assert upgraded(local, own) in (400, 403)


FOREIGN_ORIGINS = ("http://evil.example", "null", "http://127.0.0.1:1", "http://localhost:{port}.evil.example", "")


@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_a_page_of_another_site_reaches_nothing(local, origin):
    headers = {"Host": f"127.0.0.1:{local}", "Origin": origin.format(port=local)}
    assert asked(local, POLLING, headers)[0] == 403
    assert asked(local, POLLING, headers, "POST", b"40")[0] == 403
    assert asked(local, "/", headers, "OPTIONS")[0] == 403
    assert upgraded(local, headers) == 403


def test_what_acts_says_where_it_comes_from(local):
    host = {"Host": f"127.0.0.1:{local}"}
    assert upgraded(local, host) == 403
    assert asked(local, POLLING, host, "POST", b"40")[0] == 403


def test_a_page_of_another_site_cannot_load_parts_of_this_one(local):
    host = {"Host": f"localhost:{local}"}
    for site in ("cross-site", "same-site"):
        assert asked(local, "/", host | {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"})[0] == 403
        assert asked(local, "/", host | {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate"})[0] == 200  # a link


@pytest.mark.parametrize(
    "host", ["127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:{port}", "[::1]:{port}", "localhost:9"]
)
def test_own_names_reach_all(local, host):
    """Also where ssh leads another port here."""
    name = host.format(port=local)
    own = {"Host": name, "Origin": f"http://{name}"}
    status, answer = asked(local, "/", {"Host": name})
    assert status == 200
    assert not framed(answer)
    assert "referrer-policy: no-referrer" in answer.lower()
    status, answer = asked(local, POLLING, own)
    assert status == 200
    assert not framed(answer)
    assert upgraded(local, own) == 101


def test_a_body_that_is_too_large_or_of_no_stated_length_is_refused(local):
    own = {"Host": f"127.0.0.1:{local}", "Origin": f"http://127.0.0.1:{local}"}
    for more in ({"Content-Length": "99999999999"}, {"Content-Length": "1e3"}, {"Transfer-Encoding": "chunked"}):
        status, answer = asked(local, "/_nicegui/client/1/upload/1", own | more, "POST")
        assert status in (400, 413), more
        assert "bug" not in answer


def test_no_answer_may_be_framed(local):
    own = {"Host": f"127.0.0.1:{local}"}
    for path, headers in (("/", own), ("/nothing", own), ("/favicon.ico", own), ("/", {"Host": "evil.example"})):
        assert not framed(asked(local, path, headers)[1]), path
    assert "access-control-allow-origin: *" not in asked(local, POLLING, own)[1].lower()


def test_a_refusal_is_one_sentence(local):
    answer = asked(local, "/", {"Host": "evil.example"})[1]
    assert answer.partition("\r\n\r\n")[2].strip().startswith("This address is not one of this page: open the one")


def test_the_token_guards_the_socket(wide):
    name = f"127.0.0.1:{wide}"
    own = {"Host": name, "Origin": f"http://{name}"}
    assert asked(wide, "/", {"Host": name})[0] == 403
    assert asked(wide, POLLING, own)[0] == 403
    assert asked(wide, POLLING, own, "POST", b"40")[0] == 403
    assert upgraded(wide, own) == 403
    for wrong in ("s3cret", "", "S3CRET WORD", "x" * 10_000):
        assert asked(wide, f"/?token={wrong}".replace(" ", "%20"), {"Host": name})[0] == 403
        assert upgraded(wide, own | {"Cookie": f"swingid_token_{wide}={wrong}; swingid_token={wrong}"}) == 403

    status, answer = asked(wide, "/?a=1&token=s3cret%20word", {"Host": name})
    assert status == 303
    assert not framed(answer)
    assert re.search(r"(?i)location: /\?a=1\r", answer)  # the address without the token
    cookie = re.search(r"(?i)set-cookie: ([^;]*)", answer)[1]
    assert "s3cret" not in cookie
    assert asked(wide, "/", {"Host": name, "Cookie": cookie})[0] == 200
    assert upgraded(wide, own | {"Cookie": cookie}) == 101
    # who has it stolen cannot use it from another site
    assert upgraded(wide, own | {"Cookie": cookie, "Origin": "http://evil.example"}) == 403
    assert upgraded(wide, {"Host": "evil.example", "Origin": "http://evil.example", "Cookie": cookie}) == 403


def test_the_way_of_the_token_leads_to_no_other_host(wide):
    answer = asked(wide, "//evil.example/?token=s3cret%20word", {"Host": f"localhost:{wide}"})[1]
    where = re.search(r"(?i)location: (\S+)", answer)[1]
    assert re.match(r"/[^/\\]", where), where


def test_names_of_this_machine_and_further_ones(wide):
    for name in ("rig.lab.example", f"localhost:{wide}"):
        assert asked(wide, "/?token=s3cret%20word", {"Host": name})[0] == 303
    assert asked(wide, "/?token=s3cret%20word", {"Host": "evil.example"})[0] == 403


@pytest.mark.parametrize(
    ("authority", "host"),
    [
        ("localhost", "localhost"),
        ("localhost:8080", "localhost"),
        ("[::1]:8080", "[::1]"),
        ("[::1]", "[::1]"),
        ("::1", None),
        (":8080", None),
        ("", None),
        ("a:b", None),
        ("a:", "a"),
        ("a:8080.b", None),
        ("a:\u0661", None),
    ],
)
def test_the_host_of_a_request(authority, host):
    assert host_of(authority) == host


def test_names_are_compared_in_one_spelling():
    place = Place("RigPC.lab.example", 8080)
    for name in ("rigpc.LAB.example.", "127.0.0.1", "[0:0:0:0:0:0:0:1]", "localhost."):
        assert place.is_ours(name), name
    for name in ("rigpc", "lab.example", "127.0.0.2", "0.0.0.0", ""):
        assert not place.is_ours(name), name


@pytest.mark.parametrize("host", ["203.0.113.7", "no such host"])
def test_a_host_that_is_not_this_machine_is_said(host):
    with pytest.raises(UsageError, match=rf"^--host {host} is no address of this machine .* give one of its own"):
        free_port(host, 8080)
