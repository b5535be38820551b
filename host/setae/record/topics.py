"""What a log is made of: its topics, and the JSON schema of each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

PROFILE: Final = "setae"
LIBRARY: Final = "setae log 1"  # a fixed string: no version of a library in the bytes
TEXT_RECORD: Final = "setae"  # metadata values that are text
JSON_RECORD: Final = "setae.json"  # all other values, as JSON


def _number(unit: str = "") -> dict[str, Any]:
    return {"type": ["number", "null"]} | ({"description": unit} if unit else {})


def _numbers(*shape: int, unit: str = "") -> dict[str, Any]:
    schema = _number(unit)
    for size in reversed(shape):
        schema = {"type": "array", "items": schema, "minItems": size, "maxItems": size}
    return schema


_INTEGER: Final[dict[str, Any]] = {"type": "integer"}
_TEXT: Final[dict[str, Any]] = {"type": "string"}
_FLAG: Final[dict[str, Any]] = {"type": "boolean"}
_ANY: Final[dict[str, Any]] = {"type": ["object", "null"]}

TOPICS: Final[Mapping[str, Mapping[str, Any]]] = {
    "/telemetry": {
        "frame": _INTEGER,
        "state": _TEXT,
        "epoch": _INTEGER,
        "pulse_us": _numbers(4, unit="us; 0 where the servo has no pulses"),
        "guard": _TEXT,
        "reflex_running": _FLAG,
        "queued": _INTEGER,
        "baseline_hpa": _number("hPa"),
    },
    "/pressure": {
        "pressure_hpa": _number("hPa"),
        "baseline_hpa": _number("hPa"),
        "armed": _FLAG,
    },
    "/trip": {
        "record_id": _INTEGER,
        "cause": _TEXT,
        "sample_time_us": _INTEGER,
        "pressure_hpa": _number("hPa"),
        "baseline_hpa": _number("hPa"),
        "pulse_us": _numbers(4, 4, unit="us; the last four servo frames, oldest first"),
        "contact": _ANY,
    },
    "/fault": {
        "record_id": _INTEGER,
        "fault": _TEXT,
        "detail": _INTEGER,
        "pulse_us": _numbers(4, unit="us"),
    },
    "/refusal": {
        "record_id": _INTEGER,
        "command": _TEXT,
        "reason": _TEXT,
        "index": _INTEGER,
        "value": _INTEGER,
        "limit": _INTEGER,
    },
    "/status": {
        "supply_mv": _INTEGER,
        "storing": _FLAG,
        "stop_switch_open": _FLAG,
        "rx_framing_errors": _INTEGER,
        "rx_overruns": _INTEGER,
        "rx_overflows": _INTEGER,
        "late_pulses": _INTEGER,
    },
    "/command": {"name": _TEXT, "args": _ANY},
    "/stage": {"position_mm": _numbers(3, unit="mm, world"), "moving": _FLAG},
    "/experiment": {"event": _TEXT, "data": _ANY},
    "/truth": {
        "backbone_mm": _numbers(21, 3, unit="mm, frame D, from the spring's base to its top"),
        "filament_mm": _numbers(2, 3, unit="mm, frame D, root and undeformed tip"),
        "arm_mm": _numbers(3, unit="mm, world"),
        "contact_depth_mm": _number("mm"),
        "contact_point_mm": _numbers(3, unit="mm, world; means something while the depth is > 0"),
        "tension_n": _numbers(4, unit="N"),
        "pressure_hpa": _number("hPa"),
        "plant_residual": _number("root of N mm, scaled; below 1e-4 the equilibrium is solved"),
        "largest_residual": _number("the same of all samples until now"),
        "unsolved_samples": _number("how many of them have no solution"),
    },
}
# What logs of earlier versions lack: numbers, read as NaN.
_LATER: Final = frozenset({"plant_residual", "largest_residual", "unsolved_samples"})


def schema(topic: str) -> bytes:
    """The JSON schema of a topic's messages, as text."""
    properties = {"time_us": {"type": "integer", "description": "us on the run's clock"}}
    properties.update(TOPICS[topic])
    required = [name for name in properties if name not in _LATER]
    whole = {"type": "object", "required": required, "properties": properties}
    return json.dumps(whole, separators=(",", ":")).encode()


def fits(topic: str, message: object) -> bool:
    """Whether a message has every field of its topic, each of its type.

    Those that came later may lack.
    """
    if not isinstance(message, dict):
        return False
    fields = {"time_us": _INTEGER, **TOPICS.get(topic, {})}
    return all(
        _is(field, message[name]) if name in message else name in _LATER
        for name, field in fields.items()
    )


def _is(field: Mapping[str, Any], value: object) -> bool:
    kind = field["type"]
    if kind == "array":
        return (
            isinstance(value, list)
            and len(value) == field["maxItems"]
            and all(_is(field["items"], item) for item in value)
        )
    if isinstance(value, bool):  # which Python counts among the integers
        return bool(kind == "boolean")
    if value is None:
        return "null" in kind
    if isinstance(value, int):
        return "number" in kind or (kind == "integer" and -(2**63) <= value < 2**63)
    if isinstance(value, float):
        return "number" in kind
    return (kind == "string" and isinstance(value, str)) or (
        "object" in kind and isinstance(value, dict)
    )
