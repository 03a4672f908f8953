"""What no test machine has, and what stands in its place while the documents are carried out.

Everything else in them runs as it is written, at most made to end sooner (`documents.SHORTER`).
"""

from __future__ import annotations

import os
import re
from pathlib import Path

STAND_INS = {
    "10.0.0.1": "no second machine: the robot is this one, at another address of its loopback",
    "scp": "no second machine: copies into the folder that is the robot's home",
    "ssh": "no second machine: runs in the folder that is the robot's home",
    "sudo": "changes the machine: files go below a folder, systemd's own tools look at them there",
    "pip": "no network: what is built from this checkout is installed, without its dependencies",
    "make": "the environment is the one in which the tests run: nothing is installed into it",
    "make test": "would run itself: make says what it would run",
    "lodeline calibrate": "no hands: the simulated robot drives as the reader pushes his",
}
"""By the word that a line holds; each with its reason. Asserted to be all that there is."""

ADDRESS = "10.0.0.1"
NO_NETWORK = {"PIP_NO_INDEX": "1", "PIP_NO_DEPS": "1", "PIP_NO_BUILD_ISOLATION": "0"}
PUSHES = {
    "lodeline calibrate mag": "v=0 w=2.5 --rate 20 -n 97",
    "lodeline calibrate wheels --distance": "v=0.4 w=0 --rate 20 -n 41",  # 1 m, see SHORTER
    "lodeline calibrate wheels --turns": "v=0 w=3.99 --rate 20 -n 54",  # twice round
}
"""`lodeline topic pub cmd_vel` with this, once a calibration says that it is time to move."""

PROGRAMS = {
    "scp": """
[ "$1" != -r ] || shift
for last; do :; done
while [ $# -gt 1 ]; do cp -r "$1" "$ROBOT/${last#robot:}"; shift; done
""",
    "ssh": """
shift; cd "$ROBOT"; exec "$@"
""",
    "sudo": """
case "$1" in
tee) mkdir -p "$(dirname "$MACHINE$2")" && exec tee "$MACHINE$2" ;;
systemctl)
    [ "$2 $3" = "enable --now" ] || exit 2
    systemd-analyze verify "$MACHINE/etc/systemd/system/$4.service" &&
        exec systemctl --root="$MACHINE" enable "$4" ;;
usermod) [ "$2 $3" = "-aG i2c" ] && id "$4" > "$MACHINE/i2c" ;;
*) echo "what would 'sudo $*' do?" >&2; exit 2 ;;
esac
""",
}


def programs(folder: Path) -> Path:
    """A folder to put first on the path."""
    folder.mkdir()
    for name, text in PROGRAMS.items():
        file = folder / name
        file.write_text(f"#!/bin/sh -e{text}")
        file.chmod(0o755)
    return folder


def used(line: str) -> set[str]:
    """Which of the stand-ins a line of a document needs."""
    return {word for word in STAND_INS if re.search(rf"(?<!\w){re.escape(word)}(?!\w)", line)}


def another_address() -> str:
    """One of the loopback's, that no other test at the same time has."""
    number = os.getpid()
    return f"127.{1 + number // 65025 % 254}.{1 + number // 255 % 255}.{1 + number % 254}"
