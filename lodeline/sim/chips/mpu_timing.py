"""How fast an MPU samples, and how late its filters make what it senses.

Delays are those of the register maps RM-MPU-6500A and RM-MPU-6000A; the newer revisions of
RM-MPU-9250A have shorter ones for the accelerometer.
"""

from __future__ import annotations

SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG2 = 0x19, 0x1A, 0x1B, 0x1D
OLD = (0x68, 0x69)  # WHO_AM_I of the MPU-6050 and its like
MS = 1e-3
# by DLPF_CFG and A_DLPF_CFG [ms]
GYRO_DELAYS = (0.97, 2.9, 3.9, 5.9, 9.9, 17.85, 33.48, 0.17)
ACCEL_DELAYS = (1.94, 5.8, 7.8, 11.8, 19.8, 35.7, 66.96, 1.94)
OLD_GYRO_DELAYS = (0.98, 1.9, 2.8, 4.8, 8.3, 13.4, 18.6, 0.98)
OLD_ACCEL_DELAYS = (0.0, 2.0, 3.0, 4.9, 8.5, 13.8, 19.0, 0.0)
GYRO_UNFILTERED, ACCEL_UNFILTERED = 0.064, 0.503


def sample_rate(identity: int, registers: bytes | bytearray) -> float:
    """Samples per second [Hz]; the newer chips divide 1 kHz only, the older ones 8 kHz too."""
    filtered = registers[CONFIG] & 0x07 not in (0, 7)
    if identity in OLD:
        return (1000.0 if filtered else 8000.0) / (1 + registers[SMPLRT_DIV])
    if registers[GYRO_CONFIG] & 0x03:
        return 32000.0
    return 1000.0 / (1 + registers[SMPLRT_DIV]) if filtered else 8000.0


def delays(identity: int, registers: bytes | bytearray) -> tuple[float, float]:
    """Group delays of gyro and accelerometer [s]."""
    gyro = registers[CONFIG] & 0x07
    if identity in OLD:
        return MS * OLD_GYRO_DELAYS[gyro], MS * OLD_ACCEL_DELAYS[gyro]
    accel = registers[ACCEL_CONFIG2]
    return (
        MS * (GYRO_UNFILTERED if registers[GYRO_CONFIG] & 0x03 else GYRO_DELAYS[gyro]),
        MS * (ACCEL_UNFILTERED if accel & 0x08 else ACCEL_DELAYS[accel & 0x07]),
    )
