"""What a process gets from its supervisor's environment, and the signal it gets at its death."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping

from lodeline.memory import MAPPED_FROM

ALLOWED = {"PATH", "HOME", "LANG", "TZ", "TMPDIR", "XDG_RUNTIME_DIR"}
ALLOWED |= {"VIRTUAL_ENV", "LD_LIBRARY_PATH", "RUST_LOG"}
ALLOWED_PREFIXES = ("LC_", "PYTHON", "LODELINE_", "ZENOH_")
OURS = {
    "PYTHONFAULTHANDLER": "1",  # a stack on the log when the watchdog aborts
    "PYTHONUNBUFFERED": "1",
    "OPENBLAS_NUM_THREADS": "1",
    # Links that come and go with neighbours are made by threads that come and go: with an arena of
    # memory for each, what one gave back is not what the next one takes, and the process grows.
    "MALLOC_ARENA_MAX": "1",
    "MALLOC_MMAP_THRESHOLD_": str(MAPPED_FROM),  # 1 MB less in each
}


def environment(parent: Mapping[str, str]) -> dict[str, str]:
    """The part of the parent's environment that nodes may see, and what they need besides."""
    passed = {
        name: value
        for name, value in parent.items()
        if name in ALLOWED or name.startswith(ALLOWED_PREFIXES)
    }
    return passed | OURS


def death_signal_prefix() -> tuple[str, ...]:
    """Words before a command that have the kernel kill it when its supervisor dies.

    Empty where util-linux's setpriv is missing: the guard then does it alone. The command must
    be started by the main thread, for the kernel takes the death of that thread for the parent's.
    """
    setpriv = shutil.which("setpriv")
    if setpriv is None:
        return ()
    prefix = (setpriv, "--pdeathsig", "KILL", "--")
    known = subprocess.run([*prefix, "true"], capture_output=True, check=False)
    return prefix if known.returncode == 0 else ()
