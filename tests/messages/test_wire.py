"""Claims about the wire: bytes that stay, values that are checked, limits that hold."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any

import msgpack
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lodeline_msgs import (
    MESSAGES,
    DecodeError,
    Imu,
    MagnetDetection,
    Message,
    Unit,
    WheelTicks,
    class_of,
    encoding_of,
    field_specs,
    message,
    pack,
    unpack,
)
from lodeline_msgs.definition import unlisted
from tests.support.samples import FOLDER, SAMPLES, name_of


def edited(sample: Message, **changes: Any) -> bytes:
    """Bytes of a sample with some of its fields replaced; DROP takes one out."""
    values = dict(dataclasses.asdict(sample), **changes)
    return bytes(msgpack.packb({k: v for k, v in values.items() if v is not DROP}))


DROP = object()
IMU = SAMPLES[0]
STATUS = SAMPLES[-1]


def test_every_message_has_a_golden_sample() -> None:
    assert sorted(map(name_of, SAMPLES)) == sorted(MESSAGES)
    assert {file.stem for file in FOLDER.iterdir()} == set(MESSAGES)


@pytest.mark.parametrize("sample", SAMPLES, ids=name_of)
def test_packed_bytes_never_change(sample: Message) -> None:
    """But for fields that came later: they have a default, which an older sender's sample gets."""
    golden = (FOLDER / f"{name_of(sample)}.msgpack").read_bytes()
    known = msgpack.unpackb(golden)
    packed = msgpack.unpackb(pack(sample))
    assert msgpack.packb({name: packed[name] for name in packed if name in known}) == golden
    assert unpack(golden, type(sample)) == sample
    defaults = {field.name: field.default for field in dataclasses.fields(sample)}
    assert all(packed[name] == defaults[name] for name in packed.keys() - known.keys())


@pytest.mark.parametrize("sample", SAMPLES, ids=name_of)
def test_a_sample_is_one_map_of_field_names(sample: Message) -> None:
    values = msgpack.unpackb(pack(sample))
    assert list(values) == [field.name for field in dataclasses.fields(sample)]


@pytest.mark.parametrize("sample", SAMPLES, ids=name_of)
def test_the_encoding_names_the_class(sample: Message) -> None:
    assert encoding_of(type(sample)) == f"application/msgpack;{name_of(sample)}"
    assert class_of(encoding_of(type(sample))) is type(sample)


def test_an_unknown_class_is_named_in_the_error() -> None:
    with pytest.raises(DecodeError, match="Lidar"):
        class_of("application/msgpack;Lidar")


@pytest.mark.parametrize(
    ("sample", "changes", "text"),
    [
        (IMU, {"stamp": DROP}, "Imu: field 'stamp' is missing"),
        (IMU, {"angular_velocity": DROP}, "Imu: field 'angular_velocity' is missing"),
        (IMU, {"stamp": 1.5}, "Imu.stamp: float where int is expected"),
        (IMU, {"stamp": True}, "Imu.stamp: bool where int is expected"),
        (IMU, {"angular_velocity": [1.0, 2.0]}, "2 parts where 3 are expected"),
        (IMU, {"angular_velocity": 1.0}, "Imu.angular_velocity: float where an array is"),
        (IMU, {"angular_velocity": [1.0, "x", 2.0]}, r"angular_velocity\[1\]: str where a number"),
        (IMU, {"angular_velocity": [1.0, True, 2.0]}, r"angular_velocity\[1\]: bool where a num"),
        (IMU, {"angular_velocity": [1.0, math.nan, 2.0]}, r"angular_velocity\[1\]: nan is not"),
        (IMU, {"linear_acceleration": [0.0, 0.0, math.inf]}, r"\[2\]: inf is not a finite"),
        (IMU, {"linear_acceleration": [0.0, 0.0, 1 << 60]}, "is no exact float"),
        (SAMPLES[7], {"nis": math.nan}, "PoseEstimate.nis: nan is not a finite number"),
        (SAMPLES[7], {"nis": "1"}, "PoseEstimate.nis: str where a number"),
        (SAMPLES[7], {"ambiguous": 1}, "PoseEstimate.ambiguous: int where bool"),
        (SAMPLES[4], {"lateral": [0.1, math.nan]}, r"MagnetDetection.lateral\[1\]: nan"),
        (STATUS, {"node": 3}, "NodeStatus.node: int where str"),
        (STATUS, {"rates": [1.0]}, "NodeStatus.rates: a map from text is expected"),
        (STATUS, {"rates": {1: 1.0}}, "not msgpack"),
        (STATUS, {"rates": {"a": math.inf}}, r"NodeStatus.rates\['a'\]: inf"),
        (STATUS, {"lost": {"a": 1.0}}, r"NodeStatus.lost\['a'\]: float where int"),
    ],
)
def test_a_wrong_field_is_named(sample: Message, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(DecodeError, match=text):
        unpack(edited(sample, **changes), type(sample))


def test_an_integer_may_stand_where_a_float_belongs() -> None:
    taken = unpack(edited(IMU, angular_velocity=[1, 0, -2]), Imu)
    assert taken.angular_velocity == (1.0, 0.0, -2.0)
    assert all(type(part) is float for part in taken.angular_velocity)


def test_fields_of_a_newer_sender_are_skipped() -> None:
    assert unpack(edited(IMU, temperature=21.5), Imu) == IMU


def test_fields_with_a_default_may_be_missing() -> None:
    assert unpack(edited(IMU, seq=DROP), Imu) == dataclasses.replace(IMU, seq=0)


def test_an_array_of_open_length_may_be_empty() -> None:
    assert unpack(pack(MagnetDetection(1, ())), MagnetDetection).lateral == ()


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "not msgpack"),
        (b"\xc1", "not msgpack"),
        (pack(IMU)[:-1], "not msgpack"),
        (pack(IMU) + b"\x00", "not msgpack"),
        (msgpack.packb([1, 2, 3]), "a tuple where a map"),
        (msgpack.packb(None), "a NoneType where a map"),
        (b"\x81" * 2000 + b"\x01", "not msgpack"),
        (b"\x91" * 2000 + b"\x01", "not msgpack"),
        (b"\xdd\xff\xff\xff\xff", "not msgpack"),
        (b"\xdf\xff\xff\xff\xff", "not msgpack"),
        (msgpack.packb({"a": b"bin"}), "not msgpack"),
        (msgpack.packb({"a": [0.0] * 2000}), "not msgpack"),
        (b"\x81\xa2\xff\xfe\x01", "not msgpack"),
        (b"\x00" * 70_000, "payload of 70000 bytes"),
    ],
)
def test_what_is_no_message_is_refused(data: bytes, text: str) -> None:
    with pytest.raises(DecodeError, match=text):
        unpack(data, Imu)


@given(st.binary(max_size=300), st.sampled_from(sorted(MESSAGES)))
@example(b"\x81\xa5stamp\x01", "Imu")
@settings(max_examples=3000, deadline=None)
def test_any_bytes_give_a_message_or_a_decode_error(data: bytes, name: str) -> None:
    try:
        taken = unpack(data, MESSAGES[name])
    except DecodeError:
        return
    assert isinstance(taken, MESSAGES[name])


@given(st.data())
@settings(max_examples=1000, deadline=None)
def test_a_damaged_sample_never_gets_through_with_wrong_types(data: st.DataObject) -> None:
    sample = data.draw(st.sampled_from(SAMPLES))
    raw = bytearray(pack(sample))
    place = data.draw(st.integers(0, len(raw) - 1))
    raw[place] = data.draw(st.integers(0, 255))
    try:
        taken = unpack(bytes(raw), type(sample))
    except DecodeError:
        return
    assert unpack(pack(taken), type(sample)) == taken


def test_a_field_without_a_unit_is_refused_at_definition() -> None:
    with pytest.raises(TypeError, match=r"Bare\.height carries no unit"):

        @message
        class Bare(Message):
            height: float

    assert "Bare" not in MESSAGES


def test_a_field_may_have_any_name() -> None:
    """Of the words that the generated code uses for itself, none is in the way."""

    @unlisted
    class Anything(Message):
        type: Annotated[str, Unit("-")]
        values: Annotated[tuple[float, float], Unit("m")]
        cls: Annotated[int, Unit("1")]
        data: Annotated[float, Unit("m")] = 1.0
        self: Annotated[bool, Unit("-")] = False
        frozen: Annotated[int, Unit("1")] = 0

    sample = Anything(1, "a", (1.0, 2.0), 3, frozen=4, seq=2)
    assert unpack(pack(sample), Anything) == sample
    with pytest.raises(ValueError, match="begins with a letter"):

        @unlisted
        class Hidden(Message):
            _x: Annotated[int, Unit("1")]


def test_a_class_of_the_same_name_and_fields_is_the_same_class() -> None:
    """Two nodes may each define what they send to each other."""
    known: list[type] = [message(type("Turn", (Message,), {})) for _ in range(2)]
    del MESSAGES["Turn"]
    assert known[0] is known[1]


def test_every_array_names_its_parts() -> None:
    for cls in MESSAGES.values():
        for spec in field_specs(cls):
            if spec.length is not None:
                assert len(spec.unit.parts) == spec.length, f"{cls.__name__}.{spec.name}"


def test_messages_are_frozen_and_have_no_dict() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        IMU.stamp = 0  # type: ignore[misc]
    assert not hasattr(WheelTicks(1, 2, 3), "__dict__")


def test_who_forgets_a_field_is_told_the_class() -> None:
    with pytest.raises(TypeError, match=r"^WheelTicks\.__init__\(\) missing .* 'right'$"):
        WheelTicks(1, 2)  # type: ignore[call-arg]
