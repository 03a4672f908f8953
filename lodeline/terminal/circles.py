"""Circles on a terminal: a ring of sectors that fills, and points about a centre."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, pi, sin

ROWS, COLUMNS = 11, 23
MARKS = "·○●"
BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the eight dots of a character, from the top, left and right."""


def ring(passes: Sequence[int], text: str) -> list[str]:
    """Sectors counter-clockwise from the right: none `·`, once `○`, more `●`; a text within."""
    cells = [[" "] * COLUMNS for _ in range(ROWS)]
    for sector, count in enumerate(passes):
        angle = (sector + 0.5) * 2.0 * pi / len(passes)
        row = round((ROWS - 1) / 2.0 * (1.0 - sin(angle)))
        column = round((COLUMNS - 1) / 2.0 * (1.0 + cos(angle)))
        cells[row][column] = MARKS[min(count, 2)]
    for place, line in enumerate(text.splitlines()):
        row = ROWS // 2 + place - text.count("\n") // 2
        start = (COLUMNS - len(line)) // 2
        cells[row][start : start + len(line)] = line
    return ["".join(row).rstrip() for row in cells]


def scatter(
    points: Iterable[tuple[float, float]], reach: float, size: int = 10, centre: str = "+"
) -> list[str]:
    """Points within `reach` of a centre, in braille: `size` lines of twice as many characters."""
    bits = [[0] * (2 * size) for _ in range(size)]
    for x, y in points:
        column = round((x / reach + 1.0) * (2.0 * size - 0.5))
        row = round((1.0 - y / reach) * (2.0 * size - 0.5))
        if 0 <= column < 4 * size and 0 <= row < 4 * size:
            bits[row // 4][column // 2] |= BRAILLE[row % 4][column % 2]
    lines = [[chr(0x2800 + cell) if cell else " " for cell in row] for row in bits]
    lines[size // 2][size] = centre
    return ["".join(line) for line in lines]


def beside(left: Sequence[str], right: Sequence[str], gap: int = 4) -> str:
    """Two pictures side by side."""
    wide = max(map(len, left), default=0) + gap
    high = max(len(left), len(right))
    pairs = zip([*left, *[""] * (high - len(left))], [*right, *[""] * (high - len(right))])  # noqa: B905
    return "\n".join(f"{a:{wide}}{b}".rstrip() for a, b in pairs)
