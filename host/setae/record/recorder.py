"""Writing a log, message by message, so that a run that is killed loses little."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Final, Self

import numpy as np
from mcap.writer import Writer
from numpy.typing import ArrayLike, NDArray

from setae.errors import InputError, LogError
from setae.record.encoding import DECIMALS, encode, plain
from setae.record.topics import JSON_RECORD, LIBRARY, PROFILE, TEXT_RECORD, TOPICS, schema

FLUSH_US: Final = 1_000_000  # a killed run loses at most this much

# Of the simulator's lengths and forces: plenty for a picture, and it halves the file.
_TRUTH_DECIMALS: Final = 4
_RESIDUAL_DECIMALS: Final = 9


class Recorder:
    """Writes one log. Use it as a context manager.

    A message is on the disk at most a second of log time after it was written,
    so a run that is killed loses no more.

    Parameters
    ----------
    path
        The file to make. It must not exist.
    metadata
        What the log is about; see the module's page. Values of any JSON type.

    Raises
    ------
    LogError
        The file exists, its folder doesn't, it may not be written, or the disk
        is full. Any later write may raise it too.
    """

    def __init__(self, path: str | Path, *, metadata: Mapping[str, Any] | None = None) -> None:
        self.path = Path(path)
        self._errors = _LogErrors(self.path)
        self._flush_due_us: int | None = None
        self._sequence = dict.fromkeys(TOPICS, 0)
        self._file: IO[bytes] | None = None
        try:
            self._file = self.path.open("xb")
        except FileExistsError:
            raise LogError(
                f"{self.path} exists already.", "Choose another name; a log is never overwritten."
            ) from None
        except OSError as error:
            raise LogError(
                f"{self.path} can't be made: {error.strerror}.", "Check the folder."
            ) from error
        self._writer = Writer(self._file)
        try:
            with self._errors:
                self._writer.start(profile=PROFILE, library=LIBRARY)
                self._write_metadata(metadata or {})
                self._channels = {topic: self._register(topic) for topic in TOPICS}
                # A run that is killed at once leaves a log that says what it was to be.
                self._file.flush()
        except BaseException:
            # Without its beginning it is no log, and would be in the way of the next.
            with contextlib.suppress(OSError):
                self.path.unlink()
            with contextlib.suppress(OSError):
                self._file.close()
            raise

    def _register(self, topic: str) -> int:
        number = self._writer.register_schema(
            "setae." + topic.removeprefix("/"), "jsonschema", schema(topic)
        )
        return self._writer.register_channel(topic, "json", number)

    def _write_metadata(self, metadata: Mapping[str, Any]) -> None:
        text = {key: value for key, value in metadata.items() if isinstance(value, str)}
        other = {key: value for key, value in metadata.items() if key not in text}
        self._writer.add_metadata(TEXT_RECORD, text)
        self._writer.add_metadata(
            JSON_RECORD, {key: json.dumps(plain(value)) for key, value in other.items()}
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except LogError:
            if kind is None:  # else the error that ended the run matters more
                raise

    def close(self) -> None:
        """Write what is left and the index. A second call does nothing."""
        if self._file is None:
            return
        file, self._file = self._file, None
        with self._errors:
            try:
                self._writer.finish()
            finally:
                file.close()

    def write(self, topic: str, time_us: int, data: Mapping[str, Any]) -> None:
        """Add a message to one of `TOPICS`, with exactly the topic's fields.

        Raises
        ------
        InputError
            No such topic, or a field is missing or unknown.
        LogError
            The recorder is closed, or the disk is full.
        """
        if topic not in TOPICS:
            raise InputError(f"No topic {topic!r}.", f"Topics: {', '.join(TOPICS)}.")
        if data.keys() != TOPICS[topic].keys():
            wrong = ", ".join(sorted(data.keys() ^ TOPICS[topic].keys()))
            raise InputError(f"Fields of {topic} missing or unknown: {wrong}.")
        self._add(topic, time_us, {key: plain(value) for key, value in data.items()})

    def _add(self, topic: str, time_us: int, data: Mapping[str, Any]) -> None:
        """Add a message whose fields are the topic's and which `encode` takes as they are."""
        if self._file is None:
            raise LogError(f"{self.path} is closed already.", "Make another recorder.")
        time_us = int(time_us)
        payload = encode({"time_us": time_us, **data})
        with self._errors:
            if self._flush_due_us is None:
                self._flush_due_us = time_us + FLUSH_US
            elif time_us >= self._flush_due_us:
                self._flush_due_us = time_us + FLUSH_US
                self._writer.flush()
            self._writer.add_message(
                self._channels[topic],
                log_time=time_us * 1000,
                data=payload,
                publish_time=time_us * 1000,
                sequence=self._sequence[topic],
            )
        self._sequence[topic] = (self._sequence[topic] + 1) % 2**32

    def telemetry(
        self,
        time_us: int,
        *,
        frame: int,
        state: str,
        epoch: int,
        pulse_us: ArrayLike,
        guard: str,
        reflex_running: bool,
        queued: int,
        baseline_hpa: float,
    ) -> None:
        """One telemetry frame; `pulse_us` (4,), 0 where a servo has no pulses."""
        self._add(
            "/telemetry",
            time_us,
            {
                "frame": frame,
                "state": state,
                "epoch": epoch,
                "pulse_us": _rounded(pulse_us, DECIMALS),
                "guard": guard,
                "reflex_running": bool(reflex_running),
                "queued": queued,
                "baseline_hpa": round(float(baseline_hpa), DECIMALS),
            },
        )

    def pressure(
        self, time_us: int, *, pressure_hpa: float, baseline_hpa: float, armed: bool
    ) -> None:
        """One sample of the sensor; `time_us` is the sample's own time."""
        self._add(
            "/pressure",
            time_us,
            {
                "pressure_hpa": round(float(pressure_hpa), DECIMALS),
                "baseline_hpa": round(float(baseline_hpa), DECIMALS),
                "armed": bool(armed),
            },
        )

    def trip(
        self,
        time_us: int,
        *,
        record_id: int,
        cause: str,
        sample_time_us: int,
        pressure_hpa: float,
        baseline_hpa: float,
        pulse_us: ArrayLike,
        contact: Any = None,
    ) -> None:
        """One trip record.

        Parameters
        ----------
        sample_time_us
            Time of the deciding sample.
        pulse_us
            (4, 4) pulses of the last four servo frames, oldest first.
        contact
            What the host makes of it, a mapping or dataclass; None where it is
            no contact.
        """
        self.write(
            "/trip",
            time_us,
            {
                "record_id": record_id,
                "cause": cause,
                "sample_time_us": int(sample_time_us),
                "pressure_hpa": pressure_hpa,
                "baseline_hpa": baseline_hpa,
                "pulse_us": np.asarray(pulse_us, dtype=float),
                "contact": contact,
            },
        )

    def fault(
        self, time_us: int, *, record_id: int, fault: str, detail: int, pulse_us: ArrayLike
    ) -> None:
        """One fault record; `pulse_us` (4,) are the frozen pulses."""
        self.write(
            "/fault",
            time_us,
            {
                "record_id": record_id,
                "fault": fault,
                "detail": detail,
                "pulse_us": np.asarray(pulse_us, dtype=float),
            },
        )

    def status(
        self,
        time_us: int,
        *,
        supply_mv: int,
        storing: bool,
        stop_switch_open: bool,
        rx_framing_errors: int,
        rx_overruns: int,
        rx_overflows: int,
        late_pulses: int,
    ) -> None:
        """What the board tells of itself; its counters count from its start, modulo 256."""
        self.write(
            "/status",
            time_us,
            {
                "supply_mv": supply_mv,
                "storing": storing,
                "stop_switch_open": stop_switch_open,
                "rx_framing_errors": rx_framing_errors,
                "rx_overruns": rx_overruns,
                "rx_overflows": rx_overflows,
                "late_pulses": late_pulses,
            },
        )

    def refusal(
        self,
        time_us: int,
        *,
        record_id: int,
        command: str,
        reason: str,
        index: int,
        value: int,
        limit: int,
    ) -> None:
        """One refusal record."""
        self.write(
            "/refusal",
            time_us,
            {
                "record_id": record_id,
                "command": command,
                "reason": reason,
                "index": index,
                "value": value,
                "limit": limit,
            },
        )

    def command(self, time_us: int, name: str, args: Any = None) -> None:
        """What the program asked the robot for, and with which arguments."""
        self.write("/command", time_us, {"name": name, "args": args})

    def stage(self, time_us: int, *, position_mm: ArrayLike, moving: bool) -> None:
        """Where the arm is: `position_mm` (3,), world."""
        position = _rounded(position_mm, DECIMALS)
        self._add("/stage", time_us, {"position_mm": position, "moving": bool(moving)})

    def experiment(self, time_us: int, event: str, data: Any = None) -> None:
        """One step of an experiment, with what belongs to it (mapping or dataclass)."""
        self.write("/experiment", time_us, {"event": event, "data": data})

    def truth(
        self,
        time_us: int,
        *,
        backbone_mm: ArrayLike,
        filament_mm: ArrayLike,
        arm_mm: ArrayLike,
        contact_depth_mm: float,
        contact_point_mm: ArrayLike,
        tension_n: ArrayLike,
        pressure_hpa: float,
        plant_residual: float = math.nan,
        largest_residual: float = math.nan,
        unsolved_samples: float = math.nan,
    ) -> None:
        """The simulator's own state; shapes (21, 3), (2, 3), (3,), -, (3,), (4,), -.

        The last three say how well the plant is solved: here, and in all samples until now.
        """
        self._add(
            "/truth",
            time_us,
            {
                "backbone_mm": _rounded(backbone_mm, _TRUTH_DECIMALS),
                "filament_mm": _rounded(filament_mm, _TRUTH_DECIMALS),
                "arm_mm": _rounded(arm_mm, _TRUTH_DECIMALS),
                "contact_depth_mm": round(float(contact_depth_mm), DECIMALS),
                "contact_point_mm": _rounded(contact_point_mm, _TRUTH_DECIMALS),
                "tension_n": _rounded(tension_n, _TRUTH_DECIMALS),
                "pressure_hpa": round(float(pressure_hpa), DECIMALS),
                "plant_residual": round(plant_residual, _RESIDUAL_DECIMALS),
                "largest_residual": round(largest_residual, _RESIDUAL_DECIMALS),
                "unsolved_samples": unsolved_samples,
            },
        )


def _rounded(values: ArrayLike, decimals: int) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float).round(decimals)


class _LogErrors:
    """Turns errors of the file system into LogError."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        return None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if isinstance(error, OSError):
            raise LogError(
                f"{self.path} can't be written: {error.strerror or error}.",
                "What was written before can still be read. Make room, then start again.",
            ) from error
