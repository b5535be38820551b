"""The workspace as a picture and as a page: what is reached, held, and lost to what."""

from __future__ import annotations

import html
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from setae import volume
from setae.arc import Arc, FloatArray
from setae.config import Config
from setae.experiments.targets import combinations
from setae.report import extras, palette, style, template
from setae.volume import Fate, FateArray, Volumes
from setae.workspace import check

COLOURS = {
    Fate.HELD: "#3f7cac",
    Fate.SLACK: "#f0b27a",
    Fate.TENSION: "#d4213d",
    Fate.LONG: "#dfe5ea",
    Fate.TRAVEL: "#b7aecb",
}
NAMES = {
    Fate.HELD: "reached and held",
    Fate.SLACK: "reached, but a tendon hangs slack",
    Fate.TENSION: "lost to tension",
    Fate.LONG: "lost: a tendon longer than the free spring",
    Fate.TRAVEL: "lost to servo travel",
}
CUT_RAD = (0.0, 1.5 * math.pi)  # a quarter is taken out, so that one sees inside
EYE_DEG = (18.0, -45.0)  # elevation and azimuth: into the missing quarter
_LIGHT = np.array([0.35, -0.55, 0.76])


def require() -> None:
    """Import what drawing needs, before any work is done.

    Raises
    ------
    ExtraMissingError
        The extra ``report`` isn't installed.
    """
    extras.load("matplotlib")
    extras.load("plotly.offline")


def shown(measured: Volumes) -> list[Fate]:
    """Fates that occur, from the inside out."""
    return [kind for kind in Fate if kind is Fate.HELD or measured.lost[kind].cm3 > 0]


# ------------------------------------------------------------------------- the body


def surface(
    config: Config,
    model: str,
    *,
    most: Fate = Fate.TRAVEL,
    lengths: int = 90,
    bends: int = 72,
    turns: int = 72,
) -> tuple[FloatArray, FateArray]:
    """Outside of a part of the workspace with a quarter cut out, as quadrilaterals.

    Parameters
    ----------
    config, model
        The robot and its tendon model.
    most
        The part: all fates up to this one.
    lengths, bends, turns
        Quadrilaterals along length, bending and direction.

    Returns
    -------
    quads_mm : ndarray, shape (q, 4, 3)
        Corners.
    fates : ndarray, shape (q,)
        What is just inside of each.
    """
    alpha = np.linspace(*CUT_RAD, turns + 1)
    theta = np.linspace(0.0, config.geometry.max_bend_rad, bends + 1)
    low, high = _ends(config, model, theta, alpha, most)
    there = ~np.isnan(low)
    quads, kinds = [], []

    def face(length: FloatArray, bend: FloatArray, turn: FloatArray, inside: FloatArray) -> None:
        sheet = _top_mm(length, bend, turn)
        corner = [sheet[:-1, :-1], sheet[1:, :-1], sheet[1:, 1:], sheet[:-1, 1:]]
        quad = np.stack(corner, axis=2).reshape(-1, 4, 3)
        middles = [
            (v[:-1, :-1] + v[1:, :-1] + v[1:, 1:] + v[:-1, 1:]) / 4 for v in (inside, bend, turn)
        ]
        whole = np.isfinite(quad).all(axis=(1, 2))
        arc = Arc.from_angles(
            length_mm=middles[0].ravel()[whole],
            theta_rad=middles[1].ravel()[whole],
            alpha_rad=middles[2].ravel()[whole],
        )
        quads.append(quad[whole])
        kinds.append(np.minimum(volume.fates(check(arc, config, model)), int(most)))

    bend, turn = np.meshgrid(theta, alpha, indexing="ij")
    inwards = 1e-3 * (high - low)
    face(high, bend, turn, high - inwards)
    face(low, bend, turn, low + inwards)
    # The rim at the largest bending, and the two cuts.
    part = np.linspace(0.0, 1.0, lengths + 1)[:, np.newaxis]
    last = int(np.flatnonzero(there.any(axis=1)).max())
    for take in (np.s_[last, :], np.s_[:, 0], np.s_[:, -1]):
        length = low[take] + part * (high[take] - low[take])
        bends_here, turns_here = (np.broadcast_to(v[take], length.shape) for v in (bend, turn))
        face(length, bends_here, turns_here, length)
    return np.concatenate(quads), np.concatenate(kinds)


def _top_mm(length: FloatArray, theta: FloatArray, alpha: FloatArray) -> FloatArray:
    """Positions of the spring's top; NaN where the length is."""
    top = Arc.from_angles(
        length_mm=np.where(np.isnan(length), 1.0, length), theta_rad=theta, alpha_rad=alpha
    ).top_mm
    return np.where(np.isnan(length)[..., np.newaxis], np.nan, top)


def _ends(
    config: Config, model: str, theta: FloatArray, alpha: FloatArray, most: Fate
) -> tuple[FloatArray, FloatArray]:
    """Shortest and longest spring of a part, for each bending and direction; NaN: none."""
    geometry = config.geometry
    length = np.linspace(geometry.min_length_mm, geometry.free_length_mm, 21)

    def inside(lengths: FloatArray) -> npt.NDArray[np.bool_]:
        shape = np.broadcast_shapes(lengths.shape, (len(theta), len(alpha)))
        arc = Arc.from_angles(
            length_mm=np.broadcast_to(lengths, shape),
            theta_rad=np.broadcast_to(theta[:, np.newaxis], shape),
            alpha_rad=np.broadcast_to(alpha, shape),
        )
        return np.asarray(volume.fates(check(arc, config, model)) <= int(most))

    found = inside(length[:, np.newaxis, np.newaxis])
    some = found.any(axis=0)
    first, last = np.argmax(found, axis=0), len(length) - 1 - np.argmax(found[::-1], axis=0)
    ends = []
    for good, beyond in ((first, first - 1), (last, last + 1)):
        good_mm, bad_mm = length[good], length[np.clip(beyond, 0, len(length) - 1)]
        for _ in range(10):
            middle = (good_mm + bad_mm) / 2
            ok = inside(middle)
            good_mm, bad_mm = np.where(ok, middle, good_mm), np.where(ok, bad_mm, middle)
        ends.append(np.where(some, good_mm, np.nan))
    return ends[0], ends[1]


def _shaded(quads: FloatArray, colours: list[str]) -> list[str]:
    normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    size = np.linalg.norm(normal, axis=1)
    lit = np.abs(normal @ _LIGHT) / np.maximum(size, 1e-12)
    return [
        palette.mix(colour, "#ffffff" if share > 0.6 else palette.INK,
                    0.5 * (share - 0.6) if share > 0.6 else 0.22 * (0.6 - share))
        for colour, share in zip(colours, lit, strict=True)
    ]  # fmt: skip


# ------------------------------------------------------------------------ the picture


def picture(path: Path, config: Config, model: str, measured: Volumes) -> Path:
    """Draw the body with a quarter cut out, and two sections."""
    with style.used():
        figure = style.figure(14.6, 5.2)
        grid = figure.add_gridspec(
            1,
            3,
            width_ratios=(1.15, 1, 1),
            left=-0.01,
            right=0.985,
            bottom=0.2,
            top=0.79,
            wspace=0.2,
        )
        _body(figure.add_subplot(grid[0], projection="3d"), config, model)
        draw_section(figure.add_subplot(grid[1]), config, model, 0.0, targets=True)
        draw_section(figure.add_subplot(grid[2]), config, model, math.pi / 4)
        figure.text(
            0.03, 0.955, "Where the spring’s top can be", fontsize=15, fontweight="bold", va="top"
        )
        figure.text(0.03, 0.895, f"Computed. {finding(measured, model)}", fontsize=10.5, va="top",
                    color=palette.MUTED)  # fmt: skip
        _legend(figure, measured)
        style.save(figure, path)
    return path


def finding(measured: Volumes, model: str) -> str:
    """Say in a line what came out."""

    def size(part: volume.Volume) -> str:
        return f"{part.cm3:.1f} ± {part.error_cm3:.2f} cm³"

    return (
        f"The spring alone: {size(measured.spring)}. Reached: {size(measured.reachable)}. "
        f"Reached and held by tendons that only pull: {size(measured.held)}. "
        f"Tendon model {model}; {measured.samples} poses."
    )


def _body(axes: Any, config: Config, model: str) -> None:
    art = extras.load("mpl_toolkits.mplot3d.art3d")
    quads, kinds = surface(config, model)
    colours = _shaded(quads, [COLOURS[Fate(int(kind))] for kind in kinds])
    axes.add_collection3d(
        art.Poly3DCollection(quads, facecolors=colours, edgecolors=colours, linewidths=0.3)
    )
    low, high = quads.reshape(-1, 3).min(axis=0), quads.reshape(-1, 3).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.25)
    axes.view_init(elev=EYE_DEG[0], azim=EYE_DEG[1])
    axes.set_xlabel("x (mm)", labelpad=2)
    axes.set_ylabel("y (mm)", labelpad=2)
    axes.set_zlabel("z (mm)", labelpad=0)
    axes.tick_params(labelsize=8.5, pad=0)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1, 1, 1, 1))
        axis._axinfo["grid"].update(color=palette.GRID, linewidth=0.6)


def draw_section(
    axes: Any, config: Config, model: str, alpha_rad: float, *, targets: bool = False
) -> None:
    """Draw what becomes of the poses in the plane of α, and in that of α + 180°."""
    colors = extras.load("matplotlib.colors")
    kinds = list(Fate)
    for turn in (0.0, math.pi):
        corners, fate = volume.section(config, alpha_rad + turn, model)
        side = 1 if turn == 0 else -1
        axes.pcolormesh(
            side * corners[..., 0],
            corners[..., 1],
            fate,
            cmap=colors.ListedColormap([COLOURS[kind] for kind in kinds]),
            vmin=-0.5,
            vmax=len(kinds) - 0.5,
            shading="flat",
            rasterized=True,
        )
    if targets:
        _targets(axes, config, model)
    degrees = math.degrees(alpha_rad)
    axes.set_title(f"Section through α = {degrees:g}° and {degrees + 180:g}°", pad=8)
    axes.set_aspect("equal")
    axes.set_xlabel("distance from the axis (mm)")
    axes.set_ylabel("z (mm)")
    axes.plot([0, 0], axes.get_ylim(), color=palette.PAPER, linewidth=0.8)


def _targets(axes: Any, config: Config, model: str) -> None:
    arc = combinations()
    reach = check(arc, config, model)
    top = arc.top_mm
    for held, face in ((True, palette.INK), (False, palette.PAPER)):
        some = reach.reachable & (reach.holdable == held)
        axes.scatter(top[some, 0], top[some, 2], s=13, color=face, edgecolors=palette.INK,
                     linewidths=0.8, zorder=4)  # fmt: skip


def _legend(figure: Any, measured: Volumes) -> None:
    patches, lines = extras.load("matplotlib.patches"), extras.load("matplotlib.lines")
    handles = [
        patches.Patch(fc=COLOURS[kind], ec=palette.MUTED, lw=0.4, label=NAMES[kind])
        for kind in shown(measured)
    ]
    for face, label in (
        (palette.INK, "the paper’s targets, held"),
        (palette.PAPER, "not held"),
    ):
        handles.append(
            lines.Line2D([], [], marker="o", ls="", ms=4.5, mfc=face, mec=palette.INK, label=label)
        )
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.005),
                  ncols=len(handles), frameon=False, fontsize=10, handlelength=1.3,
                  columnspacing=1.6)  # fmt: skip


# --------------------------------------------------------------------------- the page


def page(path: Path, config: Config, model: str, measured: Volumes) -> Path:
    """Write the workspace as one web page that needs no network.

    Raises
    ------
    ExtraMissingError
        Plotly isn't installed.
    """
    plotly = extras.load("plotly.offline")
    values = {
        "finding": html.escape(finding(measured, model)),
        "table": _table(measured),
        "model": html.escape(model),
        "config": html.escape(config.to_toml()),
        "plotly": plotly.get_plotlyjs(),
        "data": template.json_text(_data(config, model, measured)),
        "js": template.text("workspace.js"),
    }
    path.write_text(template.fill("workspace.html", values), encoding="utf-8")
    return path


def _table(measured: Volumes) -> str:
    whole = measured.spring.cm3

    def row(name: str, part: volume.Volume, colour: str = "") -> str:
        key = f'<i class="dot" style="background:{colour}"></i>' if colour else ""
        return (
            f"<tr><td>{key}{html.escape(name)}</td><td>{part.cm3:.1f}</td>"
            f"<td>{part.error_cm3:.2f}</td><td>{part.cm3 / whole:.0%}</td></tr>"
        )

    rows = [row("what the spring alone could take", measured.spring)]
    rows += [
        row(NAMES[kind], measured.lost[kind], COLOURS[kind])
        for kind in (Fate.TRAVEL, Fate.LONG, Fate.TENSION, Fate.SLACK)
    ]
    rows.append(row(NAMES[Fate.HELD], measured.held, COLOURS[Fate.HELD]))
    return (
        "<table><thead><tr><th></th><th>cm³</th><th>± (standard error)</th><th>part</th></tr>"
        f"</thead><tbody>{''.join(rows)}</tbody></table>"
    )


_SECTION_STEP_DEG = 15.0
_SECTION_LENGTHS, _SECTION_BENDS = 80, 64


def _data(config: Config, model: str, measured: Volumes) -> dict[str, Any]:
    bodies = []
    for name, most, cells in (
        ("everything", Fate.TRAVEL, (80, 72)),
        ("reached", Fate.TENSION, (60, 60)),
        ("reached and held", Fate.HELD, (20, 40)),
    ):
        quads, kinds = surface(config, model, most=most, lengths=cells[0], bends=cells[1], turns=54)
        rounded = np.round(quads, 1).reshape(len(quads), -1).tolist()
        bodies.append({"name": name, "quads": rounded, "kinds": "".join(map(str, kinds))})
    degrees = np.arange(0.0, 360.0, _SECTION_STEP_DEG)
    shape = {"lengths": _SECTION_LENGTHS, "bends": _SECTION_BENDS}
    cuts = [volume.section(config, math.radians(angle), model, **shape) for angle in degrees]
    return {
        "bodies": bodies,
        "colours": [COLOURS[kind] for kind in Fate],
        "names": [NAMES[kind] for kind in Fate],
        "shown": [int(kind) for kind in shown(measured)],
        "step_deg": _SECTION_STEP_DEG,
        # The same corners in every direction; only the fates differ.
        "corners": np.round(cuts[0][0], 2).tolist(),
        "sections": ["".join(map(str, fate.ravel())) for _, fate in cuts],
        "ink": palette.INK,
        "muted": palette.MUTED,
    }
