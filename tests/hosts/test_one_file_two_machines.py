"""Claims about one pipeline file on two machines: any order, any side, the same picture."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from lodeline.watch import Watch
from lodeline_msgs import Odometry, PoseEstimate, unpack
from tests.hosts.net import Host, Net, hosts_at
from tests.supervisor.talk import patience
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


def default_pipeline(net: Net, ekf: str) -> Path:
    """The pipeline that comes along, on two hosts, with its filter on one of them."""
    text = (ROOT / "pipeline.yaml").read_text()
    text = text.replace("nodes/ekf.py", f"nodes/ekf.py\n    host: {ekf}")
    file = net.folder / "pipeline.yaml"
    file.write_text(f"{text}\nhosts: {hosts_at(net.address)}\n")
    return file


def test_the_default_pipeline_may_have_its_filter_on_the_laptop(net: Net) -> None:
    file = default_pipeline(net, ekf="laptop")
    with Host(net.robot, file, "robot") as robot, Host(net.laptop, file, "laptop") as laptop:
        for host in (robot, laptop):
            sample = host.call("topic", "echo", "pose", "-n", "1", "--timeout", "10")
            assert "covariance:" in sample.stdout
        assert "ekf" in processes(robot)["laptop"]


def test_a_robot_whose_supervisor_is_killed_is_back_and_knows_where_it_stands(net: Net) -> None:
    """It stands wherever it was driven to, so that it is there still when its nodes are back."""
    file = default_pipeline(net, ekf="robot")
    file.write_text(file.read_text().replace("{seed: 1}", "{seed: 1, standing: 300}"))
    poses: list[tuple[float, PoseEstimate]] = []
    truths: list[Odometry] = []

    def take_pose(_key: str, data: bytes, _encoding: str) -> None:
        poses.append((time.monotonic(), unpack(data, PoseEstimate)))

    def stands() -> bool:
        return bool(truths) and truths[-1].x > 0.05 and abs(truths[-1].v) < 1e-3

    with (
        Host(net.robot, file, "robot") as robot,
        Host(net.laptop, file, "laptop") as laptop,
        Watch(laptop.running) as watch,
    ):
        watch.subscribe("rover/pose", 1024, take_pose)
        watch.subscribe(
            "rover/truth", 1024, lambda _key, data, _: truths.append(unpack(data, Odometry))
        )
        robot.call("topic", "pub", "cmd_vel", "v=0.12", "w=0", "--rate", "50", "-n", "50")
        assert eventually(stands, 10.0)
        unit = robot.call("service", str(file)).stdout
        killed, truth = time.monotonic(), truths[-1]
        robot.process.kill()
        robot.process.wait()
        time.sleep(float(unit.partition("RestartSec=")[2].split()[0]))  # as systemd does
        with Host(net.robot, file, "robot", base=robot.run) as again:
            assert again.says("RESUMED nodes go on from their states")
            assert eventually(lambda: bool(poses) and poses[-1][0] > killed + 0.5, 10.0)
            fresh = [item for item in [*poses] if item[0] > killed + 0.5]
            back = fresh[0][0] - killed
            print(f"back on the laptop after {back:.1f} s")
            assert back < 5.0 * patience()
            assert eventually(lambda: len(poses) - poses.index(fresh[0]) > 50, 10.0)
            assert math.hypot(truths[-1].x - truth.x, truths[-1].y - truth.y) < 0.001
            for _, pose in poses[poses.index(fresh[0]) :]:
                assert math.hypot(pose.x - truth.x, pose.y - truth.y) < 0.02


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
