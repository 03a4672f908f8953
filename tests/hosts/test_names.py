"""Claims about the names of pipelines on a network: different ones coexist, equal ones clash."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lodeline.bench.machines import Machine, Wire
from tests.hosts.net import Host, Net
from tests.support.live import eventually


def test_pipelines_of_different_names_share_a_network(net: Net) -> None:
    one = net.file(name="rover", at="one")
    two = net.file(
        name="scout",
        at="two",
        hosts=f"{{robot: {{listen: {net.address}:7448}}, laptop: {{connect: {net.address}:7448}}}}",
    )
    with (
        Host(net.robot, one, "robot"),
        Host(net.robot, two, "robot"),
        Host(net.laptop, one, "laptop") as rover,
        Host(net.laptop, two, "laptop") as scout,
    ):
        assert eventually(lambda: rover.linked("robot") and scout.linked("robot"), 10.0, 0.1)
        assert eventually(lambda: rover.received("watcher", "speed") > 50, 10.0, 0.2)
        assert eventually(lambda: scout.received("watcher", "speed") > 50, 10.0, 0.2)


def test_a_second_laptop_of_the_same_name_is_refused_with_the_first(net: Net) -> None:
    file = net.file()
    with (
        Host(net.robot, file, "robot"),
        Host(net.laptop, file, "laptop") as first,
        Machine() as other,
    ):
        Wire(net.robot, other, 2)
        other.run("ip", "route", "add", "10.213.1.0/24", "via", "10.213.2.1")
        second = Host(other, file, "laptop")
        assert eventually(lambda: first.linked("robot"), 10.0, 0.1)
        with pytest.raises(AssertionError) as refusal:
            second.__enter__()
        assert second.process.returncode == 1
        assert "NAME_TAKEN rover: host 'laptop' of it is up on machine" in str(refusal.value)
        assert f"(pid {first.process.pid} since " in str(refusal.value)
        assert not second.says("watcher")  # nothing was started


BRIDGE = """
import sys
from pathlib import Path
from lodeline.sessions import Gateway, Hub
from lodeline.hosts.links import Link, endpoint
hub = Hub(Path(sys.argv[1]))
line = Gateway(Path(sys.argv[1]), Link(connect=tuple(endpoint(end) for end in sys.argv[2:])))
sys.stdin.read()
line.close()
hub.close()
"""


def test_two_robots_of_one_name_are_told_on_both_when_their_networks_meet(net: Net) -> None:
    """They meet in a machine that has a line to either."""
    with Machine() as third:
        wire = Wire(third, net.laptop, 2)
        ways = f"{{robot: {{listen: {wire.addresses[0]}}}, laptop: {{connect: {net.address}}}}}"
        theirs = net.file(at="two", hosts=ways)
        with Host(net.robot, net.file(), "robot") as robot, Host(third, theirs, "robot") as rival:
            bridge = subprocess.Popen(
                net.laptop.command(
                    sys.executable, "-c", BRIDGE, str(net.folder), net.address, wire.addresses[0]
                ),
                stdin=subprocess.PIPE,
            )
            taken = "NAME_TAKEN rover: host 'robot' of it is up on machine"
            # The bridge's own start is in it.
            assert eventually(lambda: robot.says(taken) and rival.says(taken), 2.0)
            faults = robot.links()["robot"]["faults"]
            assert len(faults) == 1 and f"(pid {rival.process.pid} since " in faults[0]
            bridge.communicate()
