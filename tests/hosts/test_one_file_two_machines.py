"""Claims about one pipeline file on two machines: any order, any side, the same picture."""

from __future__ import annotations

import pytest

from tests.hosts.net import Host, Net, hosts_at
from tests.support.live import ROOT, eventually


def processes(host: Host) -> dict[str, dict[str, str]]:
    """State of each process by host, as `lodeline ps` shows it there."""
    return {
        name: {process["process"]: process["state"] for process in report["processes"]}
        for name, report in host.reports().items()
    }


@pytest.mark.parametrize("order", [("robot", "laptop"), ("laptop", "robot")])
def test_both_see_the_same_in_whatever_order_they_start(net: Net, order: tuple[str, str]) -> None:
    file = net.file()
    machines = {"robot": net.robot, "laptop": net.laptop}
    with (
        Host(machines[order[0]], file, order[0]) as first,
        Host(machines[order[1]], file, order[1]) as second,
    ):
        whole = {
            "robot": {"source": "running", "smoother": "running"},
            "laptop": {"watcher": "running"},
        }
        assert eventually(lambda: processes(first) == whole == processes(second), 10.0, 0.1)
        assert first.linked(order[1]) and second.linked(order[0])
        assert eventually(lambda: first.received("watcher", "speed") > 100, 10.0, 0.2)
        assert eventually(lambda: second.received("watcher", "speed") > 100, 10.0, 0.2)
        assert list(first.reports()) == list(second.reports()) == ["laptop", "robot"]


def test_one_word_moves_a_node_to_the_other_side(net: Net) -> None:
    file = net.file(watcher="robot")
    with Host(net.robot, file, "robot"), Host(net.laptop, file, "laptop") as laptop:
        whole = {
            "robot": {"source": "running", "smoother": "running", "watcher": "running"},
            "laptop": {},
        }
        assert eventually(lambda: processes(laptop) == whole, 10.0, 0.1)
        assert eventually(lambda: laptop.received("watcher", "speed") > 100, 10.0, 0.2)
        sample = laptop.call("topic", "echo", "wheels", "-n", "1", "--timeout", "5")
        assert "left:" in sample.stdout


@pytest.mark.parametrize("place", ["robot", "laptop"])
def test_the_default_pipeline_has_its_filter_on_either_side(net: Net, place: str) -> None:
    text = (ROOT / "pipeline.yaml").read_text()
    text = text.replace("nodes/ekf.py", f"nodes/ekf.py\n    host: {place}")
    file = net.folder / "pipeline.yaml"
    file.write_text(f"{text}\nhosts: {hosts_at(net.address)}\n")
    with Host(net.robot, file, "robot") as robot, Host(net.laptop, file, "laptop") as laptop:
        for host in (robot, laptop):
            sample = host.call("topic", "echo", "pose", "-n", "1", "--timeout", "10")
            assert "covariance:" in sample.stdout
        assert "ekf" in processes(robot)[place]


def test_the_laptop_leaves_and_returns_and_the_robot_does_not_care(net: Net) -> None:
    file = net.file()
    with Host(net.robot, file, "robot") as robot:
        assert robot.links()["laptop"]["state"] == "waiting"
        with Host(net.laptop, file, "laptop"):
            assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
        assert eventually(lambda: robot.links()["laptop"]["state"] == "lost", 2.0, 0.1)
        assert robot.says("LINK_LOST laptop")
        pids = {process["pid"] for process in robot.reports()["robot"]["processes"]}
        with Host(net.laptop, file, "laptop") as laptop:
            assert eventually(lambda: robot.linked("laptop"), 10.0, 0.1)
            assert eventually(lambda: laptop.received("watcher", "speed") > 100, 10.0, 0.2)
            laptop.process.kill()
            assert eventually(lambda: "".join(robot.log).count("LINK_LOST laptop") == 2, 1.0)
        assert robot.links()["laptop"]["state"] == "lost"
        assert pids == {process["pid"] for process in robot.reports()["robot"]["processes"]}
        assert all(process["restarts"] == 0 for process in robot.reports()["robot"]["processes"])


def test_without_a_host_one_machine_plays_all(net: Net) -> None:
    everything = Host(net.robot, net.file(), "robot")
    everything._command = [word for word in everything._command if word not in ("--host", "robot")]
    with everything:
        assert eventually(lambda: everything.received("watcher", "speed") > 100, 10.0, 0.2)


def test_an_unknown_host_is_a_slip_of_the_pen(net: Net) -> None:
    robot = Host(net.robot, net.file(), "labtop")
    with pytest.raises(AssertionError, match="rover has no host 'labtop'"):
        robot.__enter__()
    assert robot.process.returncode == 2
