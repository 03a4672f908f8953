"""Claims about links that are refused: both sides say why, and what to do."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from lodeline.hosts import certificates
from lodeline.hosts.refusals import AGAIN_S, FRESH_S, Refusals, refusal
from tests.hosts.net import hosts_at, write_file

# Gateways of a robot and of a laptop, both in one process: what it is told goes to standard error.
BOTH = """
import json, shutil, sys, tempfile, time
from pathlib import Path
from lodeline.bus import overhear_links
from lodeline.sessions import Gateway, Hub
from lodeline.hosts.links import link_of
from lodeline.hosts.refusals import Refusals
from lodeline.pipeline.load import load
said = []
overhear_links(Refusals(said.append).take)
sides, runs = [], []
for host, folder in (("robot", sys.argv[1]), ("laptop", sys.argv[2])):
    run = Path(tempfile.mkdtemp(prefix="ll"))
    runs.append(run)
    sides += [Hub(run), Gateway(run, link_of(load(Path(folder) / "pipeline.yaml"), host))]
end = time.monotonic() + 5.0
while len(said) < int(sys.argv[3]) and time.monotonic() < end:
    time.sleep(0.02)
print(json.dumps(said), file=sys.stderr, flush=True)
for side in reversed(sides):
    side.close()
for run in runs:
    shutil.rmtree(run)
"""


@pytest.fixture
def port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def heard(folder: Path, port: int, tls: Sequence[bool], count: int) -> set[str]:
    """What both sides say, whose files are in `robot` and `laptop`, until it is so much."""
    for side, secured in zip(("robot", "laptop"), tls, strict=True):
        more = f"tls: {folder / side}" if secured else ""
        hosts = hosts_at(f"127.0.0.1:{port}")
        write_file(folder / side, hosts, name="rover", watcher="laptop", more=more)
    places = [str(folder / side) for side in ("robot", "laptop")]
    done = subprocess.run(
        [sys.executable, "-c", BOTH, *places, str(count)],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said: list[str] = json.loads(done.stderr.splitlines()[-1])
    return set(said)


@pytest.fixture
def sides(keys: Path) -> Path:
    """A folder of keys for either side, of one authority."""
    laptop = keys.with_name("laptop")
    laptop.mkdir()
    for name in ("ca.pem", "laptop.pem", "laptop.key"):
        (laptop / name).write_bytes((keys / name).read_bytes())
    keys.rename(keys.with_name("robot"))
    return keys.parent


def test_an_expired_certificate_is_named_on_both_sides(sides: Path, port: int) -> None:
    certificates.add(sides / "robot", "robot", ["127.0.0.1"], days=-0.5)
    assert heard(sides, port, (True, True), 2) == {
        f"LINK_REFUSED 127.0.0.1:{port}: its certificate has expired: `lodeline keys add` for that "
        "host, and start it again with the new files",
        "LINK_REFUSED who connects here: it says that our certificate is not valid today: "
        "`lodeline keys add` for this host, and look at the clock there",
    }


def test_another_authority_is_named_on_both_sides(sides: Path, port: int) -> None:
    for file in (sides / "laptop").iterdir():
        file.unlink()
    certificates.init(sides / "laptop")
    certificates.add(sides / "laptop", "laptop")
    assert heard(sides, port, (True, True), 2) == {
        f"LINK_REFUSED 127.0.0.1:{port}: its certificate is of another authority than ca.pem here: "
        "give both hosts ca.pem and keys of one authority",
        "LINK_REFUSED who connects here: it knows another authority than the one of our "
        "certificate: if it is a host of this file, give both hosts ca.pem and keys of one "
        "authority",
    }


def test_a_certificate_for_another_address_is_named_on_both_sides(sides: Path, port: int) -> None:
    certificates.add(sides / "robot", "robot", ["10.0.0.1"])
    said = sorted(heard(sides, port, (True, True), 2))
    assert f"127.0.0.1:{port}: its certificate is not for this address" in said[0]
    assert "connects here: it says that our certificate is not for the address" in said[1]


def test_a_side_without_tls_is_named_on_both_sides(sides: Path, port: int) -> None:
    said = sorted(heard(sides, port, (True, False), 2))
    assert f"127.0.0.1:{port}: it hangs up on who speaks without tls" in said[0]
    assert (
        "who connects here: it speaks without tls: if it is a host of this file, write `tls:` in"
        in said[1]
    )


def test_a_reason_is_told_when_repeated_then_once_a_minute_and_ends_with_its_cause() -> None:
    line = "unicast: invalid peer certificate: certificate expired: verification time 1"
    said: list[str] = []
    now = [0.0]
    refusals = Refusals(said.append, lambda: now[0])
    refusals.take(line)
    assert said == []  # once is chance
    for now[0] in (0.5, 1.0, AGAIN_S - 1.0, AGAIN_S, AGAIN_S + 0.6):
        refusals.take(line)
    assert len(said) == 2
    assert refusals.current() == refusal(line)
    now[0] += FRESH_S + 0.1
    assert refusals.current() is None
    assert refusal("orchestrator: Successfully connected to configured peer") is None


def test_who_answers_multicast_and_does_not_link_is_named_by_its_address() -> None:
    line = "Unable to connect to any locator of scouted peer a24a85: [tls/10.213.1.1:7447]"
    said: list[str] = []
    refusals = Refusals(said.append, iter((0.0, 1.0)).__next__)
    refusals.take(line)
    refusals.take(line)
    assert said == [
        "LINK_REFUSED 10.213.1.1:7447: it answers multicast, but there is no link with it: "
        "if it is a host of this file, compare `tls:` and the keys of both"
    ]
