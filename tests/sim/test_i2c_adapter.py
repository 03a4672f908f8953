"""smbus2's own code, unchanged, against chip models in this process."""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import smbus2
from smbus2 import I2cFunc, SMBus, i2c_msg

from lodeline.i2c import Bus, BusError, open_model
from lodeline.sim.bus import BusModel
from lodeline.sim.chips.registers import RegisterChip

ADDRESS = 0x50
ABSENT = 0x51


class Memory(RegisterChip):
    """256 bytes, as an EEPROM has them."""

    def __init__(self) -> None:
        super().__init__(lambda: 0.0)
        self.bytes = bytearray(256)

    def _begin(self, now: float) -> None:
        pass

    def _get(self, register: int) -> int:
        return self.bytes[register]

    def _set(self, register: int, value: int) -> None:
        self.bytes[register] = value


@pytest.fixture
def memory() -> Memory:
    return Memory()


@pytest.fixture
def bus(memory: Memory) -> Bus:
    model = BusModel()
    model.attach(ADDRESS, memory)
    return open_model(model)


def test_a_simulated_bus_is_an_smbus_with_a_raspberry_pis_abilities(bus: Bus) -> None:
    assert isinstance(bus, SMBus)
    assert bus.funcs & I2cFunc.I2C
    assert bus.funcs & I2cFunc.SMBUS_READ_I2C_BLOCK
    assert not bus.funcs & I2cFunc.SMBUS_READ_BLOCK_DATA


def test_bytes_go_through_register_and_pointer(bus: Bus, memory: Memory) -> None:
    bus.write_byte_data(ADDRESS, 0x10, 0xA5)
    assert memory.bytes[0x10] == 0xA5
    assert bus.read_byte_data(ADDRESS, 0x10) == 0xA5
    memory.bytes[0x20:0x22] = b"\x01\x02"
    bus.write_byte(ADDRESS, 0x20)
    assert [bus.read_byte(ADDRESS), bus.read_byte(ADDRESS)] == [1, 2]


def test_words_are_little_endian(bus: Bus, memory: Memory) -> None:
    bus.write_word_data(ADDRESS, 0x30, 0x1234)
    assert memory.bytes[0x30:0x32] == b"\x34\x12"
    assert bus.read_word_data(ADDRESS, 0x30) == 0x1234
    assert bus.process_call(ADDRESS, 0x40, 0xBEEF) == 0
    assert memory.bytes[0x40:0x42] == b"\xef\xbe"


@pytest.mark.parametrize("length", [1, 14, 32])
def test_blocks_come_back_as_they_went(bus: Bus, length: int) -> None:
    data = [(7 * i + 3) & 0xFF for i in range(length)]
    bus.write_i2c_block_data(ADDRESS, 0x60, data)
    assert bus.read_i2c_block_data(ADDRESS, 0x60, length) == data


def test_an_smbus_block_carries_its_length(bus: Bus, memory: Memory) -> None:
    bus.write_block_data(ADDRESS, 0x70, [9, 8, 7])
    assert memory.bytes[0x70:0x74] == b"\x03\x09\x08\x07"


def test_what_the_adapter_cannot_do_is_refused(bus: Bus) -> None:
    with pytest.raises(OSError) as caught:
        bus.read_block_data(ADDRESS, 0)
    assert caught.value.errno == errno.EOPNOTSUPP


def test_combined_messages_carry_more_than_a_block(bus: Bus, memory: Memory) -> None:
    memory.bytes[:] = bytes(range(256))
    out, got = i2c_msg.write(ADDRESS, [0x08]), i2c_msg.read(ADDRESS, 200)
    bus.i2c_rdwr(out, got)
    assert bytes(got) == bytes(range(8, 208))
    bus.i2c_rdwr(i2c_msg.write(ADDRESS, [0x08, 1, 2, 3]))
    assert memory.bytes[8:11] == b"\x01\x02\x03"


CALLS: list[Callable[[Bus], object]] = [
    lambda bus: bus.write_quick(ABSENT),
    lambda bus: bus.read_byte(ABSENT),
    lambda bus: bus.write_byte(ABSENT, 1),
    lambda bus: bus.read_byte_data(ABSENT, 1),
    lambda bus: bus.write_byte_data(ABSENT, 1, 1),
    lambda bus: bus.read_word_data(ABSENT, 1),
    lambda bus: bus.write_word_data(ABSENT, 1, 1),
    lambda bus: bus.read_i2c_block_data(ABSENT, 1, 4),
    lambda bus: bus.write_i2c_block_data(ABSENT, 1, [1, 2]),
    lambda bus: bus.i2c_rdwr(i2c_msg.write(ABSENT, [1]), i2c_msg.read(ABSENT, 1)),
]


@pytest.mark.parametrize("call", CALLS)
def test_an_absent_address_is_errno_121(bus: Bus, call: Callable[[Bus], object]) -> None:
    with pytest.raises(OSError) as caught:
        call(bus)
    assert caught.value.errno == 121
    assert bus.read_byte_data(ADDRESS, 0) == 0, "the bus goes on"


def test_addresses_of_more_than_seven_bits_are_refused(bus: Bus) -> None:
    with pytest.raises(OSError) as caught:
        bus.read_byte(0x80)
    assert caught.value.errno == errno.EINVAL


def test_other_descriptors_reach_the_real_ioctl(bus: Bus) -> None:
    with pytest.raises(OSError) as caught:
        SMBus(os.devnull)
    assert caught.value.errno == errno.ENOTTY
    assert bus.read_byte_data(ADDRESS, 0) == 0


def test_a_closed_bus_hands_its_descriptor_back(bus: Bus) -> None:
    fd = bus.fd
    assert fd is not None
    bus.close()
    bus.close()
    again = os.open(os.devnull, os.O_RDWR)
    try:
        assert again == fd, "the lowest free number is the one just given up"
        with pytest.raises(OSError) as caught:
            smbus2.smbus2.ioctl(again, smbus2.smbus2.I2C_FUNCS)  # type: ignore[attr-defined]
        assert caught.value.errno == errno.ENOTTY
    finally:
        os.close(again)


def test_reopening_keeps_the_bus_usable_and_leaks_nothing(bus: Bus) -> None:
    bus.write_byte_data(ADDRESS, 1, 77)
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(20):
        bus.reopen()
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    assert bus.read_byte_data(ADDRESS, 1) == 77


def test_threads_with_a_bus_each_do_not_mix_transactions() -> None:
    model = BusModel()
    chips = {address: Memory() for address in (0x50, 0x52, 0x54, 0x56)}
    wrong: list[tuple[int, list[int]]] = []
    for address, chip in chips.items():
        chip.bytes[:] = bytes([address]) * 256
        model.attach(address, chip)

    def read(address: int) -> None:
        bus = open_model(model)
        for i in range(300):
            got = bus.read_i2c_block_data(address, i & 0x7F, 8)
            if got != [address] * 8:
                wrong.append((address, got))
        bus.close()

    threads = [threading.Thread(target=read, args=(address,)) for address in chips]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_a_real_bus_gets_a_short_timeout_and_can_be_opened_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[tuple[int, int, object]] = []

    def kernel(fd: int, request: int, argument: object = 0, mutate: bool = True) -> int:
        calls.append((fd, request, argument))
        return 0

    monkeypatch.setattr(fcntl, "ioctl", kernel)
    monkeypatch.setattr(smbus2.smbus2, "ioctl", kernel)
    bus = Bus(os.devnull)
    assert calls[0] == (bus.fd, 0x0702, 5), "50 ms in units of 10 ms, before anything else"
    bus.write_byte(0x20, 1)
    bus.reopen()
    bus.write_byte(0x20, 1)
    asked = [argument for _, request, argument in calls if request == smbus2.smbus2.I2C_SLAVE]
    assert asked == [0x20, 0x20], "a new descriptor is told the address again"
    bus.close()


def test_a_missing_bus_says_how_to_enable_it() -> None:
    with pytest.raises(BusError, match=r"no /dev/i2c-97 .*modprobe i2c-dev"):
        Bus(97)


def test_a_forbidden_bus_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: str, flags: int) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", path)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(BusError, match=r"/dev/i2c-1 .*usermod -aG i2c"):
        Bus(1)


def test_a_device_that_is_no_bus_is_named() -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(OSError, match="/dev/null is not an I2C bus"):
        Bus("/dev/null")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_chip_needs_a_seven_bit_address() -> None:
    with pytest.raises(ValueError, match="0x78"):
        BusModel().attach(0x78, Memory())
