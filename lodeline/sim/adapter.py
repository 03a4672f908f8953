"""The stand-in for the kernel's I2C adapter: what smbus2 calls instead of ioctl.

It replaces the `ioctl` of smbus2's module and serves the descriptors of simulated buses only;
all others go to the real one. Like the kernel's SMBus emulation it turns every SMBus call into
plain I2C messages, and hands these to a `Transfer`.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import smbus2.smbus2 as kernel
from smbus2 import I2cFunc

MAX_MESSAGES = 42  # as i2c-dev
MAX_LENGTH = 8192  # as i2c-dev
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


class SimulatedFile:
    """Descriptors of a simulated bus: each is one of /dev/null, which the stand-in knows."""

    def __init__(self, transfer: Transfer, hang_up: Callable[[], None] | None = None) -> None:
        """Take what carries out the transactions, and what is to be called after the last close."""
        self._transfer = transfer
        self._hang_up = hang_up
        self._open = 0

    def open(self) -> int:
        """Return a new descriptor."""
        fd = os.open(os.devnull, os.O_RDWR)
        _served[fd] = self._transfer
        vars(kernel)["ioctl"] = _ioctl
        self._open += 1
        return fd

    def close(self, fd: int) -> None:
        """Give a descriptor back."""
        del _served[fd]  # first: the number may be handed out again at once
        _slaves.pop(fd, None)
        os.close(fd)
        self._open -= 1
        if self._open == 0 and self._hang_up is not None:
            self._hang_up()


_served: dict[int, Transfer] = {}
_slaves: dict[int, int] = {}  # descriptor -> slave address


def _ioctl(fd: Any, request: int, argument: Any = 0, mutate: bool = True) -> int:
    transfer = _served.get(fd)
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
