"""`lodeline bag` and `lodeline replay` as people and scripts meet them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from lodeline.cli import main as lodeline
from lodeline.loading import shipped
from lodeline.recording.read import Recording

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


def test_export_makes_a_table_of_each_key(lab_mcap: str, tmp_path: Path, bag: Tool) -> None:
    assert bag(["export", lab_mcap, "--csv", str(tmp_path / "tables")]) == 0
    lines = (tmp_path / "tables" / "wheels.csv").read_text().splitlines()
    assert lines[0] == "stamp,left,right,seq"
    assert len(lines) == 401


def test_export_says_what_it_leaves_out(tmp_path: Path, bag: Tool, capsys: Capture) -> None:
    file = tmp_path / "foreign.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("Battery", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("battery", "msgpack", schema), 1, b"\x80", 1)
        writer.finish()  # type: ignore[no-untyped-call]
    assert bag(["export", str(file), "--csv", str(tmp_path / "tables")]) == 0
    assert "battery is left out: Battery is no class of the wire" in capsys.readouterr().err
    assert not list((tmp_path / "tables").iterdir())


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
