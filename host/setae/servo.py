"""Between tendon lengths, servo pulses and what the board understands.

    pulse_us = pulse_free_us + direction · us_per_degree · φ        in degrees
    free_length − length = R φ + g φ² / 4π                          in radians

`setae.pulley` has the second line: g is the growth of the pulley where the line
winds onto itself, 0 unless configured. One microsecond of pulse is 0.055 mm of
tendon with the paper's pulleys. The board counts pulses in ticks of 0.5 µs, 0.027 mm:
rounding to the nearest one leaves at most 0.014 mm, half a tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from setae import packing, pulley, tendons, workspace
from setae.arc import Arc, FloatArray, finite_array, first_place
from setae.config import SERVOS, TENDON_MODELS, Config
from setae.errors import ConfigError, InputError, UnreachableError
from setae_protocol import messages

__all__ = ["FRAME_S", "ServoModel", "board_limits", "segment_messages"]

TICKS_PER_US = messages.PULSE_TICKS_PER_US
FRAME_S = messages.SERVO_FRAME_US * 1e-6
"""Duration of a servo frame."""

IntArray = npt.NDArray[np.int64]
Ticks = tuple[int, int, int, int]

_NO_SEGMENT = messages.Segment(duration_frames=0, target_ticks=(0, 0, 0, 0))


class ServoModel:
    """The robot's four servos.

    Parameters
    ----------
    config
        The robot.

    Attributes
    ----------
    length_min_mm, length_max_mm : ndarray, shape (4,)
        Shortest and longest tendon that each servo can give.
    resolution_mm : ndarray, shape (4,)
        Tendon that one tick of 0.5 µs winds, where it winds most: 0.027 mm on the
        paper's pulleys. Rounding costs at most half of it.
    slew_ticks : int
        Fastest change of any pulse that the board allows, ticks a servo frame.
    max_speed_mm_s : ndarray, shape (4,)
        Fastest planned motion of each tendon that the board accepts, once its
        targets are rounded to ticks, and that the servo can follow.

    Examples
    --------
    >>> from setae import config
    >>> servos = ServoModel(config.load())
    >>> servos.pulses_us([70, 70, 70, 60]).round(1)
    array([ 850. ,  850. ,  850. , 1031.9])
    >>> servos.ticks([70, 70, 70, 60])
    array([1700, 1700, 1700, 2064])
    >>> servos.lengths_mm(servos.ticks([70, 70, 70, 60])).round(2)
    array([70.  , 70.  , 70.  , 59.99])
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._free_mm = config.geometry.free_length_mm
        self._min_us = np.array(config.servo.pulse_min_us)
        self._max_us = np.array(config.servo.pulse_max_us)
        self.length_min_mm, self.length_max_mm = workspace.servo_range_mm(config)

        ends = np.stack(pulley.travel_mm(config))
        shrink = config.geometry.pulley_radius_mm / pulley.radius_mm(ends, config)
        ticks_per_mm = pulley.us_per_mm(config) * TICKS_PER_US * shrink
        self.resolution_mm = 1 / ticks_per_mm.min(axis=0)
        # One limit for four servos: the one with the fewest ticks a millimetre sets it.
        self.slew_ticks = math.floor(
            config.motion.slew_mm_s * FRAME_S * float(ticks_per_mm.min()) + 1e-9
        )
        if self.slew_ticks < 2:
            raise ConfigError(
                f"[motion] slew_mm_s = {config.motion.slew_mm_s:g} is less than two pulse ticks "
                "a servo frame.",
                f"Choose at least {3 / (FRAME_S * float(ticks_per_mm.min())):.1f} mm/s.",
            )
        # Rounding both ends of a frame can add one tick.
        board_mm_s = (self.slew_ticks - 1) / ticks_per_mm.max(axis=0) / FRAME_S
        self.max_speed_mm_s = np.minimum(board_mm_s, config.servo.speed_mm_s)

    def pulses_us(self, lengths_mm: npt.ArrayLike) -> FloatArray:
        """Compute pulses for tendon lengths.

        Parameters
        ----------
        lengths_mm : array_like, shape (..., 4)
            Tendon lengths.

        Returns
        -------
        ndarray, shape (..., 4)
            Pulses in µs, not rounded.

        Raises
        ------
        UnreachableError
            A pulse lies beyond an end stop; names the servo and the length.
        """
        q = finite_array("lengths_mm", lengths_mm, last_axis=SERVOS, what="one a servo")
        pulses = self._unchecked_us(q)
        # Half a tick: what rounding would take back.
        slack_us = 0.5 / TICKS_PER_US
        bad = (pulses < self._min_us - slack_us) | (pulses > self._max_us + slack_us)
        if bad.any():
            place = tuple(np.argwhere(bad)[0])
            servo = int(place[-1])
            where = f" (lengths_mm{first_place(bad)})" if bad.ndim > 1 else ""
            raise UnreachableError(
                f"Servo {servo} can't give a tendon of {q[place]:.2f} mm{where}: it would need a "
                f"pulse of {pulses[place]:.0f} µs, and its travel is {self._min_us[servo]:g} to "
                f"{self._max_us[servo]:g} µs.",
                f"Keep tendon {servo} from {self.length_min_mm[servo]:.2f} to "
                f"{self.length_max_mm[servo]:.2f} mm.",
            )
        return np.asarray(np.clip(pulses, self._min_us, self._max_us))

    def _unchecked_us(self, q: FloatArray) -> FloatArray:
        return pulley.pulses_us(self._free_mm - q, self._config)

    def ticks(self, lengths_mm: npt.ArrayLike) -> IntArray:
        """Like `pulses_us`, in the board's ticks, rounded to the nearest."""
        return np.rint(self.pulses_us(lengths_mm) * TICKS_PER_US).astype(np.int64)

    def lengths_mm(self, ticks: npt.ArrayLike) -> FloatArray:
        """Compute tendon lengths for pulses.

        Parameters
        ----------
        ticks : array_like, shape (..., 4)
            Pulses in ticks, whole or not.

        Returns
        -------
        ndarray, shape (..., 4)
            Tendon lengths in mm.
        """
        pulses = finite_array("ticks", ticks, last_axis=SERVOS, what="one a servo")
        return self._free_mm - pulley.wound_by_us(pulses / TICKS_PER_US, self._config)

    def lengths_from_us(self, pulses_us: npt.ArrayLike) -> FloatArray:
        """Like `lengths_mm`, from pulses in µs."""
        pulses = finite_array("pulses_us", pulses_us, last_axis=SERVOS, what="one a servo")
        return self.lengths_mm(pulses * TICKS_PER_US)

    def free_ticks(self) -> IntArray:
        """Pulses at which all tendons have the free length, shape (4,)."""
        return self.ticks(np.full(SERVOS, self._free_mm))

    def speed_ticks(self, speed_mm_s: float) -> int:
        """Compute a speed in ticks a servo frame, at least 1 and at most the board's limit.

        Examples
        --------
        >>> from setae import config
        >>> ServoModel(config.load()).speed_ticks(20.0)
        14
        """
        ticks_per_mm = 1 / float(self.resolution_mm.max())
        return max(1, min(self.slew_ticks, math.floor(speed_mm_s * FRAME_S * ticks_per_mm)))

    def segments(
        self,
        lengths_mm: npt.ArrayLike,
        *,
        start_ticks: npt.ArrayLike | None = None,
        tolerance_um: float | None = None,
        max_frames: int = packing.LONGEST_FRAMES,
    ) -> tuple[messages.Segment, ...]:
        """Make the fewest segments that bring the tendons along given lengths.

        The board goes straight, in pulses, from the end of one segment to the end of
        the next, and rounds to ticks. What it plays in each servo frame is within
        the tolerance and half a tick of the lengths; more segments would be no closer
        than half a tick.

        Parameters
        ----------
        lengths_mm : array_like, shape (n_frames, 4)
            Where the tendons are at the end of each servo frame.
        start_ticks : array_like, shape (4,)
            Where the board starts. None: at the first lengths.
        tolerance_um
            As above; None takes the configuration's.
        max_frames
            Longest segment.

        Returns
        -------
        tuple of Segment
            The last ends where the lengths do, to rounding.

        Raises
        ------
        UnreachableError
            As `pulses_us`.
        InputError
            No frames, or a tolerance or longest segment that means nothing.
        TrajectoryError
            The lengths change faster than the board allows.

        Examples
        --------
        >>> from setae import config
        >>> servos = ServoModel(config.load())
        >>> line = np.linspace([70, 70, 70, 69], [70, 70, 70, 60], 10)
        >>> [(s.duration_frames, s.target_ticks[3]) for s in servos.segments(line)]
        [(1, 1736), (9, 2064)]
        """
        pulses = self.pulses_us(lengths_mm) * TICKS_PER_US
        if pulses.ndim != 2 or not len(pulses):
            raise InputError(
                f"lengths_mm has shape {pulses.shape}.", "It must be (n_frames, 4), n_frames ≥ 1."
            )
        if tolerance_um is None:
            tolerance_um = self._config.motion.tolerance_um
        start = np.rint(pulses[0]) if start_ticks is None else np.asarray(start_ticks)
        ends, ticks = packing.pack(
            pulses,
            start_ticks=start.astype(np.int64),
            tolerance_ticks=tolerance_um * 1e-3 / self.resolution_mm,
            slew_ticks=self.slew_ticks,
            max_frames=max_frames,
        )
        return tuple(
            messages.Segment(duration_frames=int(frames), target_ticks=_four(target))
            for frames, target in zip(np.diff(ends, prepend=0), ticks, strict=True)
        )


def _four(values: npt.ArrayLike) -> Ticks:
    w, x, y, z = (int(value) for value in np.asarray(values))
    return w, x, y, z


def segment_messages(
    segments: Sequence[messages.Segment], *, epoch: int, max_frames: int | None = None
) -> tuple[messages.Segments, ...]:
    """Pack segments into as few messages as they take.

    Parameters
    ----------
    segments
        In their order.
    epoch
        The board's motion epoch.
    max_frames
        Servo frames that one message may take, single longer segments excepted: what
        is sent in small portions can be stopped by sending no more.

    Examples
    --------
    >>> one = messages.Segment(duration_frames=1, target_ticks=(1700, 1700, 1700, 1700))
    >>> [message.count for message in segment_messages([one] * 7, epoch=3)]
    [5, 2]
    """
    size = messages.SEGMENTS_PER_MESSAGE
    parts: list[list[messages.Segment]] = []
    frames = 0
    for segment in segments:
        frames += segment.duration_frames
        full = parts and (
            len(parts[-1]) == size or (max_frames is not None and frames > max_frames)
        )
        if full or not parts:
            parts.append([])
            frames = segment.duration_frames
        parts[-1].append(segment)
    result = []
    for part in parts:
        a, b, c, d, e = part + [_NO_SEGMENT] * (size - len(part))
        result.append(messages.Segments(epoch=epoch, count=len(part), segments=(a, b, c, d, e)))
    return tuple(result)


@lru_cache(maxsize=8)
def board_limits(config: Config, *, margin_mm: float = 1.0) -> messages.SetLimits:
    """Derive the limits that the board checks by itself.

    They are the extremes over the whole workspace, under every tendon model, and a
    margin. So every reachable target passes, and what would crush the spring or bend
    it far beyond its limit doesn't, though each servo alone would be in range.

    Parameters
    ----------
    config
        The robot; its tendons 0 and 2 are opposite, and 1 and 3.
    margin_mm
        Of each tendon's length, and of the sums and differences of pairs.

    Returns
    -------
    SetLimits
        In ticks.

    Raises
    ------
    ConfigError
        The tendons aren't in opposite pairs.

    Examples
    --------
    >>> from setae import config
    >>> board_limits(config.load()).slew_ticks
    116
    """
    servos = ServoModel(config)
    angles = np.array(config.geometry.tendon_angles_rad)
    pairs = ((0, 2), (1, 3))
    for a, b in pairs:
        if math.cos(angles[a] - angles[b]) > -math.cos(math.radians(10)):
            raise ConfigError(
                f"[geometry] tendon_angles_deg: tendons {a} and {b} are not opposite each other.",
                "The board's limits need opposite pairs (0, 2) and (1, 3), to 10 degrees.",
            )

    # Longer tendons than the workspace needs are slack and harmless: only the servo limits them.
    shortest, longest = servos.length_min_mm, servos.length_max_mm
    q = _workspace_lengths_mm(config)
    low = np.clip(q.min(axis=0) - margin_mm, shortest, longest)
    ends = np.stack([servos.pulses_us(low), servos.pulses_us(longest)]) * TICKS_PER_US
    # Rounding must not shift a limit that is a whole tick.
    pulse_min, pulse_max = np.ceil(ends.min(axis=0) - 1e-6), np.floor(ends.max(axis=0) + 1e-6)

    sums: list[tuple[int, int]] = []
    differences: list[tuple[int, int]] = []
    for a, b in pairs:
        sum_low = float((q[:, a] + q[:, b]).min()) - margin_mm
        sum_high = float(longest[a] + longest[b])
        difference_low = float((q[:, a] - q[:, b]).min()) - margin_mm
        difference_high = float((q[:, a] - q[:, b]).max()) + margin_mm
        # The edges of the allowed rectangle, as pulses: with servos that turn different
        # ways, the board's sum is the tendons' difference. With a pulley that grows, the
        # extremes may lie between the corners, but always on the edges.
        part = np.linspace(0.0, 1.0, 257)
        total, difference = (
            low + (high - low) * np.concatenate(sides)
            for low, high, sides in (
                (sum_low, sum_high, (part, part, 0 * part, 0 * part + 1)),
                (difference_low, difference_high, (0 * part, 0 * part + 1, part, part)),
            )
        )
        edges = np.zeros((len(total), SERVOS))
        edges[:, a], edges[:, b] = (total + difference) / 2, (total - difference) / 2
        ticks = servos._unchecked_us(edges) * TICKS_PER_US
        pulse_sum, pulse_difference = ticks[:, a] + ticks[:, b], ticks[:, a] - ticks[:, b]
        sums.append(_outwards(pulse_sum))
        differences.append(_outwards(pulse_difference))

    return messages.SetLimits(
        pulse_min_ticks=_four(pulse_min),
        pulse_max_ticks=_four(pulse_max),
        slew_ticks=servos.slew_ticks,
        pair_sum_min_ticks=(sums[0][0], sums[1][0]),
        pair_sum_max_ticks=(sums[0][1], sums[1][1]),
        pair_difference_min_ticks=(differences[0][0], differences[1][0]),
        pair_difference_max_ticks=(differences[0][1], differences[1][1]),
        coarse_threshold_raw=round(
            config.bristle.coarse_threshold_hpa * messages.PRESSURE_LSB_PER_HPA
        ),
        hold_timeout_s=config.motion.hold_timeout_s,
        stop_switch=config.motion.stop_switch,
    )


def _outwards(ticks: FloatArray) -> tuple[int, int]:
    return math.floor(ticks.min() + 1e-6), math.ceil(ticks.max() - 1e-6)


def _workspace_lengths_mm(config: Config) -> FloatArray:
    """Tendon lengths at reachable poses all over the workspace, all models, shape (p, 4)."""
    geometry = config.geometry
    angles = np.array(geometry.tendon_angles_rad)
    # The extremes lie where a tendon, or the boundary of equation 12, is in the bending plane.
    special = np.concatenate([angles + turn * math.pi / 2 for turn in range(4)])
    nudge = 4 * tendons.BOUNDARY_TOLERANCE
    alpha = np.concatenate(
        [np.linspace(0, 2 * math.pi, 48, endpoint=False), special, special - nudge, special + nudge]
    )
    length, theta, alpha = np.meshgrid(
        np.linspace(geometry.min_length_mm, geometry.free_length_mm, 26),
        np.linspace(0, geometry.max_bend_rad, 19),
        alpha,
        indexing="ij",
    )
    arc = Arc.from_angles(length_mm=length, theta_rad=theta, alpha_rad=alpha)
    return np.concatenate(
        [workspace.reachable_lengths_mm(arc, config, model) for model in TENDON_MODELS]
    )
