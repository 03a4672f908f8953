"""Serves a bus model over a unix socket, so that drivers in other processes share one world."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import threading
from pathlib import Path

from lodeline.sim.adapter import Transfer
from lodeline.sim.wire import pack_answer, receive_frame, send_frame, unpack_request


class I2cServer:
    """A thread that accepts clients and one that serves each of them, until closed.

    The socket is readable for its owner only (0600). A stale socket file is replaced; a path
    that another server listens on is refused with OSError EADDRINUSE.
    """

    def __init__(self, bus: Transfer, path: Path) -> None:
        self._bus = bus
        self._path = path
        self._clients: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._listener, self._inode = _listen(path)
        self._thread = threading.Thread(target=self._accept, name="i2c-accept", daemon=True)
        self._thread.start()

    def __enter__(self) -> I2cServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop serving, cut every client off and remove the socket file if it is still ours."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            clients = list(self._clients)
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)  # wakes the thread in accept
        self._thread.join(1.0)
        self._listener.close()
        for client in clients:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            if self._path.stat().st_ino == self._inode:
                self._path.unlink()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            with self._lock:
                if self._closed:
                    client.close()
                    return
                self._clients.add(client)
            name = f"i2c-client-{client.fileno()}"
            threading.Thread(target=self._serve, args=(client,), name=name, daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        try:
            while True:
                send_frame(client, self._answer(receive_frame(client)))
        except OSError:
            pass  # the client left, or the server closes
        finally:
            with self._lock:
                self._clients.discard(client)
            client.close()

    def _answer(self, body: bytes) -> bytes:
        try:
            return pack_answer(0, self._bus.transfer(unpack_request(body)))
        except ValueError:
            return pack_answer(errno.EINVAL)
        except OSError as error:
            return pack_answer(error.errno or errno.EIO)


def _listen(path: Path) -> tuple[socket.socket, int]:
    """Bind beside the path and move into place: no moment without a socket that answers."""
    if _answers(path):
        raise OSError(errno.EADDRINUSE, f"another simulator serves {path}")
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        os.fchmod(listener.fileno(), 0o600)  # before bind: Linux gives the file this mode
        beside.unlink(missing_ok=True)
        listener.bind(str(beside))
        listener.listen()
        inode = beside.stat().st_ino
        beside.rename(path)
    except OSError as error:
        listener.close()
        raise OSError(error.errno or errno.EINVAL, f"cannot serve {path}: {error}") from error
    return listener, inode


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True
