"""The same map in less time: sweep over the empty, step low over the flat, look where it changes.

Rows far apart are traced first. Where nothing is, the extended robot sweeps a whole row in one
guarded move of the arm; a contact stops it, and tells where the object begins. On the object
the robot retracts only as far as the heights known around it ask for, and leaves out every
second place as long as its neighbours agree. The rows between are visited only where the rows
beside them don't agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from setae.config import Scan
from setae.experiments.scan.cycles import NOTHING, Found, known_to_be_there
from setae.experiments.scan.steps import Feeling, Steps
from setae.experiments.scan.survey import Cell, Survey


def adaptive(steps: Steps, survey: Survey, settings: Scan, found: Found) -> None:
    """Trace rows `coarse_mm` apart, and between them what these leave open."""
    steps.retract()
    tracer = _Tracer(steps, survey, settings, found)
    before = None
    for row in coarse_rows(survey, settings):
        tracer.trace(row, range(survey.columns))
        if before is not None:
            # The nearest first: the arm is there.
            for between in range(row - 1, before, -1):
                tracer.trace(between, tracer.unsettled(between, before, between + 1))
        before = row


def coarse_rows(survey: Survey, settings: Scan) -> list[int]:
    """Rows that are traced whole: the first, the last, and some between.

    Examples
    --------
    >>> from setae.config import load
    >>> coarse_rows(Survey(load().scan), load().scan)
    [0, 3, 6, 9, 12, 15, 18, 20]
    """
    spacing = max(1, math.floor(settings.coarse_mm / settings.step_mm + 1e-6))
    last = survey.rows - 1
    return [*range(0, last, spacing), last]


class _Tracer:
    def __init__(self, steps: Steps, survey: Survey, settings: Scan, found: Found) -> None:
        self._steps = steps
        self._survey = survey
        self._settings = settings
        self._found = found

    # ------------------------------------------------------------------------- a row

    def trace(self, row: int, columns: Iterable[int]) -> None:
        """Find out about places of a row, from the end that is nearer to the arm."""
        left = sorted(column for column in columns if self._survey.get((column, row)) is None)
        if not left:
            return
        x_mm = self._steps.position_mm[0]
        if abs(self._survey.x_mm(left[-1]) - x_mm) < abs(self._survey.x_mm(left[0]) - x_mm):
            left.reverse()
        while left:
            if self._steps.extended and not self._known_above(left[0], row):
                left = self._sweep(left, row)
            else:
                left = self._touch(left, row)

    def _sweep(self, left: list[int], row: int) -> list[int]:
        """Move on extended, as far as nothing is known to be there; what is left of the row."""
        run = 1
        while run < len(left) and abs(left[run] - left[run - 1]) == 1:
            run += 1
        passed = 0
        for end in (0, run - 1):
            contact = self._steps.go(self._survey.x_mm(left[end]), self._survey.y_mm(row))
            passed = end + 1 if contact is None else self._passed(left[:end])
            if contact is not None:
                break
        for column in left[:passed]:
            self._found((column, row), NOTHING)
        left = left[passed:]
        return left if contact is None else self._touch(left, row, beside=True)

    def _passed(self, run: Sequence[int]) -> int:
        """How many places of a row the arm left well behind before it was stopped."""
        if not run:
            return 0
        here_mm = self._steps.position_mm[0]
        begin_mm = self._survey.x_mm(run[0])
        way_mm = abs(here_mm - begin_mm) - self._settings.clearance_mm
        return sum(abs(self._survey.x_mm(column) - begin_mm) < way_mm for column in run)

    def _touch(self, left: list[int], row: int, *, beside: bool = False) -> list[int]:
        """Feel at the next place, and where it may be so, at the next but one; what is left."""
        first = (left[0], row)
        feeling = self._visit(first)
        self._found(first, known_to_be_there(feeling) if beside else feeling)
        left = left[1:]
        if feeling.mark != "felt" or len(left) < 2 or not self._may_skip(first, left):
            return left
        between, second = (left[0], row), (left[1], row)
        further = self._visit(second)
        self._found(second, further)
        if further.mark == "felt" and self._flat(feeling.height_mm, further.height_mm):
            self._infer(between, (feeling.height_mm + further.height_mm) / 2)
        else:
            self._found(between, self._visit(between))
        return left[2:]

    def _may_skip(self, here: Cell, left: Sequence[int]) -> bool:
        """Whether the place after this one will follow from its neighbours."""
        column, row = here
        if abs(left[0] - column) != 1 or abs(left[1] - column) != 2:
            return False
        behind = self._survey.height_mm((2 * column - left[0], row))
        if math.isfinite(behind) and not self._flat(behind, self._survey.height_mm(here)):
            return False
        for beside in (row - 1, row + 1):
            cells = [(other, beside) for other in (column, left[0], left[1])]
            if any(self._survey.get(cell) is None for cell in cells):
                continue
            heights = [self._survey.height_mm(cell) for cell in cells]
            if not all(self._flat(heights[0], height) for height in heights[1:]):
                return False
        return True

    # ----------------------------------------------------------------------- a place

    def _visit(self, cell: Cell) -> Feeling:
        """Go there no lower than is safe, and feel."""
        steps = self._steps
        place_mm = self._survey.x_mm(cell[0]), self._survey.y_mm(cell[1])
        top_mm = self._top_mm(cell)
        if math.isfinite(top_mm):
            steps.retract(steps.length_over_mm(top_mm))
        feeling = None if steps.extended else steps.go_and_feel(*place_mm)
        if feeling is None:
            steps.retract()
            feeling = steps.go_and_feel(*place_mm)
            assert feeling is not None, "a short robot that touches something raises"
        if feeling.mark == "double":
            # In touch at once: from farther up it is seen whether it is so.
            steps.retract()
            feeling = steps.feel()
        if feeling.contact is not None:
            steps.lower(steps.length_over_mm(feeling.height_mm))
        return feeling

    def _known_above(self, column: int, row: int) -> bool:
        """Whether something is known to stand between the arm and a place, or on it."""
        return math.isfinite(self._top_mm((column, row)))

    def _top_mm(self, cell: Cell) -> float:
        """Highest known surface on the way to a place; NaN where none is known."""
        x_mm, y_mm, _ = self._steps.position_mm
        step_mm = self._survey.step_mm
        column, row = x_mm / step_mm, y_mm / step_mm
        count = max(1, math.ceil(2 * max(abs(cell[0] - column), abs(cell[1] - row))))
        top_mm = math.nan
        for index in range(count + 1):
            part = index / count
            on_way = (
                round(column + part * (cell[0] - column)),
                round(row + part * (cell[1] - row)),
            )
            top_mm = max(top_mm, self._survey.height_mm(on_way), key=_nan_low)
        return top_mm

    # --------------------------------------------------------------------- inference

    def unsettled(self, row: int, below: int, above: int) -> list[int]:
        """Infer a row where the two beside it agree; columns where they don't."""
        left = []
        for column in range(self._survey.columns):
            cell = (column, row)
            if self._survey.get(cell) is not None:
                continue
            heights = [self._survey.height_mm((column, other)) for other in (below, above)]
            if self._edge((column, below)) or self._edge((column, above)):
                left.append(column)
            elif all(map(math.isfinite, heights)) and self._flat(*heights):
                part = (row - below) / (above - below)
                self._infer(cell, heights[0] + part * (heights[1] - heights[0]))
            elif not any(map(math.isfinite, heights)):
                self._infer(cell, math.nan)
            else:
                left.append(column)
        return left

    def _edge(self, cell: Cell) -> bool:
        """Whether the surface changes beside a place of a row."""
        column, row = cell
        height_mm = self._survey.height_mm(cell)
        for other in (column - 1, column + 1):
            if 0 <= other < self._survey.columns:
                beside_mm = self._survey.height_mm((other, row))
                if math.isfinite(height_mm) != math.isfinite(beside_mm):
                    return True
        return False

    def _flat(self, one_mm: float, other_mm: float) -> bool:
        if math.isnan(one_mm) or math.isnan(other_mm):
            return math.isnan(one_mm) and math.isnan(other_mm)
        return abs(one_mm - other_mm) <= self._settings.flat_mm

    def _infer(self, cell: Cell, height_mm: float) -> None:
        self._found(cell, Feeling(mark="inferred", height_mm=height_mm, contact=None))


def _nan_low(value: float) -> float:
    return -math.inf if math.isnan(value) else value
