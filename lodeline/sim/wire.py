"""I2C transactions over a unix stream socket: the framing, and the client's end.

A frame is its length (4 bytes, big-endian) and its body. A request's body holds, for every
message, address, 1 if it reads, and length (2 + 1 + 2 bytes), then the data if it writes. The
answer's body is an errno (2 bytes, 0 = done) and the bytes of all reading messages in turn.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
import threading
from collections.abc import Sequence
from pathlib import Path

from lodeline.sim.adapter import MAX_LENGTH, MAX_MESSAGES, Message

_FRAME = struct.Struct("!I")
_MESSAGE = struct.Struct("!HBH")
_ERRNO = struct.Struct("!H")
MAX_BODY = MAX_MESSAGES * (_MESSAGE.size + MAX_LENGTH)


def pack_request(messages: Sequence[Message]) -> bytes:
    """Return the body of a request."""
    return b"".join(
        _MESSAGE.pack(m.address, m.read, m.length if m.read else len(m.data)) + m.data
        for m in messages
    )


def unpack_request(body: bytes) -> list[Message]:
    """Return the messages of a request; ValueError if it is not one."""
    messages: list[Message] = []
    at = 0
    while at < len(body):
        if at + _MESSAGE.size > len(body):
            raise ValueError("request ends inside a message")
        address, read, length = _MESSAGE.unpack_from(body, at)
        at += _MESSAGE.size
        end = at if read else at + length
        if length > MAX_LENGTH or end > len(body) or len(messages) == MAX_MESSAGES:
            raise ValueError("request is longer than an I2C transaction may be")
        messages.append(Message(address, bool(read), body[at:end], length if read else 0))
        at = end
    return messages


def pack_answer(number: int, parts: Sequence[bytes] = ()) -> bytes:
    """Return the body of an answer: an errno, or 0 and what was read."""
    return _ERRNO.pack(number) + b"".join(parts)


def send_frame(connection: socket.socket, body: bytes) -> None:
    """Send one frame."""
    connection.sendall(_FRAME.pack(len(body)) + body)


def receive_frame(connection: socket.socket) -> bytes:
    """Receive one frame's body; ConnectionError if the other side left or talks nonsense."""
    (length,) = _FRAME.unpack(_receive(connection, _FRAME.size))
    if length > MAX_BODY:
        raise ConnectionError(errno.EPROTO, f"frame of {length} bytes")
    return _receive(connection, length)


def _receive(connection: socket.socket, length: int) -> bytes:
    parts = bytearray()
    while len(parts) < length:
        part = connection.recv(length - len(parts))
        if not part:
            raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        parts += part
    return bytes(parts)


class SocketTransfer:
    """Carries transactions to the simulator; connects by itself, and again after a failure.

    An answer that takes longer than `timeout` [s] is given up; None waits for ever.
    """

    def __init__(self, path: Path, timeout: float | None) -> None:
        self._path = path
        self._timeout = timeout
        self._connection: socket.socket | None = None
        self._lock = threading.Lock()

    def connect(self) -> None:
        """Connect unless connected; OSError if the simulator is not there."""
        with self._lock:
            self._connected()

    def close(self) -> None:
        """Hang up; the next transaction would connect again."""
        with self._lock:
            self._drop()

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Carry out one transaction. A lost connection fails it at once, the next one connects."""
        with self._lock:
            connection = self._connected()
            try:
                send_frame(connection, pack_request(messages))
                body = receive_frame(connection)
            except OSError as error:
                self._drop()  # an answer that comes late must not be taken for the next one
                number = error.errno or errno.ETIMEDOUT
                raise OSError(number, os.strerror(number)) from error
        return self._unpack(body, messages)

    def _unpack(self, body: bytes, messages: Sequence[Message]) -> list[bytes]:
        (number,) = _ERRNO.unpack_from(body)
        if number:
            raise OSError(number, os.strerror(number))
        parts = []
        at = _ERRNO.size
        for message in messages:
            if message.read:
                parts.append(body[at : at + message.length])
                at += message.length
        if at != len(body):
            raise OSError(errno.EPROTO, "the simulator's answer has the wrong length")
        return parts

    def _connected(self) -> socket.socket:
        if self._connection is None:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                connection.settimeout(self._timeout)
                connection.connect(str(self._path))
            except OSError:
                connection.close()
                raise
            self._connection = connection
        return self._connection

    def _drop(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
