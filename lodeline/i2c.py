"""I2C buses: the kernel's /dev/i2c-N, or a simulated bus behind smbus2's own code.

A simulated bus replaces nothing but the ioctl that smbus2 calls, and only for file descriptors
opened here, so that drivers and smbus2 itself run unchanged. The stand-in does what the kernel's
SMBus emulation does: it turns every SMBus call into plain I2C messages and hands these to a
`Transfer`, which is a bus model in this process or a socket to the simulator.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import smbus2.smbus2 as kernel
from smbus2 import I2cFunc, SMBus

CONNECT_TIMEOUT = 10.0  # s to wait for the simulator's socket to appear
SETTLE = 0.05  # s between two looks for the socket
MAX_MESSAGES = 42  # as i2c-dev
MAX_LENGTH = 8192  # as i2c-dev
I2C_TIMEOUT = 0x0702  # in units of 10 ms
ADAPTER_TIMEOUT = 5  # 50 ms, so that a hanging bus does not hold the work loop
# What a Raspberry Pi's adapter offers, without packet error codes.
FUNCS = int(I2cFunc.I2C | I2cFunc.SMBUS_EMUL) & ~int(I2cFunc.SMBUS_PEC)


class Message(NamedTuple):
    """One I2C message: `data` to write, or `length` bytes to read if `read` is set."""

    address: int
    read: bool
    data: bytes
    length: int


class Transfer(Protocol):
    """Anything that carries out one combined I2C transaction."""

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Return what each reading message got; OSError 121 (EREMOTEIO) if nobody answers."""


class Bus(SMBus):
    """An smbus2.SMBus that can be opened again in place. One thread per Bus, as in smbus2."""

    def __init__(self, where: int | str, simulated: Transfer | None = None) -> None:
        super().__init__()
        self.where = where
        self._simulated = simulated
        self.open(where)

    def open(self, bus: int | str) -> None:
        """Open the bus; an older descriptor is given up only once the new one works."""
        fd = _open_device(bus) if self._simulated is None else os.open(os.devnull, os.O_RDWR)
        if self._simulated is not None:
            _redirect(fd, self._simulated)
        previous, self.fd = self.fd, fd
        try:
            funcs = ctypes.c_ulong()
            _ioctl(fd, kernel.I2C_FUNCS, funcs)
            self.funcs = I2cFunc(funcs.value)
        except OSError:
            self.fd = previous
            _release(fd)
            raise
        self.address = None  # the slave address belongs to the descriptor
        self._force_last = None
        if previous is not None:
            _release(previous)

    def close(self) -> None:
        """Close the bus; closing twice does nothing."""
        fd, self.fd = self.fd, None
        self.address = None
        if fd is not None:
            _release(fd)

    def reopen(self) -> None:
        """Open the same bus again, as after an adapter was unplugged; OSError if it cannot be."""
        self.open(self.where)


def open_bus(
    bus: int | str, sim_socket: Path | None = None, timeout: float = CONNECT_TIMEOUT
) -> Bus:
    """Open I2C bus number `bus`, or the simulator's bus behind `sim_socket` if `bus` is "sim".

    A simulator that is not there yet is awaited for `timeout` seconds. Raises OSError with a
    sentence that says what to do, ValueError if "sim" comes without a socket.
    """
    if bus != "sim":
        return Bus(bus)
    if sim_socket is None:
        raise ValueError('bus "sim" needs the path of the simulator\'s socket')
    from lodeline.sim.wire import SocketTransfer  # only a simulated bus needs it

    link = SocketTransfer(sim_socket)
    deadline = time.monotonic() + timeout
    while True:
        try:
            link.connect()
            return Bus("sim", link)
        except OSError as error:
            if time.monotonic() >= deadline:
                text = f"no simulator behind {sim_socket} within {timeout:g} s - start it first"
                raise OSError(error.errno or errno.ENXIO, text) from error
        time.sleep(SETTLE)


def open_model(model: Transfer) -> Bus:
    """Open a bus model that lives in this process."""
    return Bus("model", model)


def _open_device(bus: int | str) -> int:
    path = f"/dev/i2c-{bus}" if isinstance(bus, int) else bus
    try:
        fd = os.open(path, os.O_RDWR)
    except FileNotFoundError as error:
        there = ", ".join(sorted(map(str, Path("/dev").glob("i2c-*")))) or "none"
        text = f"no {path} (there is: {there}) - enable I2C: raspi-config, or modprobe i2c-dev"
        raise FileNotFoundError(errno.ENOENT, text) from error
    except PermissionError as error:
        text = f"no rights on {path} - join its group: sudo usermod -aG i2c $USER, log in again"
        raise PermissionError(errno.EACCES, text) from error
    try:
        fcntl.ioctl(fd, I2C_TIMEOUT, ADAPTER_TIMEOUT)
    except OSError as error:
        os.close(fd)
        raise OSError(error.errno, f"{path} is not an I2C bus") from error
    return fd


# --- the stand-in for ioctl ---------------------------------------------------------------------

_table: dict[int, Transfer] = {}
_slaves: dict[int, int] = {}  # descriptor -> slave address, which the kernel keeps per file
_lock = threading.Lock()


def _redirect(fd: int, transfer: Transfer) -> None:
    with _lock:
        _table[fd] = transfer
        vars(kernel)["ioctl"] = _ioctl


def _release(fd: int) -> None:
    with _lock:  # forget it first: the number may be handed out again at once
        _table.pop(fd, None)
        _slaves.pop(fd, None)
    os.close(fd)


def _ioctl(fd: Any, request: int, argument: Any = 0, mutate: bool = True) -> int:
    transfer = _table.get(fd)
    if transfer is None:
        return int(fcntl.ioctl(fd, request, argument, mutate))
    if request == kernel.I2C_FUNCS:
        argument.value = FUNCS
    elif request in (kernel.I2C_SLAVE, kernel.I2C_SLAVE_FORCE):
        if not 0 <= argument <= 0x7F:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        _slaves[fd] = argument
    elif request == kernel.I2C_SMBUS:
        _smbus(transfer, _slaves.get(fd, 0), argument)
    elif request == kernel.I2C_RDWR:
        return _rdwr(transfer, argument)
    else:
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
    return 0


def _smbus(transfer: Transfer, address: int, call: Any) -> None:
    """Carry out one SMBus call as the kernel's emulation does, on plain I2C messages."""
    reads = call.read_write == kernel.I2C_SMBUS_READ
    command = bytes((call.command,))
    data = call.data.contents
    size = call.size
    if size == kernel.I2C_SMBUS_QUICK:
        transfer.transfer((Message(address, reads, b"", 0),))
    elif size == kernel.I2C_SMBUS_BYTE and reads:
        data.byte = transfer.transfer((Message(address, True, b"", 1),))[0][0]
    elif size == kernel.I2C_SMBUS_BYTE:
        transfer.transfer((Message(address, False, command, 0),))
    elif size == kernel.I2C_SMBUS_PROC_CALL:
        out = command + int(data.word).to_bytes(2, "little")
        data.word = int.from_bytes(_write_read(transfer, address, out, 2), "little")
    elif reads and size == kernel.I2C_SMBUS_BYTE_DATA:
        data.byte = _write_read(transfer, address, command, 1)[0]
    elif reads and size == kernel.I2C_SMBUS_WORD_DATA:
        data.word = int.from_bytes(_write_read(transfer, address, command, 2), "little")
    elif reads and size == kernel.I2C_SMBUS_I2C_BLOCK_DATA:
        length = _block_length(data.block[0])
        data.block[1 : length + 1] = list(_write_read(transfer, address, command, length))
    elif not reads and size in _WRITTEN:
        transfer.transfer((Message(address, False, command + _WRITTEN[size](data), 0),))
    else:  # an SMBus block read lets the chip set the length: such adapters cannot
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))


def _block_length(length: int) -> int:
    if not 1 <= length <= kernel.I2C_SMBUS_BLOCK_MAX:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    return length


_WRITTEN = {
    kernel.I2C_SMBUS_BYTE_DATA: lambda data: bytes((data.byte,)),
    kernel.I2C_SMBUS_WORD_DATA: lambda data: int(data.word).to_bytes(2, "little"),
    kernel.I2C_SMBUS_BLOCK_DATA: lambda data: bytes(
        data.block[0 : _block_length(data.block[0]) + 1]
    ),
    kernel.I2C_SMBUS_I2C_BLOCK_DATA: lambda data: bytes(
        data.block[1 : _block_length(data.block[0]) + 1]
    ),
}


def _write_read(transfer: Transfer, address: int, out: bytes, length: int) -> bytes:
    messages = (Message(address, False, out, 0), Message(address, True, b"", length))
    return transfer.transfer(messages)[0]


def _rdwr(transfer: Transfer, call: Any) -> int:
    raw = [call.msgs[i] for i in range(call.nmsgs)]
    if not 1 <= len(raw) <= MAX_MESSAGES or any(m.len > MAX_LENGTH for m in raw):
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    reading = [m for m in raw if m.flags & kernel.I2C_M_RD]
    messages = [
        Message(m.addr, True, b"", m.len)
        if m.flags & kernel.I2C_M_RD
        else Message(m.addr, False, ctypes.string_at(m.buf, m.len), 0)
        for m in raw
    ]
    for message, got in zip(reading, transfer.transfer(messages), strict=True):
        ctypes.memmove(message.buf, got, message.len)
    return len(raw)
