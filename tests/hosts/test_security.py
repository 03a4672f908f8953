"""Claims about who may link and what they may say: mutual TLS, and rights from the pipeline."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lodeline.hosts import certificates
from lodeline.hosts.certificates import KeysError
from lodeline.sessions import Client
from lodeline.watch import Watch
from tests.dash.support import Dash, Reader, with_reader
from tests.hosts.net import Host, Net
from tests.support.live import ROOT, eventually

LIFE_S = 10.0

SENSORS = """
name: rover
hosts: {{robot: {{listen: {address}}}, laptop: {{connect: {address}, grant: [cmd_vel, calibrate]}}}}
tls: {keys}
external: {{cmd_vel: Twist}}
nodes:
  simulator: {{run: {root}/nodes/simulator.py, inputs: {{cmd_vel: cmd_vel}},
              outputs: {{truth: truth}}, params: {{rate: 50, robot: {{standing: 300}}}}}}
  imu: {{run: {root}/nodes/imu.py, outputs: {{data_raw: imu/data_raw}},
        params: {{bus: sim, rate: 100}}}}
  calibrate: {{run: {root}/nodes/calibrate.py, inputs: {{data_raw: imu/data_raw}},
              outputs: {{data: imu/data}}}}
"""

# Speaks for itself: any certificate, any keys.
STRANGER = """
import json, sys, time
import zenoh
config = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
try:
    session = zenoh.open(config)
except zenoh.ZError:
    sys.exit("refused")
heard = []
session.declare_subscriber(
    "rover/**",
    lambda sample: heard.append(str(sample.key_expr)),
    allowed_origin=zenoh.Locality.REMOTE,
)
end = time.monotonic() + 2.0
while time.monotonic() < end:
    for key in sys.argv[2:]:
        session.put(key, b"forged")
    time.sleep(0.05)
print(len(heard))
session.close()
"""


def stranger(net: Net, keys: Path | None, name: str, *puts: str, **more: object) -> str:
    """What became of one who connects from the laptop's machine and sends on some keys."""
    settings: dict[str, object] = {
        "mode": "client",
        "scouting/multicast/enabled": False,
        "connect/timeout_ms": 2000,
        "connect/endpoints": [f"{'tls' if keys else 'tcp'}/{net.address}:7447"],
    } | more
    if keys:
        settings["transport/link/tls"] = {
            "root_ca_certificate": str(keys / "ca.pem"),
            "enable_mtls": True,
            "connect_certificate": str(keys / f"{name}.pem"),
            "connect_private_key": str(keys / f"{name}.key"),
        }
    command = net.laptop.command(sys.executable, "-c", STRANGER, json.dumps(settings), *puts)
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.stderr.strip().splitlines()[-1] if done.returncode else done.stdout.strip()


def test_over_tls_all_is_as_without(net: Net, keys: Path) -> None:
    file = net.file(more=f"tls: {keys}")
    with Host(net.robot, file, "robot") as robot, Host(net.laptop, file, "laptop") as laptop:
        assert eventually(lambda: robot.linked("laptop") and laptop.linked("robot"), 10.0, 0.1)
        assert eventually(lambda: laptop.received("watcher", "speed") > 100, 10.0, 0.2)
        assert eventually(lambda: robot.received("watcher", "speed") > 100, 10.0, 0.2)
        assert set(robot.reports()) == set(laptop.reports()) == {"robot", "laptop"}
        assert not robot.says("without tls")
        refused = laptop.call("restart", "source")
        assert refused.returncode == 1
        assert "source is on robot, and tools on laptop may not restart over tls" in refused.stderr
        assert "write `grant: [restart]` for laptop" in refused.stderr
        refused = laptop.call("topic", "pub", "cmd_vel", "{v: 0.1}")
        assert refused.returncode == 1
        assert "write `grant: [cmd_vel]` for laptop" in refused.stderr
        page = Dash(laptop)

        async def drives(reader: Reader) -> str:
            await reader.hear("frame")
            await reader.say(do="drive", forward=1.0, left=0.0)
            return str((await reader.hear("note"))["text"])

        said = with_reader(page.port, drives, page.token)
        page.stop()
        assert "may not send cmd_vel over tls: write `grant: [cmd_vel]` for laptop" in said


def test_strangers_do_not_link_and_hosts_say_only_what_is_theirs(
    net: Net, keys: Path, tmp_path: Path
) -> None:
    hosts = f"{{robot: {{listen: {net.address}}}, laptop: {{connect: {net.address}}}}}"
    file = net.file(more=f"tls: {keys}", hosts=hosts)
    foreign = tmp_path / "foreign"
    certificates.init(foreign)
    certificates.add(foreign, "laptop")
    (foreign / "ca.pem").write_bytes((keys / "ca.pem").read_bytes())
    certificates.add(keys, "tablet")
    with Host(net.robot, file, "robot") as robot:
        client = Client(robot.folder)
        forged: set[str] = set()
        client.subscribe(
            "rover/**", 256, lambda key, data, _: forged.add(key) if data == b"forged" else None
        )
        keys_of_others = ("rover/wheels", "rover/status/source", "rover/cmd_vel")
        who = ((None, ""), (foreign, "laptop"), (keys, "tablet"))
        with ThreadPoolExecutor() as all_at_once:
            plain, faked, tablet = all_at_once.map(
                lambda each: stranger(net, *each, *keys_of_others), who
            )
        assert plain == "refused"
        assert faked == "refused"
        assert tablet == "0"  # in the fleet, but no host of this pipeline: it hears nothing
        assert forged == set()
        own = "rover/status/watcher"
        # A laptop that was made a bridge: one without a certificate sends through it.
        port = f"tcp/{net.wire.addresses[1]}:7448"
        bridge: dict[str, object] = {"mode": "router", "listen/endpoints": [port]}
        guest: dict[str, object] = {"connect/endpoints": [port], "connect/timeout_ms": -1}
        with ThreadPoolExecutor() as both:
            bridged = both.submit(stranger, net, keys, "laptop", own, *keys_of_others, **bridge)
            through = both.submit(stranger, net, None, "", *keys_of_others, **guest)
        assert int(bridged.result()) > 50
        assert int(through.result()) > 20  # what the laptop may hear, its guests hear
        assert forged == {own}
        client.close()


def test_an_order_is_taken_only_where_the_ordered_host_grants_it(net: Net, keys: Path) -> None:
    way = f"connect: {net.address}, grant: [restart]"
    hosts = f"{{robot: {{listen: {net.address}}}, laptop: {{{way}}}}}"
    granted = net.file(more=f"tls: {keys}", hosts=hosts)
    bare = net.file(more=f"tls: {keys}", at="two")
    with Host(net.laptop, granted, "laptop") as laptop:
        with Host(net.robot, bare, "robot") as robot:
            assert eventually(lambda: laptop.linked("robot"), 10.0, 0.1)
            result = laptop.call("restart", "source")
            assert result.returncode == 1
            assert "is robot linked (`lodeline doctor net`), and does the file" in result.stderr
            assert robot.call("restart", "source").returncode == 0  # its own tools may
            before = restarts(robot)
            assert before == 1
        with Host(net.robot, granted, "robot") as robot:
            assert eventually(lambda: laptop.linked("robot"), 10.0, 0.1)
            result = laptop.call("restart", "source")
            assert (result.returncode, result.stdout) == (0, "source: restarting\n")
            assert eventually(lambda: restarts(robot) == 1, 5.0, 0.1)


def test_tools_with_a_grant_drive_the_robot_and_calibrate_its_sensor(
    net: Net, keys: Path, tmp_path: Path
) -> None:
    file = tmp_path / "pipeline.yaml"
    file.write_text(SENSORS.format(root=ROOT, address=net.address, keys=keys))
    out = tmp_path / "gyro.yaml"
    command = ("calibrate", "gyro", "--seconds", "2.1", "-o", str(out))
    with (
        Host(net.robot, file, "robot") as robot,
        Host(net.laptop, file, "laptop") as laptop,
        Watch(robot.running) as watch,
    ):
        heard: list[bytes] = []
        watch.subscribe("rover/cmd_vel", 64, lambda _key, data, _: heard.append(data))
        assert eventually(lambda: laptop.linked("robot"), 10.0, 0.1)
        laptop.call("topic", "pub", "cmd_vel", "v=0", "w=0", "--rate", "50", "-n", "5")
        assert eventually(lambda: len(heard) == 5, 2.0)
        done = laptop.call(*command)
        assert done.returncode == 0, done.stderr
        assert "calibrate goes by it now, until it is started again" in done.stdout
        said = laptop.call("topic", "echo", "imu/data", "-n", "20", "--json", "--timeout", "5")
        rates = [json.loads(line)["angular_velocity"] for line in said.stdout.splitlines()]
        assert [sum(axis) / 20 for axis in zip(*rates, strict=True)] == pytest.approx(
            [0.0] * 3, abs=2e-3
        )


def restarts(host: Host) -> int:
    """How often the source was started again."""
    (found,) = [item for item in host.reports()["robot"]["processes"] if "source" in item["nodes"]]
    return int(found["restarts"])


def test_a_link_ends_with_its_certificate(net: Net, keys: Path) -> None:
    file = net.file(more=f"tls: {keys}")
    with Host(net.robot, file, "robot") as robot:
        (keys / "laptop.pem").unlink()
        (keys / "laptop.key").unlink()
        certificates.add(keys, "laptop", days=LIFE_S / 86400)
        with Host(net.laptop, file, "laptop") as laptop:
            assert laptop.says("TLS laptop.pem expires in 0 days")
            assert eventually(lambda: robot.linked("laptop"), LIFE_S, 0.1)
            end = certificates.read(keys / "laptop.pem").not_valid_after_utc.timestamp()
            assert eventually(lambda: robot.says("LINK_LOST laptop"), 2.0 * LIFE_S, 0.1)
            assert -1.0 < time.time() - end < 6.0, "not before, and a lease later at most"
            place = f"{net.address}:7447"
            ours = (
                f"LINK_REFUSED {place}: it says that our certificate is not valid today: `lodeline"
            )
            assert eventually(lambda: laptop.says(ours), 5.0, 0.1)
            assert robot.says("LINK_REFUSED who connects here: its certificate has expired: `lode")
            assert "LINK_REFUSED 10.213.1.1:7447: it says" in laptop.call("ps").stdout
            seen = laptop.call("doctor", "net")
            assert "FAIL  link of laptop: refused: 10.213.1.1:7447: it says that our" in seen.stdout
            assert not eventually(lambda: robot.linked("laptop"), 1.0, 0.2)
        with pytest.raises(AssertionError, match=r"TLS laptop.pem expired 20\d\d"):
            Host(net.laptop, file, "laptop").__enter__()
        assert robot.process.poll() is None


def test_up_names_what_is_wrong_with_a_certificate(keys: Path, tmp_path: Path) -> None:
    assert certificates.check(keys, "robot", "10.213.1.1") == []
    with pytest.raises(KeysError, match=r"robot.pem is not for 10.0.0.9: run `lodeline keys add"):
        certificates.check(keys, "robot", "10.0.0.9")
    with pytest.raises(KeysError, match=r"run `lodeline keys add tablet`"):
        certificates.check(keys, "tablet")
    certificates.add(keys, "old", days=-0.5)
    with pytest.raises(KeysError, match=r"TLS old.pem expired 20\d\d-\d\d-\d\d"):
        certificates.check(keys, "old")
    (keys / "old.pem").write_bytes((keys / "laptop.pem").read_bytes())
    with pytest.raises(
        KeysError, match=r"old.pem is of host 'laptop': run `lodeline keys add old`"
    ):
        certificates.check(keys, "old")
    certificates.add(keys, "aging", days=3.5)
    assert certificates.check(keys, "aging") == ["TLS aging.pem expires in 3 days"]
    foreign = tmp_path / "foreign"
    certificates.init(foreign)
    certificates.add(foreign, "laptop")
    (foreign / "ca.pem").write_bytes((keys / "ca.pem").read_bytes())
    with pytest.raises(KeysError, match="was not made by the authority in"):
        certificates.check(foreign, "laptop")


def test_keys_are_for_their_owner_only(keys: Path) -> None:
    for file in keys.glob("*.key"):
        assert file.stat().st_mode & 0o077 == 0
    with pytest.raises(KeysError, match="has an authority already"):
        certificates.init(keys)
    (keys / "ca.key").unlink()
    with pytest.raises(KeysError, match="hosts are added where it is kept"):
        certificates.add(keys, "tablet")
