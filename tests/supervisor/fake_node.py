"""A program that speaks the supervisor's protocol over plain sockets and misbehaves on demand."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time

BEAT_S = 0.2
MODE = sys.argv[1]
SLEEPER = [sys.executable, "-c", "import time; time.sleep(600)"]


def tell(text: str) -> None:
    """A line on the log; bare writes, for `stop` may come in the middle of another."""
    data = f"{text}\n".encode()
    while data:
        data = data[os.write(1, data) :]


def speak(text: str) -> None:
    """A datagram to the supervisor."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.sendto(text.encode(), os.environ["NOTIFY_SOCKET"])


def stop(_number: int, _frame: object) -> None:
    tell("bye")
    os._exit(0)


def start_helpers() -> None:
    """A helper in our group, one in a session of its own, one stopped, one without our marks."""
    near = subprocess.Popen(SLEEPER)
    far = subprocess.Popen(SLEEPER, start_new_session=True)
    still = subprocess.Popen(SLEEPER)
    os.kill(still.pid, signal.SIGSTOP)
    bare = subprocess.Popen(SLEEPER, env={})
    tell(f"helpers {near.pid} {far.pid} {still.pid} {bare.pid}")


def beat_through_a_child() -> None:
    """Fall silent, while a child of ours beats in our name."""
    code = f"""
import os, socket, time
notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
while os.getppid() != 1:
    notify.sendto(b"WATCHDOG=1", os.environ["NOTIFY_SOCKET"])
    time.sleep({BEAT_S})
"""
    subprocess.Popen([sys.executable, "-c", code])
    time.sleep(600)


def spin_without_a_beat() -> None:
    while True:
        pass


def flood() -> None:
    """Fifty thousand lines as fast as they go."""
    for i in range(50):
        tell("\n".join(f"flood {i * 1000 + j}" for j in range(1000)))
    tell("flood over")


def leak() -> None:
    """Take two megabytes more every twentieth of a second, and beat."""
    kept = []
    while True:
        speak("WATCHDOG=1")
        kept.append(b"x" * 2_000_000)
        time.sleep(0.05)


def serve() -> None:
    """Beat until told to stop."""
    while True:
        speak("WATCHDOG=1")
        if select.select([0], [], [], BEAT_S)[0]:
            text = os.read(0, 64)
            if not text:
                os._exit(0)
            act(text.decode().strip())


def act(order: str) -> None:
    """What each kind of node does once its sources are let go."""
    tell(f"order {order} at {time.monotonic()}")
    if MODE == "spin":
        spin_without_a_beat()
    elif MODE == "forge":
        beat_through_a_child()
    elif MODE == "flood":
        flood()
    elif MODE == "leak":
        leak()
    elif MODE == "done":
        sys.exit(0)
    elif MODE == "flood-and-die":
        flood()
        raise RuntimeError("after the flood")


def main() -> None:
    tell(f"start {os.getpid()}")
    signal.signal(signal.SIGTERM, stop)
    if MODE == "crash":
        raise RuntimeError("broken on purpose")
    if MODE.startswith("exit-"):
        sys.exit(int(MODE.removeprefix("exit-")))
    if MODE == "deaf":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if MODE == "never-ready":
        time.sleep(600)
    if MODE == "slow":
        time.sleep(0.4)
    if MODE == "tree":
        start_helpers()
    if MODE == "escape":
        tell("\x1b[31mred\x1b[0m \x1b]0;title\x07 bell")
    tell(
        f"launch {os.environ['LODELINE_LAUNCH']} secret {os.environ.get('SECRET_TOKEN', 'unseen')}"
    )
    tell(f"ready at {time.monotonic()}")
    speak("READY=1\nSTATUS=well")
    if MODE != "unlinked":
        speak("LINKED=1")
    serve()


main()
