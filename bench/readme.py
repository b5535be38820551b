"""Write README's table of figures from results.json. `python bench/readme.py --help` says how."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
RESULTS = ROOT / "bench" / "results.json"
TEMPLATE = ROOT / "bench" / "figures.md"
BEGIN = "<!-- bench/readme.py writes this table from bench/figures.md and bench/results.json -->"
END = "<!-- end of bench/readme.py's table -->"


class Value(float):
    """A figure, which can also be written in millions.

    Examples
    --------
    >>> f"{Value(7062414):.1M}, {Value(0.96):.0%}, {Value(2.56):.1f} ms"
    '7.1 million, 96 %, 2.6 ms'
    """

    def __format__(self, spec: str) -> str:
        if spec.endswith("M"):
            return f"{self / 1e6:{spec[:-1]}f} million"
        return super().__format__(spec).replace("%", " %")


def filled(page: str, template: str, values: Mapping[str, float]) -> str:
    """Return a page with the template's figures between its two marks."""
    table = template.format_map({name: Value(value) for name, value in values.items()})
    between = re.compile(f"(?<={re.escape(BEGIN)}\n).*?(?={re.escape(END)})", re.DOTALL)
    new, count = between.subn(lambda _: table, page)
    if count != 1:
        sys.exit(f"{README.name} needs, each once, the lines {BEGIN} and {END}.")
    return new


def main(arguments: Sequence[str] | None = None) -> None:
    """Write, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="only compare")
    options = parser.parse_args(arguments)
    values = {entry["name"]: entry["value"] for entry in json.loads(RESULTS.read_text())}
    old = README.read_text(encoding="utf-8")
    new = filled(old, TEMPLATE.read_text(encoding="utf-8"), values)
    if not options.check:
        README.write_text(new, encoding="utf-8")
    elif new != old:
        sys.exit("README's figures aren't those of bench/results.json: run bench/readme.py.")


if __name__ == "__main__":
    main()
