"""Pages from their templates in ``page/``: names in double braces are filled in."""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["config_text", "fill", "image", "json_text", "text"]


def text(name: str) -> str:
    """Read a file of ``page/``."""
    return resources.files("setae.report.page").joinpath(name).read_text(encoding="utf-8")


def fill(name: str, values: Mapping[str, str]) -> str:
    """Fill a template, below the head that all pages share, with values that are HTML already."""
    values = {"css": text("page.css"), **values}
    parts = (text("head.html") + text(name)).split("{{")
    filled = [parts[0]]
    for part in parts[1:]:
        key, rest = part.split("}}", 1)
        filled += [values[key], rest]
    return "".join(filled)


def json_text(data: Any) -> str:
    """Write data for a script element; NaN becomes null."""
    # "</" would end the script element that holds it.
    return json.dumps(_clean(data), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def config_text(metadata: Mapping[str, Any], of: str = "the run") -> str:
    """Show the configuration of a run, folded; nothing where its log has none."""
    config = metadata.get("config")
    if not config:
        return ""
    return (
        f"<details><summary>Configuration of {html.escape(of)}</summary>"
        f"<pre>{html.escape(str(config))}</pre></details>"
    )


def image(path: Path, description: str) -> str:
    """Show a PNG file, its bytes inside the page."""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{html.escape(description)}" src="data:image/png;base64,{data}">'


def _clean(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(item) for item in value]
    if isinstance(value, float | np.floating | np.ndarray):
        number = float(value)
        return round(number, 5) if math.isfinite(number) else None
    return value
