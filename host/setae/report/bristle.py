"""The report of a bristle's calibration: histograms, rates, and why this threshold."""

from __future__ import annotations

import csv
import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from setae.errors import LogError
from setae.experiments.bristle import EXPERIMENT, Move, Threshold, moves_in, rates, threshold
from setae.record import Log, read
from setae.report import extras, files, palette, style, template
from setae.report.files import Report
from setae.wording import counted

__all__ = ["finding", "picture", "write"]


def write(
    logs: str | Path | Iterable[str | Path | Log], out: str | Path, *, page: str = "report.html"
) -> Report:
    """Write the report of a calibration.

    Parameters
    ----------
    logs
        A folder with one log, or the log.
    out
        The folder to write to; made if it isn't there.
    page
        Name of the page in it.

    Raises
    ------
    LogError
        There isn't just one log, it holds no moves of both kinds, or the folder can't be
        written to.
    ExtraMissingError
        Matplotlib isn't installed.
    """
    given = [log if isinstance(log, Log) else read(log) for log in files.logs_of(logs)]
    if len(given) > 1 or given[0].metadata.get("experiment") != EXPERIMENT:
        raise LogError("That isn't one calibration of a bristle.", "Give its log alone.")
    log = given[0]
    moves = moves_in(log)
    if not any(move.touched for move in moves) or all(move.touched for move in moves):
        raise LogError(
            f"{log.path} has no moves without contact, or no touches: it ended early.",
            "Run `setae calibrate bristle` again.",
        )
    folder = Path(out)
    with files.writing(folder):
        pictures = files.pictures_of(folder)
        drawn = picture(pictures / "bristle.png", log)
        (folder / page).write_text(_page(log, moves, drawn), encoding="utf-8")
        table = folder / "moves.csv"
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("touched", "duration_s", "depth_mm", "peak_hpa"))
            for move in moves:
                depth = f"{move.depth_mm:.3f}" if move.touched else ""
                row = ("yes" if move.touched else "no", f"{move.duration_s:.3f}", depth)
                writer.writerow((*row, f"{move.peak_hpa:.4f}"))
    return Report(page=folder / page, pictures=(drawn,), tables=(table,))


def finding(moves: Sequence[Move], configured_hpa: float) -> str:
    """Say in a few sentences what came out."""
    chosen, now = threshold(moves), Threshold.of(configured_hpa, moves)
    free = max(move.peak_hpa for move in moves if not move.touched)
    touch = min(move.peak_hpa for move in moves if move.touched)
    text = f"Moves without contact make up to {free:.1f} hPa, touches at least {touch:.1f} hPa. "
    if free < touch:
        text += f"Every threshold in between parts them; {chosen.hpa:g} hPa is recommended. "
    else:
        text += f"No threshold parts them; {chosen.hpa:g} hPa makes the fewest errors. "
    return text + (
        f"At the configured {now.hpa:g} hPa {now.false} of {now.free} moves without contact count "
        f"as touches, and {now.missed} of {now.touches} touches are missed."
    )


def _note(log: Log) -> str:
    if not log.simulated:
        return "Measured on the robot."
    return f"Simulated, plant {log.metadata.get('plant')}, seed {log.metadata.get('seed')}."


# ----------------------------------------------------------------------------- picture


def picture(path: Path, log: Log) -> Path:
    """Draw histograms, rates over the threshold, and what the peaks depend on."""
    moves = moves_in(log)
    chosen, configured = threshold(moves), log.config.bristle.threshold_hpa
    free = np.array([move.peak_hpa for move in moves if not move.touched])
    touches = np.array([move.peak_hpa for move in moves if move.touched])
    most = 1.08 * max(float(touches.max()), configured, float(free.max()))
    ticker = extras.load("matplotlib.ticker")
    with style.used():
        figure = style.figure(12.4, 7.4)
        figure.text(0.02, 0.955, "When the bristle touches something", fontsize=16, weight="bold",
                    va="center")  # fmt: skip
        figure.text(
            0.02, 0.915,
            f"{_note(log)} Largest change of pressure in {counted(len(free), 'move')} without "
            f"contact and {len(touches)} with.",
            fontsize=10, color=palette.MUTED, va="center",
        )  # fmt: skip
        whole = figure.add_axes((0.065, 0.5, 0.915, 0.335))
        edges = np.linspace(0, most, 90)
        whole.hist(free, edges, color=palette.PRESSURE, alpha=0.85, label="without contact")
        whole.hist(touches, edges, color=palette.CONTACT, alpha=0.75, label="touches")
        whole.set_yscale("log")
        # Plain numbers, where the axis by itself writes 6 × 10⁰.
        whole.yaxis.set_major_formatter(ticker.LogFormatter())
        whole.yaxis.set_minor_formatter(ticker.LogFormatter())
        whole.set_ylabel("moves")
        _lines(whole, chosen.hpa, configured)
        whole.set_xlim(0, most)
        whole.set_xlabel("largest change of pressure (hPa)")
        whole.legend(frameon=False, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        _rates(figure.add_axes((0.065, 0.09, 0.26, 0.28)), moves, chosen.hpa, configured, most)
        _against(
            figure.add_axes((0.4, 0.09, 0.25, 0.28)), moves, "duration of a move (s)",
            "Without contact, by duration", touched=False,
        )  # fmt: skip
        _against(
            figure.add_axes((0.73, 0.09, 0.25, 0.28)), moves, "sent beyond the surface (mm)",
            "Touches, by depth", touched=True,
        )  # fmt: skip
        style.save(figure, path)
    return path


def _lines(axes: Any, chosen_hpa: float, configured_hpa: float) -> None:
    axes.axvline(configured_hpa, color=palette.INK, lw=1.6, label=f"set: {configured_hpa:g} hPa")
    axes.axvline(
        chosen_hpa,
        color=palette.AGREES,
        lw=1.8,
        ls=(0, (4, 2)),
        label=f"recommended: {chosen_hpa:g} hPa",
    )


def _rates(
    axes: Any, moves: Sequence[Move], chosen_hpa: float, configured_hpa: float, most_hpa: float
) -> None:
    places = np.linspace(0, most_hpa, 600)
    false, missed = rates(moves, places)
    axes.plot(places, 100 * false, color=palette.PRESSURE, lw=2, label="false")
    axes.plot(places, 100 * missed, color=palette.CONTACT, lw=2, label="missed")
    _lines(axes, chosen_hpa, configured_hpa)
    axes.set(xlim=(0, most_hpa), ylim=(-3, 103), xlabel="threshold (hPa)",
             ylabel="moves, touches (%)")  # fmt: skip
    axes.set_title("False and missed, by threshold", pad=8)
    axes.legend(axes.get_lines()[:2], ("false", "missed"), frameon=False, fontsize=9,
                loc="center left", bbox_to_anchor=(0.24, 0.6))  # fmt: skip


def _against(axes: Any, moves: Sequence[Move], label: str, title: str, *, touched: bool) -> None:
    some = [move for move in moves if move.touched == touched]
    x = [move.depth_mm if touched else move.duration_s for move in some]
    axes.scatter(
        x, [move.peak_hpa for move in some], s=9, alpha=0.5, linewidths=0,
        color=palette.CONTACT if touched else palette.PRESSURE,
    )  # fmt: skip
    axes.set_ylim(bottom=0)
    axes.set(xlabel=label, ylabel="largest change (hPa)")
    axes.set_title(title, pad=8)
    axes.grid(color=palette.GRID, zorder=0)
    axes.set_axisbelow(True)


# -------------------------------------------------------------------------------- page


def _page(log: Log, moves: Sequence[Move], drawn: Path) -> str:
    config = log.config
    chosen = threshold(moves)
    badge = (
        f'<span class="badge">{html.escape(_note(log).rstrip("."))}: no hardware</span>'
        if log.simulated
        else '<span class="badge real">Measured on the robot</span>'
    )
    return template.fill(
        "bristle.html",
        {
            "badges": badge,
            "finding": html.escape(finding(moves, config.bristle.threshold_hpa)),
            "picture": template.image(drawn, "Histograms of the pressure's largest change"),
            "table": _table(moves, sorted({config.bristle.threshold_hpa, chosen.hpa, 5.0, 10.0,
                                           15.0, 20.0, 25.0, 30.0}), chosen.hpa),
            "fragment": f"[bristle]\nthreshold_hpa = {chosen.hpa:.1f}",
            "config": template.config_text(log.metadata),
        },
    )  # fmt: skip


def _table(moves: Sequence[Move], places: Sequence[float], chosen_hpa: float) -> str:
    rows = []
    for hpa in places:
        one = Threshold.of(hpa, moves)
        name = f"<b>{hpa:g}</b> (recommended)" if hpa == chosen_hpa else f"{hpa:g}"
        rows.append(
            f"<tr><td>{name}</td><td>{one.false} of {one.free}</td><td>{one.false_rate:.2%}</td>"
            f"<td>{one.missed} of {one.touches}</td><td>{one.missed_rate:.2%}</td></tr>"
        )
    return (
        "<table><thead><tr><th>threshold (hPa)</th><th>false</th><th></th><th>missed</th><th></th>"
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )
