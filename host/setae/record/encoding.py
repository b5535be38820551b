"""Values as JSON: the same value always gives the same bytes, and NaN becomes null."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Final

import numpy as np
import orjson

from setae.errors import InputError

DECIMALS: Final = 6  # nanometres; finer digits only cost space


def plain(value: Any) -> Any:
    """Turn a value into what JSON can say: NaN and infinity become null.

    Raises
    ------
    InputError
        JSON has nothing for a value of this type.
    """
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return round(float(value), DECIMALS) if math.isfinite(value) else None
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Iterable):
        return [plain(item) for item in value]
    raise InputError(f"A log can't hold a value of type {type(value).__name__}.")


def encode(message: Mapping[str, Any]) -> bytes:
    """Write a message of plain values, of numpy's numbers and of arrays.

    Raises
    ------
    InputError
        An integer needs more than 64 bits, or a text is no Unicode.
    """
    try:
        return orjson.dumps(message, default=plain, option=orjson.OPT_SERIALIZE_NUMPY)
    except TypeError as error:
        raise InputError(f"A log can't hold this message: {error}.") from error
