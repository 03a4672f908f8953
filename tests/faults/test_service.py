"""Claims about running as a service: a unit that systemd takes, and a word to who started us."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.test_live_faults import NODES
from tests.supervisor.talk import alive
from tests.support.live import Up, eventually, lodeline

LITTLE = f"""
name: little
nodes:
  source: {{run: {NODES}/wheels.py, outputs: {{wheels: wheels}}}}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    folder = tmp_path / 'a %n "folder"'
    folder.mkdir()
    path = folder / "little.yaml"
    path.write_text(LITTLE)
    return path


def test_the_unit_starts_this_pipeline_with_this_python(file: Path) -> None:
    result = lodeline("service", str(file), "--user", "robot", run=file.parent)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    quoted = str(file).replace("%", "%%").replace('"', '\\"')
    assert f'ExecStart={sys.executable} -P -m lodeline up "{quoted}"' in lines
    assert {"Type=notify", "WatchdogSec=10", "User=robot", "KillMode=mixed"} <= set(lines)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here")
def test_systemd_finds_no_fault_in_the_unit(file: Path, tmp_path: Path) -> None:
    unit = tmp_path / "lodeline.service"
    unit.write_text(lodeline("service", str(file), "--user", "root", run=tmp_path).stdout)
    result = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0, result.stderr
    assert "lodeline.service" not in result.stderr


def test_a_wrong_file_and_a_wrong_host_are_named(file: Path) -> None:
    result = lodeline("service", str(file), "--host", "moon", run=file.parent)
    assert (result.returncode, result.stdout) == (2, "")
    assert "'moon'" in result.stderr
    file.write_text(LITTLE.replace("outputs", "ouputs"))
    assert lodeline("service", str(file), run=file.parent).returncode == 3


def test_the_supervisor_says_when_it_is_ready_and_beats_while_its_loop_turns(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(path))
        systemd.settimeout(10.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(path))
        with Up(file) as up:
            words = systemd.recv(256).decode().splitlines()
            while "READY=1" not in words:  # it beats before it is ready
                words += systemd.recv(256).decode().splitlines()
            assert systemd.recv(256) == b"WATCHDOG=1"
            os.kill(up.process.pid, signal.SIGSTOP)
            systemd.settimeout(1.5)
            with pytest.raises(TimeoutError):
                while True:
                    systemd.recv(256)
            os.kill(up.process.pid, signal.SIGCONT)
            systemd.settimeout(10.0)
            assert systemd.recv(256) == b"WATCHDOG=1"


def test_a_closed_terminal_stops_all(file: Path) -> None:
    """The kernel hangs up on whoever runs in a terminal whose other end is closed."""
    with Up(file) as up:
        environment = {**os.environ, "LODELINE_RUN": str(up.run / "other")}
    (up.run / "other").mkdir(parents=True, exist_ok=True)
    pid, terminal = os.forkpty()
    if pid == 0:
        command = [sys.executable, "-P", "-m", "lodeline", "up", str(file)]
        os.execve(sys.executable, command, environment)
    heard = b""
    while b"up in " not in heard:
        heard += os.read(terminal, 4096)
    ps = lodeline("ps", "--json", run=up.run / "other").stdout
    assert '"process": "source"' in ps
    pids = [int(text) for text in re.findall(r'"pid": (\d+)', ps)]
    assert pids and all(map(alive, pids))
    os.close(terminal)
    assert eventually(lambda: os.waitpid(pid, os.WNOHANG)[0] == pid or not alive(pid), 5.0)
    assert lodeline("ps", run=up.run / "other").returncode == 4
    assert not any(map(alive, pids))
    shutil.rmtree(up.run, ignore_errors=True)
