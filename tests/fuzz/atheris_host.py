"""Fuzz the host with atheris: `python tests/fuzz/atheris_host.py engine -max_total_time=600`.

What stands behind the target's name goes to libFuzzer. Needs the extra `fuzz`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    with atheris.instrument_imports(include=["setae", "setae_protocol"]):
        from tests.fuzz import host
    TARGETS = {"engine": host.engine, "config": host.config, "log": host.log}
    name = sys.argv.pop(1)
    atheris.Setup(sys.argv, TARGETS[name])
    atheris.Fuzz()
