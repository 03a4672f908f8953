"""Claims about who may talk to the gateway: foreign pages, foreign names, wrong tokens."""

from __future__ import annotations

import asyncio
import http.client
import socket
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from lodeline.run_folder import running
from tests.dash.support import Dash, Ear, Reader, connecting, with_reader
from tests.support.live import ROOT, Up, eventually, lodeline


def get(dash: Dash, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of a request; `Host` may be any."""
    method = headers.pop("method", "GET")
    line = http.client.HTTPConnection("127.0.0.1", dash.port, timeout=10)
    line.putrequest(method, path, skip_host="Host" in headers)
    for name, value in headers.items():
        line.putheader(name, value)
    line.endheaders()
    answer = line.getresponse()
    body = answer.read()
    line.close()
    return answer.status, dict(answer.getheaders()), body


def opens(dash: Dash, **options: object) -> int:
    """Status of the answer to a WebSocket request: 101 if it is let in."""

    async def run() -> int:
        try:
            async with connecting(dash.port, **options):
                return 101
        except InvalidStatus as error:
            return error.response.status_code

    return asyncio.run(run())


def test_it_listens_on_loopback_only(dash: Dash) -> None:
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A"]
    assert f"0100007F:{dash.port:04X}" in listening
    assert [place for place in listening if place.endswith(f":{dash.port:04X}")] == [
        f"0100007F:{dash.port:04X}"
    ]


@pytest.mark.parametrize("path", ["/", "/main.js", "/page.css", "/icon.svg"])
def test_files_come_with_a_strict_policy_and_no_cors(dash: Dash, path: str) -> None:
    status, headers, body = get(dash, path)
    assert status == 200
    assert body
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["X-Frame-Options"] == "DENY"
    assert not [name for name in headers if name.lower().startswith("access-control")]


@pytest.mark.parametrize(
    "path", ["/../web.py", "/..%2fweb.py", "/web.py", "/page/main.js", "//etc/passwd", "/nothing"]
)
def test_nothing_but_the_page_is_served(dash: Dash, path: str) -> None:
    assert get(dash, path)[0] == 404


def test_no_file_asks_for_anything_from_elsewhere(dash: Dash) -> None:
    names = [file.name for file in (ROOT / "lodeline/dash/page").iterdir()]
    assert len(names) >= 15
    for name in ["", *names]:
        text = get(dash, f"/{name}")[2].decode()
        assert "https:" not in text, name
        assert "http:" not in text.replace("http://www.w3.org/2000/svg", ""), name


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", ""])
def test_another_host_name_is_refused(dash: Dash, host: str) -> None:
    assert get(dash, "/", Host=host)[0] == 403
    origin = f"http://{host}"
    assert opens(dash, additional_headers={"Host": host}, origin=origin) in (400, 403)


def test_names_of_this_machine_are_taken_at_any_port_for_tunnels(dash: Dash) -> None:
    for host in (f"127.0.0.1:{dash.port}", "localhost:9999", "[::1]:1234", "localhost"):
        assert get(dash, "/", Host=host)[0] == 200, host


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://localhost:1", None])
def test_a_foreign_origin_is_refused(dash: Dash, origin: str | None) -> None:
    assert opens(dash, origin=origin) == 403
    if origin is not None:
        assert get(dash, "/", Origin=origin)[0] == 403


def test_our_own_page_is_let_in(dash: Dash) -> None:
    assert opens(dash) == 101


def test_only_get_is_answered(dash: Dash) -> None:
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert get(dash, "/", method=method)[0] == 405, method


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("x" * 70_000, 1009),
        ("no json", 1008),
        ("[1]", 1008),
        ('{"do":"drive","forward":1,"left":0}', 1008),
        ('{"ack":"1"}', 1008),
        ("[" * 10_000, 1008),
    ],
    ids=["too long", "no json", "a list", "before hello", "a word for a number", "deep"],
)
def test_what_no_page_would_say_ends_the_connection(dash: Dash, text: str, code: int) -> None:
    async def run() -> int | None:
        async with connecting(dash.port) as line:
            await line.send(text)
            try:
                while True:
                    await asyncio.wait_for(line.recv(), 5.0)
            except ConnectionClosed as error:
                return error.rcvd.code if error.rcvd else None

    assert asyncio.run(run()) == code


@pytest.mark.parametrize(
    "values",
    [{"forward": "1", "left": 0}, {"forward": True, "left": 0}, {"forward": 1}],
    ids=["text", "a truth", "missing"],
)
def test_a_command_that_is_no_number_ends_the_connection(
    dash: Dash, values: dict[str, object]
) -> None:
    async def talk(reader: Reader) -> bool:
        await reader.hear("hello")
        await reader.say(do="drive", **values)
        try:
            await reader.hear("never", 5.0)
        except ConnectionClosed as error:
            return error.rcvd is not None and error.rcvd.code == 1008
        return False

    assert with_reader(dash.port, talk, dash.token)


@pytest.mark.parametrize("token", ["", "guess", None, 7, "é"])
def test_a_wrong_token_watches_but_does_not_drive(up: Up, dash: Dash, token: object) -> None:
    ear = Ear(up, "cmd_vel")

    async def talk(reader: Reader) -> tuple[bool, str]:
        trusted = (await reader.hear("hello"))["trusted"]
        await reader.hear("frame")
        await reader.say(do="restart", node="ekf")
        await reader.say(do="drive", forward=1.0, left=0.0)
        said = await reader.hear("note")
        while not said["text"].startswith("refused"):
            said = await reader.hear("note")
        await reader.hear("frame")
        return trusted, said["text"]

    before = up.ps()["ekf"]["pid"]
    trusted, words = with_reader(dash.port, talk, token)  # type: ignore[arg-type]
    assert trusted is False
    assert words.startswith("refused")
    assert ear.all("cmd_vel") == {}
    assert up.ps()["ekf"]["pid"] == before
    ear.close()


def test_the_token_never_stands_where_servers_see_it(dash: Dash) -> None:
    assert len(dash.token) >= 32
    assert dash.url.index("#") < dash.url.index(dash.token)


def test_without_a_pipeline_dash_says_so_with_exit_4(up: Up) -> None:
    result = lodeline("dash", "--name", "nobody", run=up.run)
    assert result.returncode == 4
    assert "nobody" in result.stderr
    assert result.stdout == ""


def test_a_taken_port_is_exit_1_and_a_bound_is_exit_0(up: Up, dash: Dash) -> None:
    assert lodeline("dash", "--port", str(dash.port), run=up.run).returncode == 1
    result = lodeline("dash", "--seconds", "0", run=up.run)
    assert result.returncode == 0
    assert result.stdout.startswith("http://127.0.0.1:")


def test_ctrl_c_is_exit_130_and_frees_the_port(up: Up) -> None:
    dash = Dash(up)
    dash.process.send_signal(2)
    assert dash.process.wait(10.0) == 130
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", dash.port)) != 0
    assert eventually(lambda: len(running(base=up.run)) == 1)
