"""What a CSV table holds, and what a map would make of it, before anything is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

from lodeline.recording.csv_map import TableMap, samples
from lodeline.recording.csv_table import CsvTable
from lodeline.tables import table as plain_table
from lodeline_msgs import columns, row

ROWS = 3


def first_rows(table: CsvTable) -> list[list[str]]:
    """Cells of the first rows."""
    return [[cell.strip() for cell in cells] for _, cells in islice(table.cells(), ROWS)]


def of_columns(table: CsvTable, first: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines: each column with the first values in it."""
    shown = [
        (name, *(cells[place] if place < len(cells) else "" for cells in first))
        for place, name in enumerate(table.columns)
    ]
    yield plain_table(("column", *(f"row {n + 1}" for n in range(len(first)))), shown)


def of_map(table: CsvTable, mapping: TableMap) -> Iterator[str]:
    """Lines: the first samples of each key, as the map makes them."""
    found: dict[str, list[list[str]]] = {key.key: [] for key in mapping.keys}
    headings = {key.key: columns(key.type) for key in mapping.keys}
    for key, message in samples(table, mapping):
        if len(found[key]) < ROWS:
            found[key].append(row(message))
        elif all(len(rows) == ROWS for rows in found.values()):
            break
    for key, rows in found.items():
        yield f"{key}:" if rows else f"{key}: no sample, a column of it is empty in every row"
        if rows:
            numbers = (f"sample {n + 1}" for n in range(len(rows)))
            yield plain_table(("field", *numbers), list(zip(headings[key], *rows, strict=True)))
