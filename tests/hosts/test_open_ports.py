"""Claims about open ports: none but the one that the file names, and no multicast unasked."""

from __future__ import annotations

import subprocess

import pytest

from lodeline.bench.machines import Machine
from tests.hosts.net import Host, Net
from tests.support.live import eventually


def sockets(machine: Machine) -> set[tuple[str, str]]:
    """(protocol, local address) of all listening TCP and all UDP sockets of a machine."""
    lines = machine.run("ss", "-H", "-l", "-n", "-t", "-u").splitlines()
    return {(line.split()[0], line.split()[4]) for line in lines}


def test_only_the_address_of_listen_is_open(net: Net) -> None:
    with Host(net.robot, net.file(), "robot") as robot, Host(net.laptop, net.file(), "laptop"):
        assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
        assert sockets(net.robot) == {("tcp", f"{net.address}:7447")}
        assert sockets(net.laptop) == set()


def test_one_machine_that_plays_all_hosts_opens_nothing(net: Net) -> None:
    everything = Host(net.robot, net.file(), "robot")
    everything._command = everything._command[:-2]
    with everything:
        assert sockets(net.robot) == set()


def test_hosts_find_each_other_by_multicast_only_if_both_say_so(net: Net) -> None:
    file = net.file(
        hosts=f"{{robot: {{listen: {net.address}, scout: true}}, laptop: {{scout: true}}}}"
    )
    with Host(net.robot, file, "robot") as robot, Host(net.laptop, file, "laptop") as laptop:
        assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
        assert eventually(lambda: laptop.received("watcher", "speed") > 100, 10.0, 0.2)
        assert robot.says("scouts: it links with whoever answers")


def test_a_taken_port_is_named_before_anything_starts(net: Net) -> None:
    program = f"import socket; s = socket.create_server(('{net.address}', 7447)); print(); input()"
    holder = subprocess.Popen(
        net.robot.command("python3", "-c", program), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout is not None and holder.stdin is not None
    holder.stdout.readline()
    robot = Host(net.robot, net.file(), "robot")
    with pytest.raises(AssertionError, match=r"cannot listen on tcp/10.213.1.1:7447: Address"):
        robot.__enter__()
    holder.stdin.close()
    holder.wait()
    assert robot.process.returncode == 1


def test_a_robot_listens_as_soon_as_its_address_is_there(net: Net) -> None:
    net.robot.run("ip", "addr", "del", f"{net.address}/24", "dev", "w1a")
    with Host(net.robot, net.file(), "robot") as robot:
        assert sockets(net.robot) == set()
        net.robot.run("ip", "addr", "add", f"{net.address}/24", "dev", "w1a")
        with Host(net.laptop, net.file(), "laptop"):
            assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
