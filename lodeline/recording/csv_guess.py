"""A first map for a CSV table, from the names that people give to columns; theirs to correct."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence

_TIME = re.compile(
    r"[\W_]*(?:.*[./])?"  # `%time`, `header.stamp`, `/imu/header/stamp`
    r"(?P<word>t|time|(?:rosbag)?timestamp|stamp|zeit|temps|elapsed|secs?|seconds|millis|micros)"
    r"[_ (\[/]*(?P<unit>s|ms|us|[µμ]s|ns|sec|seconds)?[)\]]*"
)
_UNITS_OF_TIME = {"ms": "ms", "millis": "ms", "us": "us", "micros": "us", "ns": "ns"}
_MICRO = str.maketrans("µμ", "uu")
_SIZES = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))  # of times since 1970, which tell their unit
_SECONDS = re.compile(r"(?P<stem>(?:.*[._/ ])?(?:stamp|time)?[._/ ]?)secs?")
_AXIS = re.compile(r"(?P<stem>.*)(?P<axis>[xyz])(?P<rest>[_ .(\[].*)?")
_STEMS = {
    "angular_velocity": r"g|gyro|gyr|gyroscope|w(_rs_s)?|omega|angular[_ ]?velocity",
    "linear_acceleration": r"a(_rs_s)?|acc|accel|accelerometer|(linear[_ ]?)?acceleration",
    "magnetic_field": r"m|b|mag|magnetometer|magnetic[_ ]?field",
}
_UNITS = {
    "angular_velocity": {"deg": "deg", "dps": "deg", "°": "deg"},
    "linear_acceleration": {"(g)": "g", "[g]": "g", "_g": "g"},
    "magnetic_field": {"ut": "uT", "µt": "uT", "gauss": "gauss", "(g)": "gauss"},
}
_POSE = re.compile(
    r"(?:(?:.*[./])?(?:pos|pose|position|truth|gt)[_ ./]?)?(?P<name>x|y|yaw|theta|psi)"
    r"(?:[_ (\[]*(?P<unit>mm|cm|m|deg|rad)[)\]]*)?"
)
_SIDE = re.compile(r"(.*[_ .])?(?P<side>left|links|right|rechts|l|r)([_ .].*)?")


def propose(columns: Sequence[str], first: Sequence[str] = ()) -> str:
    """YAML of a map as far as the names of the columns tell; comments where they do not.

    `first` are the cells of a row: how large a time is may tell its unit.
    """
    lines = [_time(columns, first), *_wheels(columns)]
    vectors = {field: _vector(columns, field) for field in _STEMS}
    if vectors["angular_velocity"] and vectors["linear_acceleration"]:
        lines += ["imu/data_raw:", "  type: Imu"]
        lines += [f"  {field}: {vectors[field]}" for field in list(_STEMS)[:2]]
    if vectors["magnetic_field"]:
        lines += ["imu/mag_raw:", "  type: MagneticField"]
        lines += [f"  magnetic_field: {vectors['magnetic_field']}"]
    lines += _pose(columns)
    if len(lines) == 1:
        lines.append("# no known sensor in the names of the columns: say what they are")
    return "\n".join(lines) + "\n"


def _time(columns: Sequence[str], first: Sequence[str]) -> str:
    small = {column.lower(): column for column in columns}
    for name in small:
        found = _SECONDS.fullmatch(name)
        if found is None:
            continue
        for word in ("nanosec", "nanosecs", "nsec", "nsecs"):
            if rest := small.get(f"{found['stem']}{word}"):
                return f"time: {_word(f'{small[name]} + {rest}', 'ns')}"
    # that of the header is when it was measured, others when it was written down
    for column in sorted(columns, key=lambda each: "header" not in each):
        found = _TIME.fullmatch(column.lower())
        if found:
            unit = _UNITS_OF_TIME.get((found["unit"] or found["word"]).translate(_MICRO), "")
            if not found["unit"] and not unit and len(first) == len(columns):
                unit = _unit_of(first[columns.index(column)])
            return f"time: {_word(column, unit)}"
    return "time: WHICH_COLUMN  # seconds, or `column * ms`"


def _unit_of(cell: str) -> str:
    """The unit of a time since 1970, by its size; "" for seconds and for what is none."""
    try:
        size = float(cell)
    except ValueError:
        return ""
    return next((unit for least, unit in _SIZES if size >= least), "")


def _wheels(columns: Sequence[str]) -> Iterator[str]:
    sides = {
        found["side"][0]: column for column in columns if (found := _SIDE.fullmatch(column.lower()))
    }
    if len(sides) == 2:
        yield "wheels:"
        yield "  type: WheelTicks"
        yield f"  left: {_word(sides['l'])}    # counts since the start; differences: sum(...)"
        yield f"  right: {_word(sides['r'])}"


def _pose(columns: Sequence[str]) -> Iterator[str]:
    """A table that says where the robot was is held against by `lodeline compare`."""
    terms: dict[str, str] = {}
    for column in columns:
        found = _POSE.fullmatch(column.lower())
        if found:
            unit = found["unit"] if found["unit"] in ("mm", "cm", "deg") else ""
            name = found["name"] if found["name"] in "xy" else "yaw"
            terms.setdefault(name, _word(column, unit))
    if len(terms) == 3:
        yield "truth:"
        yield "  type: Odometry"
        yield from (f"  {name}: {terms[name]}" for name in ("x", "y", "yaw"))
        yield from ("  v: 0", "  w: 0")
        yield "  pose_covariance: [0, 0, 0, 0, 0, 0, 0, 0, 0]"
        yield "  twist_covariance: [0, 0, 0, 0]"
        yield "  interval: 0"


def _vector(columns: Sequence[str], field: str) -> str:
    axes: dict[str, str] = {}
    for column in columns:
        found = _AXIS.fullmatch(column.lower())
        stem = found["stem"].rstrip("_ ./") if found else ""
        if found and re.fullmatch(rf"(?:.*[./])?(?:{_STEMS[field]})", stem):
            rest = found["rest"] or ""
            units = [unit for word, unit in _UNITS[field].items() if word in rest]
            if stem in ("m", "mag"):  # nobody gives these in tesla
                units.append("uT")
            axes.setdefault(found["axis"], _word(column, *units[:1]))
    return f"[{', '.join(axes[axis] for axis in 'xyz')}]" if len(axes) == 3 else ""


def _word(column: str, unit: str = "") -> str:
    """A term as YAML takes it."""
    term = f"{column} * {unit}" if unit else column
    return term if re.fullmatch(r"[A-Za-z_][\w .*/+]*", term) else json.dumps(term)
