"""Which imperfection costs how much: a picture and a part of the validation's page."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from setae.experiments.causes import MODEL, Effect, compared
from setae.experiments.targets import paper_targets
from setae.record import Log
from setae.report import extras, palette, style, template

__all__ = ["note_of", "picture", "section"]

_GAIN = palette.AGREES
_ADD = palette.BRISTLE


def note_of(study: Log) -> str:
    """Say where a study is from, and how many of the paper's targets its means are of."""
    means_of, of_all = len(compared(study)), len(paper_targets(study.config))
    return f"Simulated, plant {study.metadata.get('plant')}, {means_of} of {of_all} targets."


def picture(path: Path, effects: Sequence[Effect], note: str) -> Path:
    """Draw what each cause adds alone, and what mending it gains, the largest gain first."""
    patches = extras.load("matplotlib.patches")
    none_mm, all_mm = effects[0].none_mm, effects[0].all_mm
    with style.used():
        figure = style.figure(10.5, 2.3 + 0.52 * len(effects))
        high = figure.get_figheight()
        figure.text(0.02, 1 - 0.3 / high, "What to mend first", fontsize=16, weight="bold",
                    va="center")  # fmt: skip
        figure.text(
            0.02, 1 - 0.62 / high,
            f"Mean error in the bending plane; what mending gains the most is on top. {note}",
            fontsize=10, color=palette.MUTED, va="center",
        )  # fmt: skip
        axes = figure.add_axes((0.2, 0.62 / high, 0.775, 1 - 1.85 / high))
        for place, effect in enumerate(effects):
            for shift, start, end, colour in (
                (-0.19, none_mm, effect.alone_mm, _ADD),
                (0.19, all_mm, effect.mended_mm, _GAIN if effect.gains_mm > 0 else palette.CONTACT),
            ):
                axes.barh(place + shift, end - start, left=start, height=0.32, color=colour,
                          alpha=0.85, zorder=2)  # fmt: skip
                side = 1 if end >= start else -1
                axes.annotate(
                    f"{end - start:+.2f}", (end, place + shift), xytext=(4 * side, 0),
                    textcoords="offset points", ha="left" if side > 0 else "right", va="center",
                    fontsize=9, color=palette.INK, zorder=4,
                )  # fmt: skip
        for value, colour in ((none_mm, _ADD), (all_mm, _GAIN)):
            axes.axvline(value, color=colour, lw=1.2, ls=(0, (4, 2)), zorder=1)
        axes.set_yticks(
            range(len(effects)),
            [effect.cause for effect in effects],
            color=palette.INK,
            fontsize=11,
        )
        axes.tick_params(axis="y", length=0)
        axes.invert_yaxis()
        values = [v for e in effects for v in (e.alone_mm, e.mended_mm, none_mm, all_mm)]
        room = 0.12 * (np.max(values) - np.min(values) + 0.5)
        axes.set_xlim(max(0.0, np.min(values) - room), np.max(values) + room)
        axes.set_xlabel("mean error (mm)")
        axes.spines["left"].set_visible(False)
        axes.grid(axis="x", color=palette.GRID, zorder=0)
        axes.set_axisbelow(True)
        figure.legend(
            handles=[
                patches.Patch(color=_ADD, alpha=0.85, label=f"it alone, from {none_mm:.2f} mm"),
                patches.Patch(color=_GAIN, alpha=0.85, label=f"it mended, from {all_mm:.2f} mm"),
                patches.Patch(color=palette.CONTACT, alpha=0.85, label="mending it alone is worse"),
            ],
            loc="center right", bbox_to_anchor=(0.985, 1 - 0.95 / high), ncols=3, frameon=False,
            fontsize=9.5,
        )  # fmt: skip
        style.save(figure, path)
    return path


_NOTE = (
    "The same targets, driven on plants with one imperfection alone, and with all but one. Causes "
    "hide one another, so the two orders differ: what mending gains is what a lab would see. A "
    "tendon model is the host’s part: “mended” means commanding with that model. Mean errors in "
    "the bending plane, mm."
)


def section(effects: Sequence[Effect], drawn: Path, left_out: str = "") -> str:
    """Return the page's part about causes, with a word on targets that its means leave out."""
    first = effects[0]
    rows = [("none at all", f"{first.none_mm:.2f}", "", "", "")]
    rows += [
        (
            effect.cause,
            f"{effect.alone_mm:.2f}",
            f"{effect.adds_mm:+.2f}",
            f"{effect.mended_mm:.2f}",
            f"{effect.gains_mm:+.2f}",
        )
        for effect in effects
    ]
    rows.append(("all together", f"{first.all_mm:.2f}", "", "", ""))
    body = "".join(
        f"<tr><td>{html.escape(name)}</td>"
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    return (
        '<h2 id="causes">What to mend first</h2>'
        f'<p class="lead"><b>{html.escape(finding(effects))}</b></p>'
        f'<p class="note">{_NOTE} {html.escape(left_out)}</p>'
        '<div class="scroll"><table><thead><tr><th>cause</th><th>it alone</th><th>adds</th>'
        "<th>all but it</th><th>mending gains</th></tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
        + template.image(drawn, "What each imperfection adds alone, and what mending it gains")
    )


def finding(effects: Sequence[Effect]) -> str:
    """Say in a sentence or two what to mend first."""
    first = effects[0]
    if first.gains_mm <= 0:
        return "Mending one cause alone gains nothing: they make up for one another."
    parts = [_deed(effect) for effect in effects[:3] if effect.gains_mm > 0.05]
    text = f"Of the {first.all_mm:.2f} mm, most goes by {_joined(parts)}."
    return text + (
        f" What no mending reaches is {first.none_mm:.2f} mm: the kinematic model, and targets "
        "that tendons can’t hold."
    )


def _deed(effect: Effect) -> str:
    how = (
        f"commanding with the {effect.cause.removeprefix('tendon ')}"
        if effect.cause.startswith(MODEL)
        else f"mending the {effect.cause}"
    )
    return f"{how} ({-effect.gains_mm:+.2f} mm)"


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} or {parts[-1]}"
