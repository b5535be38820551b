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
from setae.experiments.scan.cycles import NOTHING, Found, feel_short, known_to_be_there
from setae.experiments.scan.steps import Feeling, Steps
from setae.experiments.scan.survey import Cell, Survey

# Columns per row of the lines along which rows are compared.
_SLOPES = (-1, 0, 1)
_IN_ROW_MM = 0.02
# Lengths that differ by less are not tried one after the other.
_LONGER_MM = 1.0
# So many clearances are extended slowly at most: beyond, it takes less time to extend fast, and
# to measure anew what was touched.
_SLOWLY = 6.5
# So many slowly, of which one leads to where it was touched in haste.
_ANEW = 2.5
_ANEW_MIN_MM = 6.0  # it is not worth lowering the arm for a few millimetres


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
    last = survey.rows - 1
    return [*range(0, last, _spacing(settings)), last]


def _spacing(settings: Scan) -> int:
    return max(1, math.floor(settings.coarse_mm / settings.step_mm + 1e-6))


class _Tracer:
    def __init__(self, steps: Steps, survey: Survey, settings: Scan, found: Found) -> None:
        self._steps = steps
        self._survey = survey
        self._settings = settings
        self._found = found
        self._rows_between = _spacing(settings)
        self._free_mm = 0.0

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
        around_mm = self._heights_around(left[0], left[run - 1], row, self._rows_between)
        ends = [run - 1] if self._leads_on(left[:run], row) else [0, run - 1]
        for end in ends:
            touched = self._steps.go(
                self._survey.x_mm(left[end]),
                self._survey.y_mm(row),
                retract_to_mm=self._length_over(max(around_mm, default=math.nan)),
            )
            if touched:
                passed = self._passed(left[:run]) if end > 0 else 0
                break
            passed = end + 1
        for column in left[:passed]:
            self._found((column, row), NOTHING)
        left = left[passed:]
        return self._touch(left, row, beside=True) if touched else left

    def _leads_on(self, run: Sequence[int], row: int) -> bool:
        """Whether the arm stands in a row, before a run of its places."""
        x_mm, y_mm, _ = self._steps.position_mm
        begin_mm, end_mm = self._survey.x_mm(run[0]), self._survey.x_mm(run[-1])
        in_row = abs(y_mm - self._survey.y_mm(row)) < _IN_ROW_MM
        return in_row and (begin_mm - x_mm) * (end_mm - begin_mm) >= 0

    def _passed(self, run: Sequence[int]) -> int:
        """How many places of a run the arm left well behind before it was stopped, of the last."""
        here_mm = self._steps.position_mm[0]
        forward = math.copysign(1.0, run[-1] - run[0])
        return sum(
            forward * (here_mm - self._survey.x_mm(column)) > self._settings.clearance_mm
            for column in run[:-1]
        )

    def _touch(self, left: list[int], row: int, *, beside: bool = False) -> list[int]:
        """Feel at the next place, or where it may be so, at the next but one; what is left."""
        here = (left[0], row)
        further = (left[1], row) if len(left) > 1 else here
        if beside or not self._may_skip(left, row):
            feeling = self._visit(here)
            self._found(here, known_to_be_there(feeling) if beside else feeling)
            return left[1:]
        feeling = self._visit(further)
        self._found(further, feeling)
        behind_mm = self._survey.height_mm((2 * left[0] - left[1], row))
        if feeling.mark == "felt" and self._flat(behind_mm, feeling.height_mm):
            self._infer(here, (behind_mm + feeling.height_mm) / 2)
        elif self._steps.extended:
            # Back as it is: a contact tells that the object reaches so far.
            self._sweep([left[0]], row)
        else:
            self._found(here, self._visit(here))
        return left[2:]

    def _may_skip(self, left: Sequence[int], row: int) -> bool:
        """Whether the next place will follow from those beside it, as far as can be told."""
        if len(left) < 2:
            return False
        forward = left[1] - left[0]
        if abs(forward) != 1:
            return False
        behind = [self._survey.height_mm((left[0] - part * forward, row)) for part in (1, 2)]
        if not (math.isfinite(behind[0]) and self._flat(*behind)):
            return False
        for beside in (row - 1, row + 1):
            cells = [(left[0] + part * forward, beside) for part in (-1, 0, 1)]
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
        clearance_mm = self._settings.clearance_mm
        around_mm = self._heights_around(cell[0], cell[0], cell[1], 1)
        hasty = not around_mm or self._nothing_beside(cell)
        feeling = None
        for length_mm in self._lengths(cell, around_mm):
            if length_mm > steps.length_mm:
                steps.lower(min(length_mm, self._free_mm))
            else:
                steps.retract(length_mm)
            # As far below the lowest around as the tip is above the highest.
            near_mm = self._length_over(min(around_mm, default=math.nan)) - steps.length_mm
            near_mm += 2 * clearance_mm
            hasty = hasty or near_mm > _SLOWLY * clearance_mm
            feeling = steps.go_and_feel(
                self._survey.x_mm(cell[0]),
                self._survey.y_mm(cell[1]),
                near_mm=0.0 if hasty else near_mm,
            )
            self._free_mm = 0.0
            if feeling is not None:
                break
            hasty = True  # higher than what is known around it: once more, from farther up
        if feeling is None:
            raise steps.too_high()
        if hasty and feeling.contact is not None:
            # Touched in haste: measure it.
            steps.lower(steps.length_over_mm(feeling.height_mm))
            feeling = steps.feel(near_mm=max(_ANEW * clearance_mm, _ANEW_MIN_MM))
            feeling = known_to_be_there(feeling or feel_short(steps))
        if feeling.mark == "double":
            # In touch at once: from farther up it is seen whether it is so.
            steps.retract(max(steps.short_mm, steps.length_mm - 2 * clearance_mm))
            feeling = steps.feel(near_mm=4 * clearance_mm) or feel_short(steps)
        if feeling.contact is not None:
            self._free_mm = steps.length_over_mm(feeling.height_mm)
        return feeling

    def _lengths(self, cell: Cell, around_mm: Sequence[float]) -> list[float]:
        """Lengths to go to a place with, until nothing is in the way: from the longest on.

        Over what is known beside the place and on the way; over what is known around; the least.
        """
        top_mm = max([*around_mm, self._top_mm(cell)], key=_nan_low)
        reach = self._rows_between
        column, row = cell
        farther_mm = self._heights_around(column - reach + 1, column + reach - 1, row, reach)
        lengths_mm = [self._steps.short_mm]
        for height_mm in (max([top_mm, *farther_mm], key=_nan_low), top_mm):
            length_mm = self._length_over(height_mm)
            if lengths_mm[-1] + _LONGER_MM < length_mm < self._steps.long_mm - _LONGER_MM:
                lengths_mm.append(length_mm)
        return lengths_mm[::-1]

    def _length_over(self, top_mm: float) -> float:
        """Longest spring that clears a surface; the shortest where none is known."""
        if math.isnan(top_mm):
            return self._steps.short_mm
        return self._steps.length_over_mm(top_mm)

    def _heights_around(self, first: int, last: int, row: int, reach: int) -> list[float]:
        """Known heights on a part of a row and around it."""
        first, last = min(first, last), max(first, last)
        heights_mm = [
            self._survey.height_mm((column, other))
            for other in range(row - reach, row + reach + 1)
            for column in range(first - 1, last + 2)
        ]
        return [height_mm for height_mm in heights_mm if math.isfinite(height_mm)]

    def _nothing_beside(self, cell: Cell) -> bool:
        """Whether nothing is at the same place of a row beside."""
        column, row = cell
        for other in (row - 1, row + 1):
            beside = self._survey.get((column, other))
            if beside is not None and math.isnan(beside.height_mm):
                return True
        return False

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
        """Infer a row from those on both sides of it; columns where they leave it open."""
        left = []
        for column in range(self._survey.columns):
            cell = (column, row)
            if self._survey.get(cell) is None:
                height_mm = self._between(cell, below, above)
                if height_mm is None:
                    left.append(column)
                else:
                    self._infer(cell, height_mm)
        return left

    def _between(self, cell: Cell, below: int, above: int) -> float | None:
        """Height that two rows leave no doubt of, NaN for nothing; None where they do.

        An edge that runs aslant is elsewhere in every row. So lines of several directions are
        drawn through the place, and each that ends on the same surface in both rows votes for it.
        """
        column, row = cell
        part = (row - below) / (above - below)
        votes_mm = []
        for slope in _SLOPES:
            ends = (column - slope * (row - below), below), (column + slope * (above - row), above)
            if all(0 <= end[0] < self._survey.columns for end in ends):
                low_mm, high_mm = (self._survey.height_mm(end) for end in ends)
                if self._flat(low_mm, high_mm):
                    votes_mm.append(low_mm + part * (high_mm - low_mm))
                elif math.isfinite(low_mm) and math.isfinite(high_mm):
                    return None  # something, and nobody knows how high
        if not votes_mm or not all(self._flat(votes_mm[0], vote_mm) for vote_mm in votes_mm):
            return None
        if math.isnan(votes_mm[0]) and self._may_end(cell, below, above):
            return None
        return votes_mm[len(votes_mm) // 2]

    def _may_end(self, cell: Cell, below: int, above: int) -> bool:
        """Whether an object may end at a place that lies between places where nothing is.

        Right beside it something is; or one row is inside of an object, and the other outside.
        """
        column, row = cell
        beside = [(column, other) for other in (below, above) if abs(other - row) == 1]
        if any(math.isfinite(self._survey.height_mm(cell)) for cell in beside):
            return True
        return self._inside(column, below) != self._inside(column, above)

    def _inside(self, column: int, row: int) -> bool:
        """Whether something is known to stand near to both sides of a place in its row."""
        near = range(1, self._rows_between + 1)
        return all(
            any(math.isfinite(self._survey.height_mm((column + way * far, row))) for far in near)
            for way in (-1, 1)
        )

    def _flat(self, one_mm: float, other_mm: float) -> bool:
        if math.isnan(one_mm) or math.isnan(other_mm):
            return math.isnan(one_mm) and math.isnan(other_mm)
        return abs(one_mm - other_mm) <= self._settings.flat_mm

    def _infer(self, cell: Cell, height_mm: float) -> None:
        self._found(cell, Feeling(mark="inferred", height_mm=height_mm, contact=None))


def _nan_low(value: float) -> float:
    return -math.inf if math.isnan(value) else value
