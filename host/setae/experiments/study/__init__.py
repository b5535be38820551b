"""Many simulated scans: objects × seeds × parameters, on one machine or on a cluster.

`plan` says which runs there are, `one` does a single one, `conducting` does all and keeps
what came out, and `table` makes one table of it.
"""

from __future__ import annotations

from setae.experiments.study.conducting import (
    RUNS,
    Row,
    conduct,
    require,
    workers_for,
)
from setae.experiments.study.one import MAP, Outcome, perform
from setae.experiments.study.plan import Plan, Run, load, of_options
from setae.experiments.study.table import read_table, with_earlier, write_table

__all__ = [
    "MAP",
    "RUNS",
    "Outcome",
    "Plan",
    "Row",
    "Run",
    "conduct",
    "load",
    "of_options",
    "perform",
    "read_table",
    "require",
    "with_earlier",
    "workers_for",
    "write_table",
]
