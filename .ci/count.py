"""Say how many of the firmware's tests passed, and fail where none ran.

PlatformIO exits with 0 when it found no test at all.

usage: count.py JSON    JSON: what `pio test --json-output-path` wrote
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def main(path: Path) -> int:
    report = json.loads(path.read_text())
    bad = report["failure_nums"] + report["error_nums"]
    good = report["testcase_nums"] - bad - report["skipped_nums"]
    print(f"firmware: {good} passed, {bad} failed")
    return 0 if good > 0 and bad == 0 and report["skipped_nums"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
