"""The lines of all runs as one table, a Parquet file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from setae import extras
from setae.errors import InputError
from setae.experiments.study.conducting import LINE, RUNS, Row

__all__ = ["read_table", "with_earlier", "write_table"]


def with_earlier(rows: Sequence[Row], folder: Path) -> list[Row]:
    """Lines of a call's runs, then those that other calls have left in the study's folder.

    Parameters
    ----------
    rows
        Of this call's runs.
    folder
        The study's.
    """
    ours = {row["run"] for row in rows}
    earlier: list[Row] = []
    for path in sorted((folder / RUNS).glob(f"*/{LINE}")):
        try:
            row = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue  # half of a line belongs to no run that is whole
        if isinstance(row, dict) and {"run", "status"} <= row.keys() and row["run"] not in ours:
            earlier.append(row)
    return [*rows, *earlier]


def write_table(path: Path, rows: Sequence[Row]) -> Path:
    """Write one line for each run, one column for each thing known of any.

    Raises
    ------
    InputError
        The file can't be written.
    ExtraMissingError
        PyArrow isn't installed.
    """
    arrow = extras.load("pyarrow", "study", "The table")
    parquet = extras.load("pyarrow.parquet", "study", "The table")
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {name: _column([row.get(name) for row in rows]) for name in names}
    try:
        parquet.write_table(arrow.table(columns), path)
    except OSError as error:
        raise InputError(
            f"{path} can't be written: {error}.", "Check the folder and the room on the disk."
        ) from error
    return path


def read_table(path: Path) -> list[dict[str, Any]]:
    """Read what `write_table` wrote.

    Raises
    ------
    InputError
        The file can't be read.
    ExtraMissingError
        PyArrow isn't installed.
    """
    parquet = extras.load("pyarrow.parquet", "study", "The table")
    if path.is_dir():
        raise InputError(f"{path} is a folder.", "Give the table in it: table.parquet.")
    try:
        rows: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} is no table of a study: {error}.", "Give one that `setae study` wrote."
        ) from error
    return rows


def _column(values: list[Any]) -> list[Any]:
    """Values of one kind: numbers, or texts where kinds differ."""
    there = [value for value in values if value is not None]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in there):
        whole = all(isinstance(value, int) for value in there)
        return values if whole else [None if v is None else float(v) for v in values]
    if all(isinstance(value, str) for value in there):
        return values
    return [None if value is None else json.dumps(value) for value in values]
