"""How well the simulated spring's equilibrium was solved in a run, for its report."""

from __future__ import annotations

import math
from collections.abc import Iterable

from setae.record import Log
from setae.wording import counted

__all__ = ["row", "told"]


def told(logs: Iterable[Log]) -> str:
    """Say how many samples have no solution; empty where the logs don't know."""
    largest, unsolved, known = 0.0, 0, False
    for log in logs:
        # Each log is a world of its own, whose last message has it all.
        for name in ("largest_residual", "unsolved_samples"):
            values = log.array("/truth", name)
            value = float(values[-1]) if len(values) else math.nan
            if math.isnan(value):
                break
            known = True
            if name == "largest_residual":
                largest = max(largest, value)
            else:
                unsolved += int(value)
    if not known:
        return ""
    residual = f"the largest residual is {largest:.3g}, solved means below 1e-04"
    if not unsolved:
        return f"the spring’s equilibrium was solved in every sample; {residual}"
    return (
        f"{counted(unsolved, 'sample')} of the spring’s equilibrium without a solution; {residual}"
    )


def row(logs: Iterable[Log]) -> list[tuple[str, str]]:
    """The same as a row of a report's table of origins: one, or none."""
    text = told(logs)
    return [("equilibrium", text)] if text else []
