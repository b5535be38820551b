"""Write everything that follows from the schema, the state table and the default robot.

    python protocol/generate.py            write the generated files
    python protocol/generate.py --check    fail where one of them differs

The generated files are committed, so that flashing a board needs no Python.
"""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Callable
from pathlib import Path

from generator.cpp import cpp_header
from generator.layout import check_schema
from generator.limits import default_limits_header
from generator.page import reference_page
from generator.python import python_module
from generator.states import model_table, states_page
from generator.vectors import vectors_header, vectors_json

ROOT = Path(__file__).resolve().parent.parent

OUTPUTS: dict[str, Callable[[], str]] = {
    "firmware/lib/protocol/src/protocol/messages.h": cpp_header,
    "protocol/setae_protocol/messages.py": python_module,
    "protocol/REFERENCE.md": reference_page,
    "protocol/vectors.json": vectors_json,
    "tests/firmware/test_protocol/vectors.h": vectors_header,
    "protocol/STATES.md": states_page,
    "tests/model/table.h": model_table,
    # Last: it needs the host package, which needs the messages.
    "firmware/lib/board/src/board/default_limits.h": default_limits_header,
}


def drift(root: Path) -> list[str]:
    """One line for each generated file that differs from what its source gives."""
    lines = []
    for name, make in OUTPUTS.items():
        path = root / name
        if not path.exists():
            lines.append(f"{name} is missing; run: python protocol/generate.py")
            continue
        old, new = path.read_text(encoding="utf-8"), make()
        if old != new:
            changed = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=0)
            first = next(line for line in list(changed)[3:])
            lines.append(
                f"{name} is not what its source gives; run: python protocol/generate.py"
                f" (first difference: {first})"
            )
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Write or check the generated files; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, fail on a difference")
    options = parser.parse_args(arguments)
    sys.path.insert(0, str(ROOT / "host"))  # works without the package installed
    check_schema()
    if options.check:
        differences = drift(ROOT)
        for line in differences:
            print(line, file=sys.stderr)
        return 1 if differences else 0
    for name, make in OUTPUTS.items():
        path = ROOT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text = make()
        # An unchanged file keeps its date, so that nothing is built for nothing.
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
