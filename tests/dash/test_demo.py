"""Claims about `lodeline demo`: the default pipeline and its page in one command."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path

from lodeline.run_folder import running
from tests.dash.support import with_reader
from tests.support.live import ROOT, environment, eventually, living


@contextmanager
def demo(run: Path, *words: str, **more: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "lodeline", "demo", *words],
        cwd=ROOT,
        env=environment(run) | {"DISPLAY": "", "WAYLAND_DISPLAY": "", "BROWSER": ""} | more,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_the_page_of_a_running_robot_opens_with_the_token_and_ctrl_c_ends_both(
    short_folder: Path,
) -> None:
    seen = short_folder / "opened"
    browser = short_folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {seen}\n')
    browser.chmod(0o755)
    with demo(short_folder, BROWSER=f"{browser} %s") as process:
        assert process.stdout is not None
        link = process.stdout.readline().strip()
        port, token = link.removeprefix("http://127.0.0.1:").split("/#token=")
        hello = with_reader(int(port), lambda reader: reader.hear("hello"), token)
        assert hello["trusted"] is True
        pose = with_reader(int(port), lambda reader: reader.hear_of("pose"))
        assert isfinite(pose["x"])
        assert eventually(lambda: seen.exists() and seen.read_text().strip() == link)
        process.send_signal(signal.SIGINT)
        assert process.wait(15.0) == 130
    assert running(base=short_folder) == []
    assert eventually(lambda: living(f"LODELINE_RUN={short_folder}") == [])


def test_without_a_display_it_prints_the_link_and_ends_after_its_seconds(
    short_folder: Path,
) -> None:
    with demo(short_folder, "--seconds", "0.5") as process:
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert out.startswith("http://127.0.0.1:")
    assert out.count("\n") == 1
    assert "open the link yourself" in err


def test_a_demo_that_is_killed_leaves_nothing_behind(short_folder: Path) -> None:
    with demo(short_folder) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.kill()
        assert eventually(lambda: living(f"LODELINE_RUN={short_folder}") == [])


def test_what_up_refuses_ends_the_demo_with_its_code(short_folder: Path) -> None:
    with demo(short_folder, "nothing-here.yaml") as process:
        out, err = process.communicate(timeout=60.0)
    assert (process.returncode, out) == (3, "")
    assert "neither a file nor a profile" in err
