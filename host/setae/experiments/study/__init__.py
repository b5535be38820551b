"""Many simulated scans: objects × seeds × parameters, on one machine or on a cluster.

`plan` says which runs there are, `one` does a single one, `conduct` does all of them and keeps
what came out, and `table` is that as one table.
"""

from __future__ import annotations

from setae.experiments.study.conduct import RUNS, Row, conduct
from setae.experiments.study.one import MAP, Outcome, perform
from setae.experiments.study.plan import Plan, Run, load, of_options
from setae.experiments.study.table import read_table, write_table

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
    "write_table",
]
