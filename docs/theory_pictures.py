"""Draw the theory page's pictures of tendons into docs/pictures.

    python docs/theory_pictures.py

`make_pictures.py` does it too.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from setae import kinematics, tendons
from setae.arc import Arc, FloatArray
from setae.config import Geometry
from setae.report import palette

PICTURES = Path(__file__).resolve().parent / "pictures"
GEOMETRY = Geometry()
COLOURS = {"paper": palette.CONTACT, "parallel": palette.PRESSURE, "taut": palette.TENDON}
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": palette.INK,
    "axes.labelcolor": palette.INK,
    "axes.edgecolor": palette.MUTED,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": palette.MUTED,
    "ytick.color": palette.MUTED,
    "figure.facecolor": palette.PAPER,
}


def draw(folder: Path) -> None:
    """Draw all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        turning(folder / "tendon_turning.png")
        bending(folder / "tendon_bending.png")


def turning(path: Path) -> None:
    """One tendon while the bending direction goes round once."""
    figure = Figure(figsize=(9.6, 3.9), layout="constrained")
    tube = kinematics.inverse((15.0, 0.0, 60.0))
    poses = (
        ("Computed: z = 40 mm, bent by 90°", 40 * math.pi / 2, math.pi / 2),
        (
            "Computed: the tube's targets, r = 15, z = 60 mm",
            float(tube.length_mm),
            float(tube.theta_rad),
        ),
    )
    alpha = np.radians(np.arange(0.0, 360.05, 0.1))
    for axes, (title, length, theta) in zip(figure.subplots(1, 2), poses, strict=True):
        arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
        for model in ("parallel", "paper", "taut"):
            q = tendons.lengths(arc, GEOMETRY, model)[:, 0]
            _line(axes, np.degrees(alpha), q, model, jumps_mm=0.3)
        axes.set(title=title, xlabel="bending direction α from the tendon (degrees)", xlim=(0, 360))
        axes.set_xticks(range(0, 361, 90))
        axes.grid(color=palette.GRID)
    figure.axes[0].set_ylabel("tendon's length (mm)")
    figure.axes[0].legend(frameon=False, loc="lower center")
    _save(figure, path)


def bending(path: Path) -> None:
    """The inner tendon from the side, and three tendons while the spring bends."""
    figure = Figure(figsize=(9.6, 4.3), layout="constrained")
    side, sweep = figure.subplots(1, 2, width_ratios=(1, 1.25))
    _side_view(side, length=60.0, theta=math.radians(80))

    theta = np.radians(np.linspace(0, 90, 181))
    for psi_deg, dashes in ((0, "-"), (60, "--"), (90, ":")):
        arc = Arc.from_angles(length_mm=60, theta_rad=theta, alpha_rad=math.radians(psi_deg))
        fibre = tendons.lengths(arc, GEOMETRY, "parallel")[:, 0]
        for model in ("paper", "taut"):
            q = tendons.lengths(arc, GEOMETRY, model)[:, 0] - fibre
            sweep.plot(np.degrees(theta), q, dashes, color=COLOURS[model], linewidth=1.8)
        chord = fibre * (np.sinc(theta / 2 / math.pi) - 1)
        sweep.plot(np.degrees(theta), chord, dashes, color=palette.MUTED, linewidth=1.0)
    sweep.axhline(0, color=COLOURS["parallel"], linewidth=1.8)
    for label, colour in (("parallel", None), ("paper", None), ("taut", None), ("chord", "")):
        sweep.plot([], [], color=palette.MUTED if colour == "" else COLOURS[label], label=label)
    for label, dashes in (("ψ = 0°", "-"), ("ψ = 60°", "--"), ("ψ = 90°", ":")):
        sweep.plot([], [], dashes, color=palette.INK, linewidth=1.0, label=label)
    sweep.set(
        title="Against the offset arc, L = 60 mm",
        xlabel="bending angle θ (degrees)",
        ylabel="tendon, less its offset arc (mm)",
        xlim=(0, 90),
        ylim=(-7, 2),
    )
    sweep.grid(color=palette.GRID)
    sweep.legend(
        frameon=False, loc="lower left", ncols=2, fontsize=9, title_fontsize=9, alignment="left",
        title="ψ: bending direction, from the tendon",
    )  # fmt: skip
    _save(figure, path)


def _side_view(axes: Axes, *, length: float, theta: float) -> None:
    """The bore cut by the bending plane, with the inner tendon as each model takes it."""
    r, d, b = length / theta, GEOMETRY.tendon_radii_mm[0], GEOMETRY.lumen_radius_mm
    phi = np.linspace(0, theta, 200)

    def arc(radius: float) -> FloatArray:
        return np.stack([r - radius * np.cos(phi), radius * np.sin(phi)])

    wall = np.concatenate([arc(r - b), arc(r + b)[:, ::-1]], axis=1)
    axes.fill(*wall, color=palette.PANEL, zorder=0)
    for radius, label in ((r - b, "bore's wall"), (r + b, None)):
        axes.plot(*arc(radius), color=palette.SPRING, linewidth=1.5, label=label)
    axes.plot(*arc(r), color=palette.SPRING, linewidth=0.8, linestyle="-.", label="axis")
    ends = arc(r - d)[:, [0, -1]]
    axes.plot(*ends, color=palette.MUTED, linewidth=1.0, label="chord: through the wall")
    axes.plot(*arc(r - d), color=COLOURS["parallel"], linewidth=1.5, label="offset arc")
    beta = math.acos((r - b) / (r - d))
    on_wall = (phi >= beta) & (phi <= theta - beta)
    touching = np.concatenate([ends[:, :1], arc(r - b)[:, on_wall], ends[:, 1:]], axis=1)
    axes.plot(*touching, color=COLOURS["taut"], linewidth=2.0, label="taut")
    axes.set(title="Computed: inner tendon, 80°", aspect="equal", xlabel="x (mm)", ylabel="z (mm)")
    axes.set_ylim(-3, 84)
    axes.legend(frameon=False, loc="upper left", fontsize=9)


def _line(axes: Axes, x: FloatArray, y: FloatArray, model: str, *, jumps_mm: float) -> None:
    """A line that is broken where it jumps."""
    broken = np.where(np.abs(np.diff(y, prepend=y[0])) > jumps_mm, np.nan, y)
    axes.plot(x, broken, color=COLOURS[model], linewidth=1.8, label=model)


def _save(figure: Figure, path: Path) -> None:
    # No version of matplotlib in the file: the same code gives the same bytes.
    figure.savefig(path, dpi=140, metadata={"Software": None})


if __name__ == "__main__":
    draw(PICTURES)
