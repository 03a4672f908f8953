"""Real-time priority and processor of a process, as far as the kernel grants them."""

from __future__ import annotations

import getpass
import os
from collections.abc import Collection

from lodeline.supervisor.plan import Plan


def grant(pid: int, plan: Plan) -> tuple[str, str]:
    """Apply what the plan asks for; (what holds now, what was refused and what to do).

    To be called before the process has made threads: they inherit both.
    """
    granted, refused = [], []
    if plan.priority is not None:
        word = f"FIFO {plan.priority}"
        try:
            os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(plan.priority))
            granted.append(word)
        except OSError as error:
            line = f"{_user()} - rtprio {plan.priority}"
            refused.append(f"{word} ({error.strerror}): add `{line}` to /etc/security/limits.conf")
    if plan.cpus:
        word = f"cpu {_listed(plan.cpus)}"
        try:
            os.sched_setaffinity(pid, plan.cpus)
            granted.append(word)
        except OSError as error:
            there = _listed(os.sched_getaffinity(0))
            refused.append(f"{word} ({error.strerror}): this machine lets us use {there}")
    return ", ".join(granted), "; ".join(refused)


def _listed(cpus: Collection[int]) -> str:
    return ",".join(str(cpu) for cpu in sorted(cpus))


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.geteuid())
