"""The animation of a trial."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from setae.report import extras, palette, scene, style
from setae.report.trial import Trial, origin_note


def write(path: Path, trial: Trial, *, frames: int = 96, width_px: int = 560) -> None:
    """Write an animated GIF: the way down, then the level where it ended in detail."""
    motion = trial.motion
    if motion is None:
        return
    image = extras.load("PIL.Image")
    floor = scene.floor_mm([trial])
    images = []
    with style.used():
        for index in _story(trial, frames):
            figure = style.figure(5.2, 5.2)
            axes = figure.add_axes((0.0, 0.0, 1.0, 0.93))
            now_us = int(motion.time_us[index])
            touched = [c for c in trial.contacts if c.time_us <= now_us]
            scene.draw(axes, trial, index, floor, touched, scale=0.9)
            scene.frame(axes, trial, floor, motion.arm_mm[0, 2] + scene.ABOVE_MM)
            descent = motion.arm_mm[0, 2] - motion.arm_mm[index, 2]
            figure.text(
                0.03, 0.955, f"{descent:.0f} mm down", fontsize=13, weight="bold", va="center"
            )
            fresh = bool(touched) and now_us - touched[-1].time_us < 600_000
            figure.text(
                0.97, 0.955, "touch!" if fresh else origin_note([trial]).split(",")[0],
                fontsize=13 if fresh else 11, ha="right", va="center",
                color=palette.CONTACT if fresh else palette.MUTED,
                weight="bold" if fresh else "normal",
            )  # fmt: skip
            buffer = BytesIO()
            figure.savefig(buffer, dpi=width_px / 5.2, format="png")
            images.append(image.open(buffer).convert("RGB"))
    colours = _shared_palette(image, images[len(images) // 2])
    flat = [frame.quantize(palette=colours, dither=image.Dither.NONE) for frame in images]
    flat[0].save(path, save_all=True, append_images=flat[1:], duration=100, loop=0, optimize=True)


def _shared_palette(image: Any, frame: Any) -> Any:
    """Build one palette for all frames, or the background would flicker."""
    thin = (  # colours of thin things, which would otherwise lose against the wall's blues
        palette.CONTACT, palette.TENDON, palette.BRISTLE, palette.SPRING, palette.SILICONE,
        palette.INK, palette.MUTED, palette.mix(palette.CONTACT, "#ffffff", 0.6),
    )  # fmt: skip
    strip = frame.height // 6
    sample = image.new("RGB", (frame.width, frame.height + strip * len(thin)), "white")
    sample.paste(frame, (0, 0))
    for row, colour in enumerate(thin):
        sample.paste(
            colour, (0, frame.height + row * strip, frame.width, frame.height + (row + 1) * strip)
        )
    return sample.quantize(colors=160, method=image.Quantize.MEDIANCUT)


def _story(trial: Trial, frames: int) -> list[int]:
    """Indices of frames: a little of each level, most around the first touch."""
    motion = trial.motion
    assert motion is not None
    if not trial.levels:
        times = np.linspace(trial.start_us, trial.end_us, frames)
        return [motion.at(float(time)) for time in times]
    last = trial.levels[-1]
    touch = next((d for d in last.directions if d.touched), last.directions[0])
    parts = (
        (trial.start_us, last.start_us, 0.34),
        (touch.start_us, touch.end_us, 0.32),
        (touch.end_us, last.end_us, 0.24),
        (last.end_us, trial.end_us, 0.10),
    )
    times = np.concatenate(
        [
            np.linspace(start, end, max(round(frames * share), 2), endpoint=False)
            for start, end, share in parts
        ]
    )
    return [motion.at(float(time)) for time in times]
