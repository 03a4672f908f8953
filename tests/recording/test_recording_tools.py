"""`lodeline bag` and `lodeline replay` as people and scripts meet them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import pytest
from mcap.writer import Writer

from lodeline.cli import main as lodeline
from lodeline.loading import shipped
from lodeline.recording.read import Recording
from lodeline.recording.write import RecordingWriter, whole_file
from lodeline_msgs import MESSAGES, Message, Twist, Unit, json_schema, pack
from lodeline_msgs.definition import unlisted

Tool = Callable[[list[str]], int]
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def lab_mcap(lab_text: Path, tmp_path: Path, bag: Tool, capsys: Capture) -> str:
    file = str(tmp_path / "lab.mcap")
    assert bag(["import", str(lab_text), "--format", "magnet-lab", "-o", file]) == 0
    capsys.readouterr()
    return file


def test_info_lists_keys_counts_rates_and_losses(lab_mcap: str, bag: Tool, capsys: Capture) -> None:
    assert bag(["info", lab_mcap, "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert info["start"] == 100_000_000_000
    assert info["duration"] == pytest.approx(19.95)
    expected = {"samples": 400, "rate": pytest.approx(20.0), "lost": 0}
    assert info["keys"] == {
        "reeds": {"type": "ReedBar", **expected},
        "wheels": {"type": "WheelTicks", **expected},
    }
    assert bag(["info", lab_mcap]) == 0
    text = capsys.readouterr().out
    assert "start: 100.000000000 s, duration: 19.950 s" in text
    assert "wheels  WheelTicks       400     20.00       0" in text


def test_info_of_what_is_no_recording_fails_with_one_line(
    tmp_path: Path, lab_text: Path, bag: Tool, capsys: Capture
) -> None:
    assert bag(["info", str(lab_text)]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "no MCAP recording" in err


@pytest.mark.parametrize(
    "command",
    [
        "bag info FILE",
        "bag export FILE --csv out",
        "bag recover FILE -o out.mcap",
        "bag import FILE --format magnet-lab",
        "bag import FILE --preview",
        "calibrate mag --from FILE",
        "compare FILE FILE",
        "estimate FILE -o out.csv",
        "grade odometry FILE",
        "plot FILE",
        "replay FILE --pipeline magnet-lab",
        "replay FILE --format lecture-wheels",
        "topic echo pose --bag FILE",
    ],
)
def test_a_file_that_is_not_there_ends_every_verb_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert lodeline(command.replace("FILE", "none.mcap").split()) == 4
    assert capsys.readouterr() == ("", "none.mcap: there is no such file\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        "bag import TEXT --format magnet-lab -o TEXT --force",
        "bag recover BAG -o BAG --force",
        "plot BAG --html BAG",
        "replay BAG --pipeline magnet-lab -o BAG --force",
        "replay TEXT --format magnet-lab -o TEXT --force",
    ],
)
def test_no_verb_writes_over_what_it_reads(
    lab_text: Path, lab_mcap: str, capsys: Capture, command: str
) -> None:
    files = (lab_text, Path(lab_mcap))
    before = [file.read_bytes() for file in files]
    words = command.replace("TEXT", str(lab_text)).replace("BAG", lab_mcap).split()
    capsys.readouterr()
    assert lodeline(words) == 1
    assert capsys.readouterr().err.rstrip().endswith("give another name")
    assert [file.read_bytes() for file in files] == before


def test_truncated_recording_is_refused_then_recovered_by_the_verb_it_names(
    lab_mcap: str, tmp_path: Path, bag: Tool, capsys: Capture
) -> None:
    cut, saved = tmp_path / "cut.mcap", str(tmp_path / "saved.mcap")
    cut.write_bytes(Path(lab_mcap).read_bytes()[:20_000])
    assert bag(["info", str(cut)]) == 1
    assert f"lodeline bag recover {cut} -o NEW.mcap" in capsys.readouterr().err
    assert bag(["recover", str(cut), "-o", saved]) == 3
    assert bag(["info", saved]) == 0
    assert bag(["recover", lab_mcap, "-o", saved, "--force"]) == 0


def test_export_makes_a_table_of_each_key(
    lab_mcap: str, tmp_path: Path, bag: Tool, capsys: Capture
) -> None:
    assert bag(["export", lab_mcap, "--csv", str(tmp_path / "tables")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'tables'}: 2 tables, 800 rows\n"
    lines = (tmp_path / "tables" / "wheels.csv").read_text().splitlines()
    assert lines[0] == "stamp,left,right,seq"
    assert len(lines) == 401


def foreign(file: Path, schema: bytes, data: bytes) -> str:
    """A recording of one sample on `battery`, of a class that Lodeline does not have."""
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        number = writer.register_schema("Battery", "jsonschema", schema)
        writer.add_message(writer.register_channel("battery", "msgpack", number), 1, data, 1)
        writer.finish()  # type: ignore[no-untyped-call]
    return str(file)


def test_export_says_what_it_leaves_out(tmp_path: Path, bag: Tool, capsys: Capture) -> None:
    file = foreign(tmp_path / "foreign.mcap", b"{}", b"\x80")
    assert bag(["export", file, "--csv", str(tmp_path / "tables")]) == 0
    assert "battery is left out: the schema of its class Battery" in capsys.readouterr().err
    assert not list((tmp_path / "tables").iterdir())


def test_a_class_of_a_nodes_own_file_is_read_by_the_schema_in_the_recording(
    tmp_path: Path, bag: Tool, capsys: Capture
) -> None:
    @unlisted
    class Battery(Message):
        """What is left."""

        data: Annotated[float, Unit("V", "of the whole pack")]
        cells: Annotated[tuple[float, float], Unit("V")]
        type: Annotated[str, Unit("-")]
        counts: Annotated[dict[str, int], Unit("1")]
        charging: Annotated[bool, Unit("-")] = False

    schema = json.dumps(json_schema(Battery)).encode()
    sample = Battery(5, data=12.25, cells=(6.0, 6.25), type="LiPo", counts={"a": 1}, seq=7)
    file = foreign(tmp_path / "own.mcap", schema, pack(sample))
    assert bag(["export", file, "--csv", str(tmp_path)]) == 0
    assert (tmp_path / "battery.csv").read_text().splitlines() == [
        "stamp,data,cells_0,cells_1,type,counts,charging,seq",
        "0.000000005,12.25,6.0,6.25,LiPo,a=1,0,7",
    ]
    assert bag(["info", file]) == 0
    assert "battery  Battery         1" in capsys.readouterr().out
    assert lodeline(["topic", "echo", "battery", "--bag", file]) == 0
    assert "data: 12.25 V" in capsys.readouterr().out
    assert "Battery" not in MESSAGES


@pytest.mark.parametrize(
    "properties",
    ['"stamp": 1, "x=print": {"type": "number"}', '"stamp": 1, "x": {"type": "array"}', '"x": 1'],
)
def test_a_schema_that_is_no_messages_is_no_code_either(
    tmp_path: Path, bag: Tool, capsys: Capture, properties: str
) -> None:
    schema = f'{{"title": "Battery", "properties": {{{properties}}}}}'
    file = foreign(tmp_path / "odd.mcap", schema.encode(), b"\x80")
    assert bag(["export", file, "--csv", str(tmp_path / "tables")]) == 0
    assert "battery is left out" in capsys.readouterr().err


def test_keys_that_differ_in_a_slash_alone_have_a_table_each(tmp_path: Path, bag: Tool) -> None:
    file = tmp_path / "two.mcap"
    with whole_file(file) as stream:
        writer = RecordingWriter(stream, {})
        for place, key in enumerate(("imu/data", "imu_data", "imu__data")):
            writer.write(key, Twist(place, v=float(place), w=0.0))
        writer.close()
    assert bag(["export", str(file), "--csv", str(tmp_path)]) == 0
    tables = {path.stem: path.read_text().splitlines()[1] for path in tmp_path.glob("*.csv")}
    speeds = {name: line.split(",")[1] for name, line in tables.items()}
    assert speeds == {"imu_data": "1.0", "imu__data": "2.0", "imu___data": "0.0"}


def test_play_without_a_running_pipeline_exits_with_4(
    lab_mcap: str, tmp_path: Path, bag: Tool, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LODELINE_RUN", str(tmp_path / "run"))
    assert bag(["play", lab_mcap]) == 4
    assert "no pipeline runs here" in capsys.readouterr().err


def test_replay_prints_traffic_and_the_same_hash_each_time(
    lab_mcap: str, tmp_path: Path, replay_tool: Tool, capsys: Capture
) -> None:
    command = [lab_mcap, "--pipeline", "magnet-lab"]
    assert replay_tool(command) == 0
    text = capsys.readouterr().out
    assert "pose          400     20.00  ekf" in text
    digest = text.splitlines()[-1].removeprefix("hash: ")
    assert len(digest) == 64
    out = tmp_path / "all.mcap"
    assert replay_tool([*command, "--json", "-o", str(out), "--csv", str(tmp_path / "t")]) == 0
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["hash"] == digest
    assert outcome["keys"]["odom"] == {
        "samples": 400, "rate": pytest.approx(20.0), "source": "odometry",
    }  # fmt: skip
    with Recording(out) as recording:
        assert {key: info.count for key, info in recording.channels.items()} == {
            "wheels": 400, "reeds": 400, "odom": 400, "magnets": 400, "pose": 400,
        }  # fmt: skip
        assert recording.metadata["pipeline"] == "magnet-lab"
    assert sorted(file.name for file in (tmp_path / "t").iterdir()) == [
        "magnets.csv", "odom.csv", "pose.csv", "reeds.csv", "wheels.csv",
    ]  # fmt: skip
    assert replay_tool([str(out), "--pipeline", "magnet-lab", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["hash"] == digest


def test_parameter_set_on_the_command_line_takes_effect(
    lab_mcap: str, replay_tool: Tool, capsys: Capture
) -> None:
    digests = []
    for extra in ([], ["--set", "ekf.initial_pose=[0.055, 0, 0]"]):
        assert replay_tool([lab_mcap, "--pipeline", "magnet-lab", "--json", *extra]) == 0
        digests.append(json.loads(capsys.readouterr().out)["hash"])
    assert digests[0] != digests[1]


def test_invalid_pipeline_exits_with_3_and_says_what(
    lab_mcap: str, replay_tool: Tool, capsys: Capture
) -> None:
    code = replay_tool([lab_mcap, "--pipeline", "magnet-lab", "--set", "ekf.gate=abc"])
    assert code == 3
    assert "ekf.gate" in capsys.readouterr().err
    assert replay_tool([lab_mcap, "--pipeline", "magnet-lob"]) == 3
    assert "magnet-lab" in capsys.readouterr().err


def test_recording_that_lacks_a_key_exits_with_1_and_leaves_no_output(
    lab_mcap: str, tmp_path: Path, replay_tool: Tool, capsys: Capture
) -> None:
    out = tmp_path / "out.mcap"
    default = str(shipped("pipeline.yaml"))
    assert replay_tool([lab_mcap, "--pipeline", default, "-o", str(out)]) == 1
    err = capsys.readouterr().err
    assert "lacks imu/data_raw (Imu), imu/mag_raw (MagneticField)" in err
    assert "it has reeds (ReedBar), wheels (WheelTicks)" in err
    assert not out.exists()


def test_hash_does_not_depend_on_the_process(lab_mcap: str) -> None:
    tool = str(shipped("tools") / "replay.py")
    digests = set()
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-P", tool, lab_mcap, "--pipeline", "magnet-lab", "--json"],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            timeout=30,
            check=True,
        )
        digests.add(json.loads(done.stdout)["hash"])
    assert len(digests) == 1
