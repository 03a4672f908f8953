"""The same bus over a unix socket, shared by processes."""

from __future__ import annotations

import contextlib
import errno
import json
import socket
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from lodeline.i2c import Bus, open_bus
from lodeline.sim.adapter import Message
from lodeline.sim.robot import RobotParams, SimulatedRobot
from lodeline.sim.server import I2cServer
from tests.support.live import eventually

ROOT = Path(__file__).parents[2]
CLIENT = """
import json, sys
from pathlib import Path
from smbus2 import i2c_msg
from lodeline.i2c import open_bus
bus = open_bus("sim", Path(sys.argv[1]), None)
try:
    bus.read_byte_data(0x33, 0)
    absent = 0
except OSError as error:
    absent = error.errno
bus.write_byte_data(0x68, 0x19, 9)
out, got = i2c_msg.write(0x68, [0x75]), i2c_msg.read(0x68, 1)
bus.i2c_rdwr(out, got)
print(json.dumps({
    "byte": bus.read_byte_data(0x68, 0x75),
    "word": bus.read_word_data(0x68, 0x19),
    "block": bus.read_i2c_block_data(0x68, 0x19, 3),
    "combined": list(got),
    "port": bus.read_byte(0x20),
    "absent": absent,
}))
"""


@pytest.fixture
def robot() -> SimulatedRobot:
    return SimulatedRobot(RobotParams(speed=0.0), lambda: 0.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "i2c"


def patient_bus(path: Path) -> Bus:
    """The bus behind a socket, however slow the machine is."""
    return open_bus("sim", path, None)


def test_another_process_works_on_the_same_chips(robot: SimulatedRobot, path: Path) -> None:
    with I2cServer(robot.bus, path):
        done = subprocess.run(
            [sys.executable, "-c", CLIENT, str(path)],
            capture_output=True,
            check=True,
            cwd=ROOT,
            timeout=20,
        )
    assert json.loads(done.stdout) == {
        "byte": 0x71,
        "word": 9,
        "block": [9, 0, 0],
        "combined": [0x71],
        "port": 0xFF,
        "absent": 121,
    }
    robot.imu.write(b"\x19")
    assert robot.imu.read(1) == b"\x09", "what the other process wrote is in our chip"


def test_the_socket_is_its_owners_only_and_goes_with_the_server(
    robot: SimulatedRobot, path: Path
) -> None:
    with I2cServer(robot.bus, path):
        mode = path.stat().st_mode
        assert stat.S_ISSOCK(mode)
        assert stat.S_IMODE(mode) == 0o600
        assert list(path.parent.iterdir()) == [path]
    assert list(path.parent.iterdir()) == []


def test_a_stale_socket_file_is_replaced(robot: SimulatedRobot, path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    with I2cServer(robot.bus, path):
        assert patient_bus(path).read_byte_data(0x68, 0x75) == 0x71


def test_a_living_server_is_not_replaced(robot: SimulatedRobot, path: Path) -> None:
    with I2cServer(robot.bus, path):
        with pytest.raises(OSError, match="another simulator serves") as caught:
            I2cServer(robot.bus, path)
        assert caught.value.errno == errno.EADDRINUSE
        assert patient_bus(path).read_byte_data(0x68, 0x75) == 0x71


def test_a_path_too_long_for_a_socket_is_named(robot: SimulatedRobot, tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"cannot serve .*xxx"):
        I2cServer(robot.bus, tmp_path / ("x" * 120))


def test_a_restarted_simulator_costs_one_transaction(robot: SimulatedRobot, path: Path) -> None:
    server = I2cServer(robot.bus, path)
    bus = patient_bus(path)
    assert bus.read_byte_data(0x68, 0x75) == 0x71
    server.close()
    for _ in range(2):
        with pytest.raises(OSError):  # at once: this bus would wait for ever
            bus.read_byte_data(0x68, 0x75)
    with I2cServer(robot.bus, path):
        assert bus.read_byte_data(0x68, 0x75) == 0x71


def test_a_server_killed_under_a_client_costs_exactly_one_transaction(
    robot: SimulatedRobot, path: Path
) -> None:
    first = I2cServer(robot.bus, path)
    bus = patient_bus(path)
    bus.read_byte_data(0x68, 0x75)
    first.close()
    with I2cServer(robot.bus, path):
        with pytest.raises(OSError):
            bus.read_byte_data(0x68, 0x75)
        assert bus.read_byte_data(0x68, 0x75) == 0x71


def test_a_frozen_simulator_is_a_hung_bus_and_not_waited_for(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as frozen:
        frozen.bind(str(path))
        frozen.listen()
        bus = open_bus("sim", path)
        begin = time.monotonic()
        with pytest.raises(OSError) as caught:
            bus.read_byte_data(0x68, 0x75)
        assert caught.value.errno == errno.ETIMEDOUT
        assert time.monotonic() - begin < 1.0
        bus.close()


def test_opening_waits_for_a_simulator_that_comes_later(robot: SimulatedRobot, path: Path) -> None:
    servers: list[I2cServer] = []
    timer = threading.Timer(0.2, lambda: servers.append(I2cServer(robot.bus, path)))
    timer.start()
    bus = open_bus("sim", path, timeout=10.0)
    assert bus.read_byte_data(0x68, 0x75) == 0x71
    timer.join()
    servers[0].close()


def test_opening_gives_up_with_a_sentence(path: Path) -> None:
    with pytest.raises(OSError, match=r"no simulator behind .* within 0.1 s"):
        open_bus("sim", path, timeout=0.1)
    with pytest.raises(ValueError, match="needs the path"):
        open_bus("sim")


@pytest.mark.parametrize(
    "garbage",
    [
        b"\xff\xff\xff\xff",  # a frame of 4 GiB
        b"\x00\x00\x00\x03\x00\x68\x00",  # ends inside a message
        b"\x00\x00\x00\x05\x00\x68\x00\xff\xff",  # writes more than it holds
        b"GET / HTTP/1.1\r\n\r\n",
        b"\x00",
    ],
)
def test_nonsense_from_one_client_does_not_disturb_another(
    robot: SimulatedRobot, path: Path, garbage: bytes
) -> None:
    with I2cServer(robot.bus, path):
        bus = patient_bus(path)
        with socket.socket(socket.AF_UNIX) as rude:
            rude.connect(str(path))
            rude.settimeout(5.0)
            rude.sendall(garbage)
            rude.shutdown(socket.SHUT_WR)
            answer = b""
            with contextlib.suppress(ConnectionResetError):  # cut off with bytes unread
                answer = b"".join(iter(lambda: rude.recv(100), b""))
        assert answer in (b"", b"\x00\x00\x00\x02" + errno.EINVAL.to_bytes(2, "big"))
        assert bus.read_byte_data(0x68, 0x75) == 0x71


def test_a_slow_answer_is_a_hung_bus_but_never_in_simulated_time(
    robot: SimulatedRobot, path: Path
) -> None:
    class Slow:
        def transfer(self, messages: Sequence[Message]) -> list[bytes]:
            time.sleep(0.15)
            return robot.bus.transfer(messages)

    with I2cServer(Slow(), path):
        with pytest.raises(TimeoutError):
            open_bus("sim", path).read_byte_data(0x68, 0x75)
        assert open_bus("sim", path, None).read_byte_data(0x68, 0x75) == 0x71


def test_many_clients_at_once_each_get_their_own_answers(robot: SimulatedRobot, path: Path) -> None:
    answers: list[bool] = []

    def read(address: int, register: int, expected: int) -> None:
        bus = patient_bus(path)
        answers.extend(bus.read_byte_data(address, register) == expected for _ in range(200))
        bus.close()

    with I2cServer(robot.bus, path):
        jobs = [(0x68, 0x75, 0x71), (0x40, 0xFB, 0x01), (0x41, 0xFA, 128), (0x68, 0x6B, 0x01)]
        threads = [threading.Thread(target=read, args=job) for job in jobs]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert answers == [True] * 800


def test_a_closed_server_leaves_no_threads_and_no_descriptors(
    robot: SimulatedRobot, path: Path
) -> None:
    # other tests' may be closed meanwhile, so there may also be fewer
    open_descriptors = len(list(Path("/proc/self/fd").iterdir()))
    server = I2cServer(robot.bus, path)
    buses = [patient_bus(path) for _ in range(3)]
    for bus in buses:
        bus.read_byte_data(0x68, 0x75)
    for bus in buses[1:]:
        bus.close()
    server.close()
    with pytest.raises(OSError):
        buses[0].read_byte_data(0x68, 0x75)
    buses[0].close()

    def left() -> tuple[int, list[str]]:
        names = [thread.name for thread in threading.enumerate()]
        descriptors = len(list(Path("/proc/self/fd").iterdir())) - open_descriptors
        return max(0, descriptors), [name for name in names if name.startswith("i2c-")]

    assert eventually(lambda: left() == (0, []), 5.0), left()
