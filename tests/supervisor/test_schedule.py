"""Real-time priority and processor: granted where the kernel lets us, else said and run on."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

PROGRAM = """
import json, os, resource, sys
from lodeline.supervisor.plan import Plan
from lodeline.supervisor.schedule import grant
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
cpus = frozenset(json.loads(sys.argv[1]))
plan = Plan("imu", "robot", ("imu",), ("true",), str, priority=20, cpus=cpus)
granted, refused = grant(os.getpid(), plan)
policy = os.sched_getscheduler(0) == os.SCHED_FIFO
print(json.dumps([granted, refused, policy, sorted(os.sched_getaffinity(0))]))
"""
BARE = ["setpriv", "--bounding-set=-sys_nice"]
"""Takes the right to it even from root."""


def asked(*prefix: str, cpus: list[int]) -> tuple[str, str, bool, list[int]]:
    command = [*prefix, sys.executable, "-c", PROGRAM, json.dumps(cpus)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 0, done.stderr
    granted, refused, fifo, where = json.loads(done.stdout)
    return granted, refused, fifo, where


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="no setpriv here: util-linux has it")
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can take a right from itself")
def test_a_refused_priority_is_said_with_the_line_to_add_and_the_process_runs_on() -> None:
    here = sorted(os.sched_getaffinity(0))
    granted, refused, fifo, where = asked(*BARE, cpus=here[:1])
    assert granted == f"cpu {here[0]}"
    assert refused.startswith("FIFO 20 (Operation not permitted): add `")
    assert "- rtprio 20` to /etc/security/limits.conf" in refused
    assert not fifo
    assert where == here[:1]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root is granted real-time priority for sure")
def test_what_is_granted_holds() -> None:
    here = sorted(os.sched_getaffinity(0))
    granted, refused, fifo, where = asked(cpus=here[-1:])
    assert (granted, refused) == (f"FIFO 20, cpu {here[-1]}", "")
    assert fifo
    assert where == here[-1:]


def test_a_processor_that_is_not_there_is_said_with_those_that_are() -> None:
    here = ",".join(map(str, sorted(os.sched_getaffinity(0))))
    _, refused, _, where = asked(cpus=[1000])
    assert f"cpu 1000 (Invalid argument): this machine lets us use {here}" in refused
    assert where == sorted(os.sched_getaffinity(0))
