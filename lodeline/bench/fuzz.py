"""Whatever comes in as a sample: a million mangled payloads, and only the documented exception.

Payloads are packed samples of every message class that were cut, flipped, spliced, or had values
exchanged, and plain noise. A payload that passes must be finite in every number and pack again.
Exit codes: 0 nothing else was raised, 1 something was; the payload is printed.
"""

from __future__ import annotations

import argparse
import random
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import fields
from math import isfinite
from typing import Any

import msgpack

from lodeline.terminal.numbers import count
from lodeline_msgs import MESSAGES, DecodeError, Message, field_specs, pack, unpack

ODD: tuple[Any, ...] = (
    *(None, True, -1, 2**64 - 1, -(2**63), 1 << 53, (1 << 53) + 1, 0.0, -0.0, 5e-324, 1.8e308),
    *(
        float("nan"),
        float("inf"),
        float("-inf"),
        "",
        "x" * 9000,
        b"bytes",
        (),
        (1.0,),
        {},
        {"a": 1},
    ),
    *((float("nan"),) * 3, (1, 2, 3), ("a", "b", "c"), {1: 2}, {"k": float("nan")}, [[[[[]]]]]),
)


def main(argv: list[str]) -> int:
    """Run `lodeline bench fuzz`; the exit code."""
    arguments = parser().parse_args(argv)
    began = time.process_time()
    outcomes, culprit = fuzz(arguments.inputs, arguments.seed)
    seconds = time.process_time() - began
    for outcome, times in outcomes.most_common():
        print(f"{times:9d}  {outcome}")
    rate = arguments.inputs / max(seconds, 1e-9)
    print(f"{sum(outcomes.values())} payloads, seed {arguments.seed}, {rate:.0f} per second of CPU")
    if culprit is not None:
        print(f"not survived: {culprit!r}", file=sys.stderr)
    return 0 if culprit is None else 1


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench fuzz` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench fuzz",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--inputs", type=count, default=1_000_000, help="how many payloads")
    parser.add_argument("--seed", type=int, default=1)
    return parser


def fuzz(inputs: int, seed: int) -> tuple[Counter[str], tuple[str, bytes] | None]:
    """Outcomes and how often; the class and payload that raised what it must not, if any did."""
    draw = random.Random(seed)
    classes = list(MESSAGES.values())
    packed = {kind: [pack(_sample(kind, draw)) for _ in range(8)] for kind in classes}
    outcomes: Counter[str] = Counter()
    for _ in range(inputs):
        kind = draw.choice(classes)
        data = draw.choice(MANGLERS)(draw.choice(packed[kind]), draw)
        try:
            outcomes[_outcome(data, kind)] += 1
        except Exception as error:
            outcomes[f"NOT DOCUMENTED {type(error).__name__}: {error}"] += 1
            return outcomes, (kind.__name__, data)
    return outcomes, None


def _outcome(data: bytes, kind: type[Message]) -> str:
    try:
        message = unpack(data, kind)
    except DecodeError as error:
        return f"refused: {error.cause}"
    for item in fields(message):
        if not _finite(getattr(message, item.name)):
            raise AssertionError(f"{item.name} is not finite")
    if unpack(pack(message), kind) != message:
        raise AssertionError("it does not pack again")
    return "taken"


def _finite(value: Any) -> bool:
    if isinstance(value, float):
        return isfinite(value)
    if isinstance(value, tuple):
        return all(map(_finite, value))
    return all(map(_finite, value.values())) if isinstance(value, dict) else True


def _sample(kind: type[Message], draw: random.Random) -> Message:
    return kind(**{spec.name: _value(spec.kind, spec.length, draw) for spec in field_specs(kind)})


def _value(kind: Any, length: int | None, draw: random.Random) -> Any:
    if kind in (int, bool, str):
        return {int: draw.randrange(1 << 62), bool: draw.random() < 0.5, str: "word"}[kind]
    if kind is float:
        return draw.gauss(0.0, 10.0)
    if kind in (dict[str, float], dict[str, int]):
        value: Any = 2.5 if kind == dict[str, float] else 7
        return {f"robot/key{i}": value for i in range(3)}
    return tuple(draw.gauss(0.0, 1.0) for _ in range(length or 3))


def _cut(data: bytes, draw: random.Random) -> bytes:
    return data[: draw.randrange(len(data))]


def _flip(data: bytes, draw: random.Random) -> bytes:
    made = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 8))):
        made[draw.randrange(len(made))] ^= 1 << draw.randrange(8)
    return bytes(made)


def _splice(data: bytes, draw: random.Random) -> bytes:
    a, b = sorted(draw.randrange(len(data)) for _ in range(2))
    return data[:a] + draw.randbytes(draw.randrange(12)) + data[b:]


def _length_lie(data: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(data))
    tag = draw.choice((0xC6, 0xC9, 0xDB, 0xDD, 0xDF))
    return data[:place] + struct.pack(">BI", tag, draw.randrange(1 << 32)) + data[place:]


def _deep(_data: bytes, draw: random.Random) -> bytes:
    return draw.choice((b"\x91", b"\x81\xa1a", b"\x81\x91")) * draw.randrange(1, 4000) + b"\xc0"


def _noise(_data: bytes, draw: random.Random) -> bytes:
    return draw.randbytes(draw.randrange(200))


def _exchange(data: bytes, draw: random.Random) -> bytes:
    values = msgpack.unpackb(data)
    for _ in range(draw.choice((1, 1, 3))):
        name = draw.choice(list(values))
        if draw.random() < 0.2:
            values.pop(name)
        else:
            values[name] = draw.choice(ODD)
        if not values:
            break
    made: bytes = msgpack.packb(values)
    return made


def _same(data: bytes, _draw: random.Random) -> bytes:
    return data


MANGLERS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_cut, _flip, _flip, _splice, _splice, _length_lie, _deep),
    *(_noise, _exchange, _exchange, _exchange, _same),
)
