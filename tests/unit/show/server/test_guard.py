"""Whom the server of `overtaking view` tells nothing, and what it refuses."""

from __future__ import annotations

import hashlib
import http.client
import socket
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.support.serving import Client, branches, get, serving

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.show.server.app import MOST_BYTES
from overtaking.show.server.running import ViewServer

if TYPE_CHECKING:
    from overtaking.data.load import Dataset


PRIVATE = ["/api/start", "/api/runs/0", "/api/runs/0/beliefs", "/api/runs/0/thumbnail"]


@pytest.mark.parametrize("path", PRIVATE)
@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        ({"Cookie": None}, 401),
        ({"Cookie": "overtaking-1=x"}, 401),
        ({"Host": "evil.example"}, 421),
        ({"Host": "127.0.0.1"}, 421),
        ({"Host": None}, 400),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-site"}, 403),
    ],
)
def test_nothing_is_told_to_others(
    client: Client, path: str, wrong: dict[str, str | None], status: int
):
    found, told, _ = client.ask("GET", path, **wrong)
    assert found == status
    assert not isinstance(told, dict) or set(told) == {"error"}


CHANGING = [
    *("/api/rows", "/api/sql", "/api/session"),
    *("/api/runs/0/branches", "/api/runs/0/fan"),
]


@pytest.mark.parametrize("path", CHANGING)
@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        ({"Origin": None}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "https://127.0.0.1"}, 403),
        ({"Content_Type": "text/plain"}, 415),
        ({"Content_Type": "application/x-www-form-urlencoded"}, 415),
        ({"Host": "localhost:1"}, 421),
    ],
)
def test_other_pages_cannot_ask(
    client: Client, path: str, wrong: dict[str, str | None], status: int
):
    assert client.ask("POST", path, {}, **wrong)[0] == status


LONG = ["/api/runs/0/branches", "/api/runs/0/fan"]
MARKUP = "<img src=x onerror=alert(1)>"


@pytest.mark.parametrize("path", LONG)
def test_nothing_is_computed_for_others(client: Client, path: str):
    asked = branches({"frame": 1, "decision": "STAY"}) if "branches" in path else {}
    for wrong, status in (
        ({"Cookie": None}, 401),
        ({"Cookie": "overtaking-1=x"}, 401),
        ({"Host": "evil.example"}, 421),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
    ):
        assert client.ask("POST", path, asked, **wrong)[0] == status
    assert client.ask("GET", path)[0] == 405
    assert client.ask("POST", path, b" " * (MOST_BYTES + 1))[0] == 413
    for number in ("60", "-1", "1e3", "%2e%2e%2fdataset.json", "9" * 5000, "%D9%A1"):
        assert client.ask("POST", path.replace("0", number, 1), asked)[0] == 404


@pytest.mark.parametrize(
    ("path", "asked"),
    [
        ("/api/runs/0/fan", {"policy": MARKUP}),
        ("/api/runs/0/fan", {"condition_on": MARKUP}),
        ("/api/runs/0/branches", branches({"frame": 1, "weather": MARKUP})),
        ("/api/runs/0/branches", branches({"frame": 1, "decision": MARKUP})),
    ],
)
def test_markup_comes_back_as_json_that_no_browser_renders(
    client: Client, path: str, asked: dict[str, Any]
):
    status, told, headers = client.ask("POST", path, asked)
    assert (status, set(told)) == (400, {"error"})
    assert headers["content-type"] == "application/json"
    assert headers["x-content-type-options"] == "nosniff"


def test_the_token_opens_once(data: Dataset):
    with serving(data) as url:
        client = Client(url)
        for token in ("", "x", client.token[:-1], client.token + "é", "x" * 10_000):
            assert client.ask("POST", "/api/session", {"token": token})[0] in (400, 401)
        status, _, headers = client.ask("POST", "/api/session", {"token": client.token})
        assert status == 200
        cookie = str(headers["set-cookie"])
        assert all(part in cookie for part in ("HttpOnly", "SameSite=strict", "Path=/"))
        assert client.token not in cookie
        status, told, _ = client.ask("POST", "/api/session", {"token": client.token})
        assert status == 401
        assert "has been used" in told["error"]


def test_every_answer_forbids_what_the_page_does_not_need(client: Client):
    for path in ("/", "/viewer.js", "/viewer.css", "/api/start", "/api/nothing", "/../etc/passwd"):
        _, _, headers = client.ask("GET", path)
        assert "default-src 'none'" in str(headers["content-security-policy"])
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["access-control-allow-origin"] is None
        assert headers["server"] is None


@pytest.mark.parametrize(
    "path",
    [
        "/api/runs/60",
        "/api/runs/-1",
        "/api/runs/1e3",
        "/api/runs/%2e%2e%2fdataset.json",
        "/api/runs/" + "9" * 5000,
        "/api/runs/%D9%A1",  # A digit, but not one of ours.
        "/api/runs/0/../../start",
        "/dataset.json",
        "/../dataset.json",
    ],
)
def test_there_is_nothing_but_the_simulations(client: Client, path: str):
    line = http.client.HTTPConnection(client.host)
    line.putrequest("GET", path)
    line.putheader("Cookie", client.cookie)
    line.endheaders()
    assert line.getresponse().status in (400, 404)
    line.close()


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"[]",
        b"{",
        b'{"policy": 3}',
        b'{"count": 1000000}',
        b'{"unknown": 1}',
        b'{"margin": {"rule": "L3", "least": NaN}}',
        b'{"classes": ["' + b"x" * 65 + b'"]}',
        b'{"classes": [' + b'"x",' * 100 + b'"x"]}',
        b'{"sql": "' + b"x" * 5000 + b'"}',
        b"[" * 5000,
    ],
)
def test_filters_are_bounded(client: Client, body: bytes):
    status, told, _ = client.ask("POST", "/api/rows", body)
    assert (status, set(told)) == (400, {"error"})
    assert len(told["error"]) < 500


def test_large_bodies_are_refused(client: Client):
    status, _, _ = client.ask("POST", "/api/rows", b" " * (MOST_BYTES + 1))
    assert status == 413


def test_names_with_markup_are_only_names(client: Client):
    told = client.rows(classes=["<script>alert(1)</script>"], weather=["' OR 1=1 --"])
    assert told["found"] == 0


def test_it_listens_on_the_loopback_address_alone(url: str):
    port = int(url.split(":")[2].split("/")[0])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # Nothing is sent; it tells the address of this machine.
        own = probe.getsockname()[0]
    if own.startswith("127."):
        pytest.skip("this machine has no other address")
    with pytest.raises(OSError, match=r"refused|timed out"):
        socket.create_connection((own, port), timeout=5)


def test_a_taken_port_and_an_unknown_policy_are_clear_errors(data: Dataset):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"port {port}: expected one that is free"):
            ViewServer(data, "paper", port)
    with pytest.raises(ConfigError, match="policy"):
        ViewServer(data, "moon", 0)


@pytest.mark.ci
def test_nothing_is_written_into_the_data_set(client: Client, data: Dataset):
    def content() -> dict[str, tuple[str, int]]:
        files = sorted(one for one in Path(data.where).rglob("*") if one.is_file())
        return {
            str(one): (hashlib.sha256(one.read_bytes()).hexdigest(), one.stat().st_mtime_ns)
            for one in files
        }

    before = content()
    client.rows(sql="SELECT simulation FROM safety")
    get(client, "/api/runs/5/thumbnail")
    client.ask("POST", "/api/runs/5/branches", branches({"frame": 3, "decision": "STAY"}))
    client.ask("POST", "/api/runs/5/fan", {})
    assert content() == before


@pytest.mark.ci
def test_a_damaged_data_set_says_so_in_the_list(tmp_path: Path):
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=4, seed=1, out=tmp_path / "data", keep="features"
    )
    file = next((tmp_path / "data" / "findings").iterdir())
    file.write_bytes(file.read_bytes()[:-40])
    with serving(ot.load_dataset(data.where)) as url:
        client = Client(url).enter()
        _, told, _ = client.ask("POST", "/api/rows", {})
        assert "findings" in told["failure"]
