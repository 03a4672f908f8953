"""Show a running pipeline in a browser: map, instruments, graph, health.

Serves one page on this machine only (127.0.0.1), with all it needs: it works offline. The link
that is printed holds a token; only a page opened with it can drive the robot and restart nodes.
With --rerun or --foxglove it is shown in these viewers instead; they come by
`pip install 'lodeline[viz]'`. Exit codes: 0 after --seconds, 1 the port is taken or the viewer is
missing, 2 usage, 4 nothing runs, 130 interrupted.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys

from lodeline.terminal.numbers import port, seconds

EXIT_FAILED, EXIT_NOTHING, EXIT_INTERRUPTED = 1, 4, 130


def main(argv: list[str]) -> int:
    """Run `lodeline dash`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.watch import NothingThereError, choose

    try:
        name = choose(arguments.name).manifest.name
    except NothingThereError as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING
    if arguments.rerun is not None or arguments.foxglove:
        return _show_elsewhere(name, arguments)
    try:
        return asyncio.run(_serve(name, arguments))
    except OSError as error:
        print(f"cannot serve on port {arguments.port}: {error.strerror}", file=sys.stderr)
        return EXIT_FAILED


def parser() -> argparse.ArgumentParser:
    """Options of `lodeline dash`."""
    made = argparse.ArgumentParser(
        prog="lodeline dash",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("--name", help="which pipeline, if several run")
    made.add_argument("--port", type=port, help="default: one that is free, for --foxglove 8765")
    made.add_argument("--open", action="store_true", help="open the page in a browser")
    made.add_argument("--seconds", type=seconds, metavar="N", help="stop after N seconds")
    viewers = made.add_mutually_exclusive_group()
    viewers.add_argument(
        "--rerun",
        nargs="?",
        const="",
        metavar="OUT.rrd|URL",
        help="show it in Rerun: opens the viewer, or writes a file, or sends to rerun+http://...",
    )
    viewers.add_argument("--foxglove", action="store_true", help="serve it to Foxglove's app")
    return made


def _show_elsewhere(name: str, arguments: argparse.Namespace) -> int:
    from lodeline.recording.live import interrupts
    from lodeline.viewers import NoViewerError
    from lodeline.viewers.drawing import Canvas
    from lodeline.viewers.feed import feed
    from lodeline.viewers.foxglove_canvas import DEFAULT_PORT, FoxgloveCanvas
    from lodeline.viewers.rerun_canvas import RerunCanvas

    canvas: Canvas
    try:
        if arguments.foxglove:
            wanted = DEFAULT_PORT if arguments.port is None else arguments.port
            canvas = FoxgloveCanvas(name, wanted)
            print(canvas.url, flush=True)
            print("open this connection in Foxglove; stop: Ctrl-C", file=sys.stderr, flush=True)
        else:
            canvas = RerunCanvas(name, arguments.rerun)
            print(f"{name} in Rerun; stop: Ctrl-C", file=sys.stderr, flush=True)
    except NoViewerError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    with interrupts() as interrupted:
        feed(name, canvas, arguments.seconds, interrupted)
        canvas.close()
        return EXIT_INTERRUPTED if interrupted.by_hand else 0


async def _serve(name: str, arguments: argparse.Namespace) -> int:
    from lodeline.dash.gateway import Gateway
    from lodeline.dash.show import open_page

    loop = asyncio.get_running_loop()
    over: asyncio.Future[int] = loop.create_future()
    for number, code in ((signal.SIGINT, EXIT_INTERRUPTED), (signal.SIGTERM, 0)):
        loop.add_signal_handler(number, _end, over, code)
    async with Gateway(name, arguments.port or 0) as gateway:
        print(gateway.url, flush=True)
        print(f"{name} in a browser; stop: Ctrl-C", file=sys.stderr, flush=True)
        if arguments.open:
            await open_page(gateway.url)
        serving = asyncio.create_task(gateway.wait())
        serving.add_done_callback(lambda task: _failed(over, task))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(arguments.seconds):
                return await over
    return 0


def _failed(over: asyncio.Future[int], serving: asyncio.Task[None]) -> None:
    """A bug of ours must end the program, not leave a page that stands still."""
    if not serving.cancelled() and not over.done() and (error := serving.exception()):
        over.set_exception(error)


def _end(over: asyncio.Future[int], code: int) -> None:
    if not over.done():
        over.set_result(code)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
