"""A simulated robot on a bus that can be made to fail, with a clock that tests turn."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

from lodeline.i2c import Bus, open_model
from lodeline.sim.adapter import Message
from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot

T = TypeVar("T")


class Rig:
    """`fail(address)` says with which errno a transaction fails (0: not at all)."""

    def __init__(self, params: RobotParams) -> None:
        self.now = 0.0
        self.fail: Callable[[int], int] = lambda address: 0
        self.transactions = 0
        self.latency = 0.0  # s that a transaction takes, before its chip answers
        self.robot = SimulatedRobot(params, lambda: self.now)
        self.bus: Bus = open_model(self)

    def clock(self) -> float:
        """The time [s]."""
        return self.now

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Stand between the driver's bus and the robot's."""
        self.transactions += 1
        self.now += self.latency
        number = self.fail(messages[0].address)
        if number:
            raise OSError(number, os.strerror(number))
        return self.robot.bus.transfer(messages)

    def run(self, seconds: float, rate: float, read: Callable[[float], T]) -> list[tuple[float, T]]:
        """Read `rate` times a second for some seconds; (time, what was read)."""
        begin, got = self.now, []
        for i in range(1, round(seconds * rate) + 1):
            now = self.now = begin + i / rate
            got.append((now, read(now)))
        return got


MakeRig = Callable[..., Rig]
