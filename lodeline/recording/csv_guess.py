"""A first map for a CSV table, from the names that people give to columns; theirs to correct."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence

_TIME = re.compile(r"(t|time|timestamp|stamp|secs?|seconds)[_ (\[]*(s|ms|us|ns|sec|seconds)?[)\]]*")
_AXIS = re.compile(r"(?P<stem>.*?)[_ .]?(?P<axis>[xyz])(?P<rest>[_ .(\[].*)?")
_STEMS = {
    "angular_velocity": r"g|gyro|gyr|gyroscope|w|omega|angular[_ ]?velocity",
    "linear_acceleration": r"a|acc|accel|accelerometer|acceleration|linear[_ ]?acceleration",
    "magnetic_field": r"m|b|mag|magnetometer|magnetic[_ ]?field",
}
_UNITS = {
    "angular_velocity": {"deg": "deg", "dps": "deg", "°": "deg"},
    "linear_acceleration": {"(g)": "g", "[g]": "g", "_g": "g"},
    "magnetic_field": {"ut": "uT", "µt": "uT", "gauss": "gauss", "(g)": "gauss"},
}
_SIDE = re.compile(r"(.*[_ .])?(?P<side>left|right|l|r)([_ .].*)?")


def propose(columns: Sequence[str]) -> str:
    """YAML of a map as far as the names of the columns tell; comments where they do not."""
    lines = [_time(columns), *_wheels(columns)]
    vectors = {field: _vector(columns, field) for field in _STEMS}
    if vectors["angular_velocity"] and vectors["linear_acceleration"]:
        lines += ["imu/data_raw:", "  type: Imu"]
        lines += [f"  {field}: {vectors[field]}" for field in list(_STEMS)[:2]]
    if vectors["magnetic_field"]:
        lines += ["imu/mag_raw:", "  type: MagneticField"]
        lines += [f"  magnetic_field: {vectors['magnetic_field']}"]
    if len(lines) == 1:
        lines.append("# no known sensor in the names of the columns: say what they are")
    return "\n".join(lines) + "\n"


def _time(columns: Sequence[str]) -> str:
    for column in columns:
        found = _TIME.fullmatch(column.lower())
        if found:
            unit = found[2] if found[2] in ("ms", "us", "ns") else ""
            return f"time: {_word(column, unit)}"
    return "time: WHICH_COLUMN  # seconds, or `column * ms`"


def _wheels(columns: Sequence[str]) -> Iterator[str]:
    sides = {
        found["side"][0]: column for column in columns if (found := _SIDE.fullmatch(column.lower()))
    }
    if len(sides) == 2:
        yield "wheels:"
        yield "  type: WheelTicks"
        yield f"  left: {_word(sides['l'])}    # counts since the start; differences: sum(...)"
        yield f"  right: {_word(sides['r'])}"


def _vector(columns: Sequence[str], field: str) -> str:
    axes: dict[str, str] = {}
    for column in columns:
        found = _AXIS.fullmatch(column.lower())
        if found and re.fullmatch(_STEMS[field], found["stem"]):
            rest = found["rest"] or ""
            units = [unit for word, unit in _UNITS[field].items() if word in rest]
            if found["stem"] in ("m", "mag"):  # nobody gives these in tesla
                units.append("uT")
            axes.setdefault(found["axis"], _word(column, *units[:1]))
    return f"[{', '.join(axes[axis] for axis in 'xyz')}]" if len(axes) == 3 else ""


def _word(column: str, unit: str = "") -> str:
    """A term as YAML takes it."""
    term = f"{column} * {unit}" if unit else column
    return term if re.fullmatch(r"[A-Za-z_][\w .*/]*", term) else json.dumps(term)
