"""One life of a process: its group, its pipes, its end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence

from lodeline.supervisor.logs import LogPipe


class Process:
    """A program started in a process group of its own. `emit(text)` gets each line it prints.

    OSError if it cannot be started. To be made in the main thread, with an event loop running.
    """

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str], emit: Callable[[str], None]
    ) -> None:
        self.log = LogPipe(emit, time.monotonic)
        try:
            self._popen = subprocess.Popen(
                command,
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=self.log.writer,
                stderr=self.log.writer,
                env=environment,
                start_new_session=True,
            )
        except OSError:
            self.log.close()
            raise
        finally:
            os.close(self.log.writer)
        self.pid = self._popen.pid
        assert self._popen.stdin is not None
        self._stdin = self._popen.stdin
        os.set_blocking(self._stdin.fileno(), False)
        self._pidfd = os.pidfd_open(self.pid)
        loop = asyncio.get_running_loop()
        self._ended: asyncio.Future[None] = loop.create_future()
        loop.add_reader(self._pidfd, self._end)
        loop.add_reader(self.log.reader, self._read_log)

    async def ended(self) -> None:
        """Returns when it has ended; it is not yet reaped, its number still its own."""
        await self._ended

    def tell(self, order: str) -> None:
        """A line on its standard input."""
        with contextlib.suppress(OSError):  # it just died
            os.write(self._stdin.fileno(), f"{order}\n".encode())

    def abort(self) -> None:
        """SIGABRT to the process itself: faulthandler shows on the log where it hangs."""
        with contextlib.suppress(OSError):
            os.kill(self.pid, signal.SIGABRT)

    def signal_group(self, number: int) -> None:
        """A signal to it and to its helpers."""
        with contextlib.suppress(OSError):
            os.killpg(self.pid, number)

    def bury(self) -> int:
        """Clear away what is left of it; the exit code, or minus the signal that ended it."""
        self.signal_group(signal.SIGKILL)
        loop = asyncio.get_running_loop()
        loop.remove_reader(self.log.reader)
        loop.remove_reader(self._pidfd)
        os.close(self._pidfd)
        self.log.drain()
        self.log.close()
        self._stdin.close()
        return self._popen.wait()

    def _end(self) -> None:
        asyncio.get_running_loop().remove_reader(self._pidfd)
        if not self._ended.done():
            self._ended.set_result(None)

    def _read_log(self) -> None:
        if not self.log.read() and self.log.ended:
            asyncio.get_running_loop().remove_reader(self.log.reader)
