"""The paper's cycle, and one that never steps while it is extended."""

from __future__ import annotations

from collections.abc import Callable

from setae.experiments.scan.steps import Feeling, Steps
from setae.experiments.scan.survey import Cell, Survey

Found = Callable[[Cell, Feeling], None]
"""Called with what was felt at a place, or concluded of it."""

NOTHING = Feeling(mark="empty", height_mm=float("nan"), contact=None)


def paper(steps: Steps, survey: Survey, order: str, found: Found) -> None:
    """Step extended until something is touched; there retract, measure, and step retracted.

    A place that is reached extended and without a contact is empty. After a contact the robot
    retracts, the arm ends its step, and the next contact is the measurement. It goes on so,
    retracted from place to place, until a full extension feels nothing.
    """
    steps.retract()
    for cell in order_of(survey, order):
        x_mm, y_mm = survey.x_mm(cell[0]), survey.y_mm(cell[1])
        extended = steps.extended
        touched = steps.go(x_mm, y_mm)
        if extended and not touched:
            found(cell, NOTHING)
            continue
        if touched:
            steps.go(x_mm, y_mm)
        feeling = feel_short(steps)
        found(cell, known_to_be_there(feeling) if touched else feeling)


def safe(steps: Steps, survey: Survey, order: str, found: Found) -> None:
    """Retract before every step."""
    for cell in order_of(survey, order):
        steps.retract()
        steps.go(survey.x_mm(cell[0]), survey.y_mm(cell[1]))
        found(cell, feel_short(steps))


def feel_short(steps: Steps) -> Feeling:
    """Extend from the shortest."""
    steps.retract()
    feeling = steps.feel()
    if feeling is None:
        raise steps.too_high()
    return feeling


def order_of(survey: Survey, order: str) -> list[Cell]:
    """Places of which nothing is known yet."""
    return [cell for cell in survey.order(order) if survey.get(cell) is None]


def known_to_be_there(feeling: Feeling) -> Feeling:
    """Of a place beside which something was touched: nothing there is a contact lost."""
    if feeling.mark == "empty":
        return Feeling(mark="lost", height_mm=feeling.height_mm, contact=None)
    return feeling
