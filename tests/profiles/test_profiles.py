"""`lodeline new` writes pipelines that are whole, true to the robot, and run at once."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, hypot, pi, sin
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from lodeline import virtual
from lodeline.cli import main
from lodeline.pipeline.load import load
from lodeline_msgs import Message, Odometry, PoseEstimate
from tests.support.truth import heading_errors

ROBOTS = ("scuttle", "magnet-lab", "beego")
SECONDS = 12.0  # in the first two of which the robot stands


@pytest.fixture(scope="module", params=ROBOTS)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pipeline file of a robot, as `lodeline new` writes it."""
    folder = tmp_path_factory.mktemp("p") / "robot"
    assert main(["new", str(folder), "--robot", request.param]) == 0
    return folder / "pipeline.yaml"


@pytest.fixture(scope="module")
def heard(
    written: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, list[Message]]]:
    """What a simulated run of that robot sends, by key without the name."""
    messages: dict[str, list[Message]] = {}

    def listen(key: str, message: Message) -> None:
        messages.setdefault(key.partition("/")[2], []).append(message)

    pipeline = load(written)
    virtual.run(pipeline, SECONDS, tmp_path_factory.mktemp("r"), listen)
    yield messages


def params_of(robot: str, tmp_path: Path) -> dict[str, Any]:
    """Parameters by node, as they stand in the file of a robot."""
    assert main(["new", str(tmp_path / robot), "--robot", robot]) == 0
    text = (tmp_path / robot / "pipeline.yaml").read_text()
    nodes = YAML(typ="safe", pure=True).load(text)["nodes"]
    return {name: node["params"] for name, node in nodes.items() if "params" in node}


def poses(messages: list[Message]) -> dict[int, tuple[float, float, float]]:
    return {m.stamp: (m.x, m.y, m.yaw) for m in messages if isinstance(m, Odometry | PoseEstimate)}


def turned(angle: float) -> float:
    return atan2(sin(angle), cos(angle))


def test_check_finds_nothing(written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(written)]) == 0
    out, err = capsys.readouterr()
    assert out.rstrip().endswith("fine")
    assert "warning" not in err


def test_every_output_comes_at_the_rate_that_the_file_promises(
    written: Path, heard: dict[str, list[Message]]
) -> None:
    promised = 0
    for spec in load(written).nodes:
        for port, rate in spec.rates.items():
            key = spec.outputs[port].partition("/")[2]
            found = len(heard[key]) / SECONDS
            # there is a pose for each odometry, and one more for a magnet
            assert found > 0.95 * rate if key == "pose" else abs(found - rate) < 0.05 * rate, key
            promised += 1
    assert promised >= 6


def test_odometry_goes_the_way_of_the_robot(heard: dict[str, list[Message]]) -> None:
    truth, odom = poses(heard["truth"]), poses(heard["odom"])
    x0, y0, yaw0 = truth[min(truth)]
    way = turn = 0.0
    last = (x0, y0, yaw0)
    for stamp in sorted(truth):
        x, y, yaw = truth[stamp]
        way += hypot(x - last[0], y - last[1])
        turn += abs(turned(yaw - last[2]))
        last = (x, y, yaw)
    assert way > 1.0
    assert turn > 1.5, "it went round a bend"
    stamp = max(truth.keys() & odom.keys())
    (x, y, yaw), (ox, oy, oyaw) = truth[stamp], odom[stamp]
    assert hypot(x - x0 - ox, y - y0 - oy) < 0.04 * way
    assert abs(turned(yaw - yaw0 - oyaw)) < 0.1, "slip and wheels that are a little off"


def test_the_attitude_knows_north_although_the_chip_is_mounted_askew(
    heard: dict[str, list[Message]],
) -> None:
    errors = heading_errors(heard["attitude"], heard["truth"])
    assert len(errors) > 2000
    late = errors[len(errors) // 2 :]
    assert (sum(error * error for error in late) / len(late)) ** 0.5 < 4.0 * pi / 180.0


def test_the_magnet_lab_s_pose_stays_with_the_truth(
    written: Path, heard: dict[str, list[Message]]
) -> None:
    if "pose" not in heard:
        assert load(written).name in ("scuttle", "beego"), "their floors have no magnets"
        return
    truth, pose = poses(heard["truth"]), poses(heard["pose"])
    errors = [
        hypot(truth[stamp][0] - pose[stamp][0], truth[stamp][1] - pose[stamp][1])
        for stamp in truth.keys() & pose.keys()
    ]
    assert len(errors) > 400
    assert (sum(error * error for error in errors) / len(errors)) ** 0.5 < 0.008


def test_scuttle_has_its_constants_and_its_traps(tmp_path: Path) -> None:
    params = params_of("scuttle", tmp_path)
    odometry, encoders = params["odometry"], params["encoders"]["encoders"]
    assert (odometry["wheel_radius"], odometry["track"]) == (0.041, 2 * 0.201)
    assert (odometry["ticks_per_turn"], odometry["gear"]) == (16384, 2)
    assert (encoders["left_address"], encoders["right_address"]) == (0x40, 0x41)
    assert encoders["left_inverted"] is True
    assert params["calibrate"]["mounting"][2] == pytest.approx(-pi / 2, abs=1e-4)
    text = (tmp_path / "scuttle/pipeline.yaml").read_text()
    assert "INA219" in text
    assert "is half" in text


def test_beego_has_its_constants_and_not_those_of_the_exercise(tmp_path: Path) -> None:
    params = params_of("beego", tmp_path)
    for node in ("odometry", "motors"):
        values = [params[node][key] for key in ("wheel_radius", "track", "ticks_per_turn", "gear")]
        assert values == [0.0406, 0.2765, 2048, 54.0699]
    assert (params["odometry"]["left_sign"], params["odometry"]["right_sign"]) == (1, 1)


def test_the_magnet_lab_has_its_constants(tmp_path: Path) -> None:
    params = params_of("magnet-lab", tmp_path)
    assert (params["odometry"]["wheel_radius"], params["odometry"]["track"]) == (0.0215, 0.112)
    assert (params["ekf"]["lattice_pitch"], params["ekf"]["bar_x"]) == (0.055, 0.080)
    assert (params["magnets"]["reeds"], params["magnets"]["pitch"]) == (8, 0.010)
    assert params["magnet_bar"]["bar"] == {"chip": "pcf8574", "address": 0x20, "inverted": False}


def test_on_a_robot_a_few_lines_change(written: Path, tmp_path: Path) -> None:
    blocks = written.read_text().split("\n\n")
    real = [block for block in blocks if not block.startswith(("  simulator:", "  motors:"))]
    real[-len(real) :] = [_nodes_first(block) for block in real]
    text = "\n\n".join(real).replace("bus: sim", "bus: 1").replace("port: sim", "port: /dev/tty9")
    for program in written.parent.glob("*.py"):
        (tmp_path / program.name).write_text(program.read_text())
    file = tmp_path / "pipeline.yaml"
    file.write_text(text)
    pipeline = load(file)
    assert not {"simulator", "motors"} & {spec.name for spec in pipeline.nodes}
    buses = [spec.params.bus for spec in pipeline.nodes if hasattr(spec.params, "bus")]
    ports = [spec.params.port for spec in pipeline.nodes if hasattr(spec.params, "port")]
    assert (set(buses), ports) == ({1}, ["/dev/tty9"] if pipeline.name == "beego" else [])


def _nodes_first(block: str) -> str:
    """`nodes:` stands in one block with the simulator."""
    return "nodes:" if block.startswith("nodes:") else block


def test_what_is_there_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "pipeline.yaml"
    mine.write_text("mine")
    assert main(["new", str(tmp_path), "--robot", "beego"]) == 1
    assert "pipeline.yaml is already there" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["pipeline.yaml"]


def test_a_folder_that_cannot_be_made_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["new", str(tmp_path / "file/below"), "--robot", "scuttle"]) == 1
    assert "file" in capsys.readouterr().err
