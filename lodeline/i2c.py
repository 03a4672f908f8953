"""I2C buses: the kernel's /dev/i2c-N, or a simulated bus behind smbus2's own code.

A simulated bus is a bus model in this process or the simulator behind a socket. Drivers and smbus2
do not see the difference: only the ioctl below them is another one (see lodeline.sim.adapter).
"""

from __future__ import annotations

import errno
import fcntl
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from smbus2 import I2cFunc, SMBus

if TYPE_CHECKING:
    from lodeline.sim.adapter import Transfer

ANSWER_TIMEOUT = 0.1  # s, far more than a transaction of the simulator takes
CONNECT_TIMEOUT = 10.0  # s to wait for the simulator's socket to appear
SETTLE = 0.05  # s between two looks for the socket
I2C_TIMEOUT = 0x0702  # in units of 10 ms
ADAPTER_TIMEOUT = 5  # 50 ms, so that a hanging bus does not hold the work loop
ENABLE = "sudo raspi-config nonint do_i2c 0 && sudo modprobe i2c-dev"


class BusError(OSError):
    """A bus that cannot be opened; `strerror` says why not, and what to do."""


class Descriptors(Protocol):
    """Where a bus gets its file descriptors from."""

    def open(self) -> int:
        """Return a new one; BusError if there is none."""

    def close(self, fd: int) -> None:
        """Give one back."""


class DeviceFile:
    """The kernel's device file of a bus."""

    def __init__(self, bus: int | str) -> None:
        """Take the number of the bus, or a path."""
        self._path = f"/dev/i2c-{bus}" if isinstance(bus, int) else bus

    def open(self) -> int:
        """Open the file, and see to it that a bus which hangs does not hold us for long."""
        path = self._path
        try:
            fd = os.open(path, os.O_RDWR)
        except FileNotFoundError as error:
            there = ", ".join(sorted(map(str, Path("/dev").glob("i2c-*")))) or "none"
            raise BusError(errno.ENOENT, f"no {path} (there is: {there}) - {ENABLE}") from error
        except PermissionError as error:
            text = f"no rights on {path} - sudo usermod -aG i2c $USER, then log out and in"
            raise BusError(errno.EACCES, text) from error
        except OSError as error:
            raise BusError(error.errno, f"{path} cannot be opened: {error.strerror}") from error
        try:
            fcntl.ioctl(fd, I2C_TIMEOUT, ADAPTER_TIMEOUT)
        except OSError as error:
            os.close(fd)
            raise BusError(error.errno, f"{path} is not an I2C bus") from error
        return fd

    def close(self, fd: int) -> None:
        """Close the file."""
        os.close(fd)


class Bus(SMBus):
    """An smbus2.SMBus that can be opened again in place. One thread per Bus, as in smbus2."""

    def __init__(
        self, where: int | str, descriptors: Descriptors | None = None, *, later: bool = False
    ) -> None:
        """Open it: BusError if it cannot be, unless `later` leaves that to `reopen`."""
        super().__init__()
        self.where = where
        self.hung_s = float("-inf")  # the tick [s] in which it hung last: then for all its devices
        self._descriptors = descriptors if descriptors is not None else DeviceFile(where)
        if not later:
            self.reopen()

    def reopen(self) -> None:
        """Open the same bus again, as after an adapter was unplugged; BusError if it cannot be.

        The older descriptor is given up only once the new one works.
        """
        fd = self._descriptors.open()
        previous, self.fd = self.fd, fd
        try:
            self.funcs = I2cFunc(self._get_funcs())  # type: ignore[attr-defined]
        except OSError:
            self.fd = previous
            self._descriptors.close(fd)
            raise
        self.address = None  # the kernel keeps the slave address with the descriptor
        if previous is not None:
            self._descriptors.close(previous)

    def close(self) -> None:
        """Close the bus; closing twice does nothing."""
        fd, self.fd = self.fd, None
        self.address = None
        if fd is not None:
            self._descriptors.close(fd)


def open_bus(
    bus: int | str,
    sim_socket: Path | None = None,
    answer: float | None = ANSWER_TIMEOUT,
    timeout: float = CONNECT_TIMEOUT,
) -> Bus:
    """Return I2C bus number `bus`, or the simulator's bus behind `sim_socket` if `bus` is "sim".

    A device file need not be there yet: it is opened by the first driver's link, which tries again
    and says why it cannot. A simulator is awaited for `timeout` seconds, then OSError says what to
    do; ValueError if "sim" comes without a socket. Its bus counts as hung when a transaction takes
    longer than `answer` seconds (None: never, for in simulated time no host is too slow).
    """
    if bus != "sim":
        return Bus(bus, later=True)
    if sim_socket is None:
        raise ValueError('bus "sim" needs the path of the simulator\'s socket')
    # only a simulated bus needs these
    from lodeline.sim.adapter import SimulatedFile
    from lodeline.sim.wire import SocketTransfer

    link = SocketTransfer(sim_socket, answer)
    deadline = time.monotonic() + timeout
    while True:
        try:
            link.connect()
            return Bus("sim", SimulatedFile(link, link.close))
        except OSError as error:
            if time.monotonic() >= deadline:
                text = f"no simulator behind {sim_socket} within {timeout:g} s - start it first"
                raise OSError(error.errno or errno.ENXIO, text) from error
        time.sleep(SETTLE)


def open_model(model: Transfer) -> Bus:
    """Open a bus model that lives in this process."""
    from lodeline.sim.adapter import SimulatedFile

    return Bus("model", SimulatedFile(model))
