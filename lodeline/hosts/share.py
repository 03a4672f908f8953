"""A host's share of a pipeline: its claim on the bus, and what it tells the other hosts of it.

The claim is a liveliness token `NAME/@claim/HOST/RUN`; `NAME/@share/HOST/RUN` answers with the
share as JSON. RUN is new at each start, so that two machines that claim the same host differ.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lodeline.pipeline.model import Pipeline
from lodeline_msgs import MESSAGES, json_schema


@dataclass(frozen=True, slots=True)
class Share:
    """What one machine runs of a pipeline.

    `started` [s] is UNIX time on that machine, `classes` each key's message class, `forms` a
    hash of the fields of each class as that machine knows it, `params` those of its nodes: a
    calibration is one of them.
    """

    name: str
    host: str
    run: str
    machine: str
    pid: int
    started: float
    listen: str
    digest: str
    nodes: tuple[str, ...]
    classes: Mapping[str, str]
    forms: Mapping[str, str]
    params: Mapping[str, Any]

    @property
    def claim(self) -> str:
        """Key of the liveliness token."""
        return claim_key(self.name, self.host, self.run)

    @property
    def key(self) -> str:
        """Key of the query for this share."""
        return f"{self.name}/@share/{self.host}/{self.run}"

    def to_json(self) -> bytes:
        return json.dumps(asdict(self)).encode()

    @classmethod
    def from_json(cls, data: bytes) -> Share:
        """ValueError, KeyError or TypeError if another version wrote it."""
        values = json.loads(data)
        values["nodes"] = tuple(values["nodes"])
        return cls(**values)


def share_of(pipeline: Pipeline, hosts: Sequence[str], word: str, listen: str = "") -> Share:
    """The share of hosts, known by `word` on the bus, that this process is about to run."""
    types = pipeline.key_types()
    specs = [spec for spec in pipeline.nodes if spec.host in hosts]
    return Share(
        name=pipeline.name,
        host=word,
        run=os.urandom(6).hex(),
        machine=platform.node(),
        pid=os.getpid(),
        started=time.time(),
        listen=listen,
        digest=pipeline.digest,
        nodes=tuple(spec.name for spec in specs),
        classes={key: cls.__name__ for key, cls in types.items()},
        forms={name: _form(name) for name in sorted({cls.__name__ for cls in types.values()})},
        params={spec.name: spec.values for spec in specs},
    )


def _form(name: str) -> str:
    """Hash over the fields of a message class, their types and units."""
    text = json.dumps(json_schema(MESSAGES[name]), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def claim_key(name: str, host: str, run: str) -> str:
    return f"{name}/@claim/{host}/{run}"


def claimed(key: str) -> tuple[str, str]:
    """Host and run of a claim."""
    host, run = key.split("/")[-2:]
    return host, run


def differences(ours: Share, theirs: Share) -> list[str]:
    """What of their share does not fit ours, in words."""
    found = []
    if theirs.digest != ours.digest:
        found.append(f"{theirs.host} runs pipeline {theirs.digest}, {ours.host} runs {ours.digest}")
    found += [
        f"{key} is {theirs.classes[key]} on {theirs.host}, {ours.classes[key]} on {ours.host}"
        for key in sorted(ours.classes.keys() & theirs.classes.keys())
        if ours.classes[key] != theirs.classes[key]
    ]
    found += [
        f"{name} has other fields on {theirs.host} than on {ours.host}"
        for name in sorted(ours.forms.keys() & theirs.forms.keys())
        if ours.forms[name] != theirs.forms[name]
    ]
    return found


def taken(ours: Share, theirs: Share | None) -> str:
    """Why a second start of a share is refused; `theirs` is None if its holder did not say."""
    text = f"NAME_TAKEN {ours.name}: host {ours.host!r} of it is up on "
    if theirs is None:
        text += "another machine"
    else:
        since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(theirs.started))
        at = f", listens on {theirs.listen}" if theirs.listen else ""
        text += f"machine {theirs.machine} (pid {theirs.pid} since {since}{at})"
    return f"{text}; stop it, or give this pipeline another name"
