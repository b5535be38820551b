"""Draw the board's states and what leads from one to the other, from the firmware's table."""

from __future__ import annotations

import sys
from pathlib import Path

from svg import Svg

from setae.report import palette

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "protocol"))

from generator.states import REFUSE, state_table  # needs the path above

PLACES = {
    "relaxed": (110, 120), "attaching": (305, 120), "holding": (500, 120), "playing": (695, 120),
    "unwinding": (305, 235), "fault": (110, 450), "stopped": (305, 450), "tripped": (500, 450),
    "reflex": (695, 450),
}  # fmt: skip
WIDTH, HEIGHT = 116, 40
LATCHED = ("fault", "stopped", "tripped", "reflex")
Edges = dict[tuple[str, str], set[str]]

# By edge: the line, and where its words go. One that is missing here is an error.
LINES: dict[tuple[str, str], tuple[str, float, float, str]] = {
    ("relaxed", "attaching"): ("M168,112 H245", 207, 104, "middle"),
    ("attaching", "holding"): ("M363,120 H440", 402, 112, "middle"),
    ("holding", "playing"): ("M558,112 H635", 597, 104, "middle"),
    ("playing", "holding"): ("M637,128 H560", 597, 148, "middle"),
    ("holding", "unwinding"): ("M480,140 V228 H365", 424, 206, "middle"),
    ("unwinding", "holding"): ("M363,245 H520 V142", 440, 261, "middle"),
    ("unwinding", "relaxed"): ("M247,235 H100 V142", 150, 229, "start"),
    ("attaching", "relaxed"): ("M247,128 H170", 207, 144, "middle"),
    ("reflex", "tripped"): ("M637,450 H560", 597, 426, "middle"),
}


def edges() -> Edges:
    """Return the events that lead from one mode to another, by the two."""
    table = state_table()
    modes = list(table.modes)
    found: Edges = {}
    for event, row in table.cells.items():
        for mode, byte in zip(modes, row, strict=True):
            if byte < REFUSE and modes[byte] != mode:
                found.setdefault((mode, modes[byte]), set()).add(event)
    return found


def take(found: Edges, event: str, to: str) -> list[str]:
    """Take all edges of an event to a mode; return where they start."""
    starts = [start for (start, end), events in found.items() if end == to and event in events]
    for start in starts:
        found[start, to].discard(event)
        if not found[start, to]:
            del found[start, to]
    return starts


def draw(path: Path) -> None:
    """Draw the picture.

    Raises
    ------
    ValueError
        The table has a way that the picture has no line for.
    """
    found = edges()
    stopped, faulty = take(found, "stop", "stopped"), take(found, "fault", "fault")
    tripped, reflex = take(found, "trip", "tripped"), take(found, "trip_retract", "reflex")
    limp = take(found, "limp", "relaxed")
    resumed = [
        take(found, "resume_attached", "holding"),
        take(found, "resume_partly", "attaching"),
        take(found, "resume_detached", "relaxed"),
    ]
    everywhere = set(PLACES)
    expected = (
        set(stopped) == everywhere - {"stopped", "fault"}
        and set(faulty) == everywhere - {"fault"}
        and set(tripped) == {"attaching", "holding", "playing", "unwinding", "reflex"}
        and set(reflex) == {"holding", "playing"}
        and set(limp) == {"attaching", "holding", "playing", "unwinding"}
        and all(set(starts) == {"stopped", "tripped", "fault"} for starts in resumed)
    )
    found.setdefault(("attaching", "relaxed"), set()).add("limp")
    if not expected or set(found) != set(LINES):
        raise ValueError(f"The picture does not fit the state table: {found.keys() ^ LINES.keys()}")

    svg = Svg(800, 518)
    svg.box(20, 50, 760, 225, fill=palette.PANEL)
    svg.text(34, 74, "does what it is told", colour=palette.MUTED, weight="bold")
    svg.text(34, 264, "limp: to relaxed, from all these", colour=palette.MUTED, size=12)
    svg.box(20, 370, 760, 133, fill="#fbeef0")
    svg.text(34, 394, "latched", colour=palette.MUTED, weight="bold")
    out = "only resume leads out: to holding, or to attaching or relaxed where pulses are off"
    svg.text(34, 492, out, colour=palette.MUTED, size=12)
    for edge, (line, x, y, anchor) in LINES.items():
        colour = palette.CONTACT if edge[1] in LATCHED else palette.PRESSURE
        words = sorted(found[edge], key=list(state_table().events).index)
        svg.path(line, colour=colour, arrow=True)
        for i, word in enumerate(words):
            svg.text(x, y + 15 * i, word.replace("_", " "), size=12, anchor=anchor, halo=True)
    for x, word, remark, anchor in (
        (110, "fault", "from any", "start"),
        (305, "stop", "from any but fault", "start"),
        (500, "trip", "from all but relaxed", "start"),
        (695, "trip retract", "from holding, playing", "end"),
    ):
        beside = x + 8 if anchor == "start" else x - 8
        y = 300 if anchor == "start" else 340
        svg.path(f"M{x},277 V427", colour=palette.CONTACT, arrow=True)
        svg.text(beside, y, word, size=12.5, weight="bold", colour=palette.CONTACT,
                 anchor=anchor)  # fmt: skip
        svg.text(beside, y + 16, remark, size=12, colour=palette.MUTED, anchor=anchor)
    svg.path("M40,368 V279", colour=palette.TENDON, arrow=True, width=2.5)
    svg.text(48, 345, "resume", size=12.5, weight="bold", colour=palette.TENDON, halo=True)
    for mode, (x, y) in PLACES.items():
        edge = palette.CONTACT if mode in LATCHED else palette.PRESSURE
        svg.box(x - WIDTH / 2, y - HEIGHT / 2, WIDTH, HEIGHT, fill=palette.PAPER, edge=edge)
        svg.text(x, y + 1, mode, anchor="middle", weight="bold", size=14)
        svg.text(x, y + 15, state_table().states[mode], anchor="middle", size=10.5,
                 colour=palette.MUTED)  # fmt: skip
    svg.text(20, 32, "What the board does when", size=17, weight="bold")
    svg.save(path, "The board's modes and what leads from one to the other")
