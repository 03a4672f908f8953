"""Claims about the gateway: what it sends, to whom, how much, and what it lets a page do."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import Awaitable, Callable
from functools import partial
from itertools import pairwise
from typing import Any

import pytest

from lodeline.dash import client as client_module
from lodeline.dash import link as link_module
from lodeline.dash.client import AHEAD, Viewer
from lodeline.dash.frames import Frame, Past
from lodeline.dash.gateway import TOP_RATE, TOP_SPEED, Gateway
from lodeline.sessions import Client
from tests.dash.support import Dash, Ear, Reader, connecting, with_reader
from tests.support.live import Up, eventually

Talk = Callable[[Reader], Awaitable[Any]]


def in_process(up: Up, monkeypatch: pytest.MonkeyPatch, talk: Talk) -> Any:
    """Talk to a gateway of this process, whose patience tests can shorten."""
    monkeypatch.setenv("LODELINE_RUN", str(up.run))

    async def run() -> Any:
        async with Gateway("rover") as gateway, connecting(gateway.port) as socket:
            reader = Reader(socket)
            await reader.say(do="hello", token=gateway.token)
            return await talk(reader)

    return asyncio.run(run())


def test_frames_carry_what_zenoh_carried(up: Up, dash: Dash) -> None:
    ear = Ear(up, "pose", "odom", "attitude", "truth")
    assert all(ear.hears(key, lambda _: True) for key in ("pose", "odom", "attitude", "truth"))
    keys = {"pose", "odom", "attitude", "truth"}

    async def talk(reader: Reader) -> list[dict[str, Any]]:
        while not keys <= (await reader.frames(1))[0]["keys"].keys():
            pass
        return await reader.frames(20)

    frames = with_reader(dash.port, talk)
    compared = turned = 0
    for frame in frames:
        for key in ("pose", "odom", "truth"):
            shown = frame["keys"][key]
            sent = ear.all(key).get(shown["seq"])
            if sent is None:
                continue  # from before we listened
            compared += 1
            assert shown["x"] == pytest.approx(sent.x, rel=1e-6, abs=1e-9)
            assert shown["y"] == pytest.approx(sent.y, rel=1e-6, abs=1e-9)
            assert shown["yaw"] == pytest.approx(sent.yaw, rel=1e-6, abs=1e-9)
            assert shown["stamp"] == pytest.approx(sent.stamp * 1e-9, abs=2e-6)
        attitude = ear.all("attitude").get(frame["keys"]["attitude"]["seq"])
        if attitude is not None:
            turned += 1
            assert frame["keys"]["attitude"]["orientation"] == pytest.approx(
                attitude.orientation, rel=1e-6, abs=1e-9
            )
    ear.close()
    assert compared > 50 and turned > 15


def test_a_quick_page_gets_twenty_frames_a_second_each_newer(dash: Dash) -> None:
    frames = with_reader(dash.port, lambda reader: reader.frames(30))
    numbers = [frame["n"] for frame in frames]
    assert numbers == sorted(set(numbers))
    seconds = frames[-1]["at"] - frames[4]["at"]  # the first ones make up for what it missed
    assert 10.0 < 25 / seconds < 21.0


def test_a_slow_page_skips_frames_and_what_it_gets_is_new(dash: Dash) -> None:
    ages: list[float] = []

    async def talk(reader: Reader) -> list[int]:
        numbers: list[int] = []
        while len(numbers) < 14:
            frame = await reader.hear("frame")
            numbers.append(frame["n"])
            ages.append(time.time() - frame["at"])
            if len(numbers) >= AHEAD:
                await asyncio.sleep(0.25)
                await reader.say(ack=frame["n"])
        return numbers

    numbers = with_reader(dash.port, talk)
    late = numbers[AHEAD:]
    steps = [after - before for before, after in pairwise(late)]
    assert max(steps) >= 3
    assert max(ages) < 3.0
    assert sorted(ages)[len(ages) // 2] < 1.25  # four are on their way, 0.25 s each


def test_a_page_that_confirms_nothing_gets_four_frames_and_is_let_go(
    up: Up, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client_module, "PATIENCE_S", 1.0)

    async def talk(reader: Reader) -> tuple[int, float]:
        began, frames = time.monotonic(), 0
        async for text in _until_closed(reader):
            frames += json.loads(text)["t"] == "frame"
        return frames, time.monotonic() - began

    frames, seconds = in_process(up, monkeypatch, talk)
    assert frames == AHEAD
    assert 1.0 <= seconds < 8.0


async def _until_closed(reader: Reader) -> Any:
    from websockets.exceptions import ConnectionClosed

    try:
        while True:
            yield await asyncio.wait_for(reader.socket.recv(), 10.0)
    except ConnectionClosed:
        return


class Stuck:
    """A connection whose socket takes nothing."""

    def __init__(self) -> None:
        self.sent: list[str] = []

    async def send(self, text: str) -> None:
        self.sent.append(text)
        await asyncio.Event().wait()


def test_what_waits_for_a_page_that_reads_nothing_is_bounded() -> None:
    async def run() -> tuple[Stuck, Viewer]:
        past = Past()
        socket = Stuck()
        viewer = Viewer(socket, past)  # type: ignore[arg-type]
        viewer.greeted = True
        feeding = asyncio.create_task(viewer.feed())
        for number in range(5000):
            past.frames.append(Frame(number, '{"n":0', ()))
            viewer.frame_ready()
            viewer.post_status(f"status {number}")
            if number % 100 == 0:
                await asyncio.sleep(0)
        feeding.cancel()
        return socket, viewer

    socket, viewer = asyncio.run(run())
    assert len(socket.sent) == 1
    assert len(viewer._waiting) == 0
    assert len(viewer._sent) <= AHEAD
    assert viewer._next() == "status 4999"


def test_hits_of_skipped_frames_come_with_the_next_one() -> None:
    past = Past()
    for number in range(10):
        past.frames.append(Frame(number, f'{{"n":{number}', ((float(number), 0.0),)))
    found = past.since(6)
    assert found is not None
    frame, hits = found
    assert frame.number == 9
    assert hits == [(7.0, 0.0), (8.0, 0.0), (9.0, 0.0)]
    assert json.loads(frame.text(hits))["hits"] == [[7.0, 0.0], [8.0, 0.0], [9.0, 0.0]]
    assert past.since(9) is None


def test_a_page_opened_later_gets_the_last_minute_in_messages_of_64_kib(dash: Dash) -> None:
    async def talk(reader: Reader) -> tuple[list[int], int]:
        numbers, longest = [], 0
        while True:
            text = await asyncio.wait_for(reader.socket.recv(), 5.0)
            said = json.loads(text)
            longest = max(longest, len(text))
            if said["t"] == "past":
                numbers += [frame["n"] for frame in said["frames"]]
            elif said["t"] == "frame":
                return numbers, longest

    assert eventually(lambda: len(with_reader(dash.port, talk)[0]) > 40)
    numbers, longest = with_reader(dash.port, talk)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert longest <= 65_536


def test_status_tells_rates_ages_and_processes(up: Up, dash: Dash) -> None:
    status = with_reader(dash.port, lambda reader: reader.hear("status"))
    processes = up.ps()
    assert set(status["nodes"]) == set(processes)
    assert status["nodes"]["imu"]["rates"]["imu/data_raw"] == pytest.approx(200.0, rel=0.25)
    assert "odom" in status["nodes"]["ekf"]["age_p99"]

    async def talk(reader: Reader) -> dict[str, Any]:
        while not (said := await reader.hear("status"))["processes"]:
            await reader.say(ack=0)
        return said

    shown = {item["process"]: item for item in with_reader(dash.port, talk)["processes"]}
    assert {name: item["pid"] for name, item in shown.items()} == {
        name: item["pid"] for name, item in processes.items()
    }


def test_the_scene_tells_wiring_floor_and_promises(dash: Dash) -> None:
    scene = with_reader(dash.port, lambda reader: reader.hear("scene"))
    assert scene["badge"] == "SIMULATED"
    assert scene["drive"] is True
    wires = {(edge["from"], edge["key"], edge["to"]) for edge in scene["edges"]}
    assert ("odometry", "odom", "ekf") in wires
    assert (None, "cmd_vel", "simulator") in wires
    assert scene["floor"] == {"pitch": 0.055, "origin": [0.0, 0.0], "bar_x": 0.08, "gate": 9.21}
    assert scene["nodes"]["imu"]["rates"] == {"imu/data_raw": 200.0, "imu/mag_raw": 100.0}


def test_the_log_of_the_supervisor_comes_along(dash: Dash) -> None:
    async def talk(reader: Reader) -> list[str]:
        texts: list[str] = []
        while not any("up in " in text for text in texts):
            texts += [text for _at, _who, text in (await reader.hear("log"))["lines"]]
        return texts

    texts = with_reader(dash.port, talk)
    assert "9 nodes in 9 processes" in texts[0]


def test_a_driver_who_vanishes_leaves_a_robot_that_stops(up: Up, dash: Dash) -> None:
    ear = Ear(up, "cmd_vel")

    async def talk(reader: Reader) -> None:
        await reader.hear("frame")
        for count in (1, 2, 3):
            await reader.say(do="drive", forward=5.0, left=-0.5)
            assert await asyncio.to_thread(ear.hears_many, "cmd_vel", count)
        reader.socket.transport.abort()

    with_reader(dash.port, talk, dash.token)
    assert ear.hears("cmd_vel", lambda said: said.v == 0.0)
    said = list(ear.all("cmd_vel").values())
    assert (said[0].v, said[0].w) == (TOP_SPEED, -0.5 * TOP_RATE)
    assert [item.v for item in said] == [TOP_SPEED] * (len(said) - 1) + [0.0]
    ear.close()


def test_a_driver_who_falls_silent_is_stopped(up: Up, dash: Dash) -> None:
    ear = Ear(up, "cmd_vel")

    async def talk(reader: Reader) -> float:
        await reader.hear("frame")
        await reader.say(do="drive", forward=1.0, left=0.0)
        began = time.monotonic()
        assert await asyncio.to_thread(ear.hears, "cmd_vel", lambda said: said.v == 0.0)
        return time.monotonic() - began

    assert 0.25 < with_reader(dash.port, talk, dash.token) < 2.0
    assert [item.v for item in ear.all("cmd_vel").values()] == [TOP_SPEED, 0.0]
    ear.close()


def test_two_pages_do_not_drive_at_once(up: Up, dash: Dash) -> None:
    ear = Ear(up, "cmd_vel")

    async def run() -> str:
        async with connecting(dash.port) as one, connecting(dash.port) as two:
            first, second = Reader(one), Reader(two)
            for reader in (first, second):
                await reader.say(do="hello", token=dash.token)
                await reader.hear("frame")
            await first.say(do="drive", forward=0.0, left=0.1)
            assert await asyncio.to_thread(ear.hears, "cmd_vel", lambda said: said.w > 0.0)
            await second.say(do="drive", forward=1.0, left=0.0)
            text = str((await second.hear("refused"))["text"])
            # the first lets go, and the robot is stopped
            assert await asyncio.to_thread(ear.hears, "cmd_vel", lambda said: said.w == 0.0)
            return text

    assert "another page is driving" in asyncio.run(run())
    assert all(said.v == 0.0 for said in ear.all("cmd_vel").values())
    ear.close()


def test_a_restart_reaches_the_supervisor_that_takes_it(up: Up, dash: Dash) -> None:
    asked: list[str] = []

    def answer() -> bytes:
        asked.append("ekf")
        return b"restarting"

    supervisor = Client(up.folder)
    supervisor.serve("rover/@restart/elsewhere/ekf", answer)

    async def talk(reader: Reader) -> str:
        await reader.hear("frame")
        await reader.say(do="restart", node="ekf")
        return str((await reader.hear("note"))["text"])

    words = with_reader(dash.port, talk, dash.token)
    assert words.startswith("ekf: ")
    assert "restarting" in words
    supervisor.close()
    assert asked == ["ekf"]


def test_a_gateway_that_nobody_looks_at_leaves_the_bus_until_somebody_does(
    up: Up, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LODELINE_RUN", str(up.run))

    async def run() -> Any:
        changed = asyncio.Event()
        async with Gateway("rover") as gateway, asyncio.timeout(20.0):
            tell = partial(gateway._loop.call_soon_threadsafe, changed.set)
            monkeypatch.setattr(gateway._link, "_changed", tell)
            if gateway._link.run is None:
                await changed.wait()
            changed.clear()
            monkeypatch.setattr(link_module, "REST_S", 0.5)
            while gateway._link.run is not None:
                await changed.wait()
                changed.clear()
            monkeypatch.setattr(gateway._link, "_changed", gateway._link_changed)
            async with connecting(gateway.port) as socket:
                reader = Reader(socket)
                await reader.say(do="hello", token="")
                await reader.hear("scene")
                return await reader.hear_of("pose")

    assert math.isfinite(asyncio.run(run())["x"])
