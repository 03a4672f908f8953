"""A simulated robot finds itself, in a browser.

Starts the default pipeline as `lodeline up` does, and opens its page as `lodeline dash` does. Where
no display is, the link is printed only. Ctrl-C ends both. The exit code is that of `lodeline up`, 0
after --seconds.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lodeline.terminal.numbers import seconds

if TYPE_CHECKING:
    from lodeline.supervisor.notify import NotifySocket


def main(argv: list[str]) -> int:
    """Run `lodeline demo`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.pipeline.load import PipelineError, find, load

    try:
        pipeline = load(find(arguments.file))
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 3
    words = [str(pipeline.file)]
    words += [] if arguments.seconds is None else ["--seconds", f"{arguments.seconds:g}"]
    return asyncio.run(_demo(pipeline.name, words))


def parser() -> argparse.ArgumentParser:
    """What `lodeline demo` takes."""
    made = argparse.ArgumentParser(
        "lodeline demo",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument(
        "file",
        nargs="?",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    made.add_argument("--seconds", type=seconds, metavar="N", help="stop after N seconds")
    return made


async def _demo(name: str, words: list[str]) -> int:
    """The pipeline in a process of its own, the page in this one."""
    from lodeline.dash.gateway import Gateway
    from lodeline.dash.show import open_page
    from lodeline.supervisor.environment import death_signal_prefix
    from lodeline.supervisor.notify import NotifySocket

    loop = asyncio.get_running_loop()
    with tempfile.TemporaryDirectory(prefix="lld") as folder:
        ear = NotifySocket(Path(folder) / "up")
        command = [*death_signal_prefix(), sys.executable, "-P", "-m", "lodeline", "up", *words]
        # A group of its own: Ctrl-C at the terminal is for us, and we pass it on, once.
        up = subprocess.Popen(command, env=_hears(ear.path), process_group=0)
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, up.send_signal, number)
        ended = loop.run_in_executor(None, up.wait)
        ready = asyncio.create_task(_ready(ear, up.pid))
        watched: list[asyncio.Future[Any]] = [ended, ready]
        await asyncio.wait(watched, return_when=asyncio.FIRST_COMPLETED)
        ready.cancel()
        ear.close()
        if ended.done():
            return ended.result()
        async with Gateway(name) as gateway:
            print(gateway.url, flush=True)
            await open_page(gateway.url)
            return await ended


def _hears(path: Path) -> dict[str, str]:
    return {**os.environ, "NOTIFY_SOCKET": str(path)}


async def _ready(ear: NotifySocket, pid: int) -> None:
    """Until the pipeline says that its sources run."""
    loop = asyncio.get_running_loop()
    said = asyncio.Event()
    loop.add_reader(ear, said.set)
    try:
        while ("READY", "1") not in list(ear.words(pid)):
            said.clear()
            await said.wait()
    finally:
        loop.remove_reader(ear)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
