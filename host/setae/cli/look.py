"""Commands that look at a robot: which ports there are, what answers, and what is wrong with it."""

from __future__ import annotations

import platform
from collections.abc import Callable

import numpy as np
from rich.markup import escape
from rich.table import Table

import setae
from setae import rig
from setae.cli.common import Where, app, connected, console
from setae.errors import SetaeError
from setae.robot import Robot
from setae.wording import counted
from setae_protocol.messages import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    Fault,
    ResetCause,
    Sensor,
    State,
)


@app.command
def ports() -> None:
    """List the serial ports, and which of them look like the board."""
    found = rig.ports()
    if not found:
        console.print("No serial ports. Plug the board in; look at its cable.")
        return
    table = Table("port", "what", "board?")
    for port in found:
        table.add_row(port.device, escape(port.description), "yes" if port.likely else "")
    console.print(table)


@app.command
def info(*, where: Where | None = None) -> None:
    """Say which firmware answers, in which state, with which limits.

    Parameters
    ----------
    where
        Which robot.
    """
    with connected(where, leave="hold") as robot:
        reply = robot.hello
        rows = {
            "port": robot.session.transport.name,
            "firmware": robot.firmware_version,
            "protocol": f"{reply.protocol_version} (schema {reply.schema_hash:08x})",
            "state": robot.state.name.lower(),
            "last start": ResetCause(reply.reset_cause).doc,
            "pose": "known" if robot.pose_known else "unknown: the first enable may jump",
            "sensor": _sensor(robot).doc,
            "limits": f"as configured (crc {reply.limits_crc:08x} at connect)",
            "stored": _stored(robot),
            "supply": _supply(robot),
        }
    for name, value in rows.items():
        console.print(f"{name:<11} {value}", markup=False, soft_wrap=True)


@app.command
def doctor(*, where: Where | None = None) -> int:
    """Check what can be checked, and say what to do about the rest.

    Parameters
    ----------
    where
        Which robot.

    Returns
    -------
    int
        Exit code: 1 if anything is wrong.
    """
    where = where or Where()
    checks = _Checks()
    checks.run("setae", lambda: f"{setae.__version__} on Python {platform.python_version()}")
    checks.run("protocol", lambda: f"{PROTOCOL_VERSION} (schema {SCHEMA_HASH:08x})")
    checks.run("configuration", lambda: _describe(where))
    checks.run("simulator", rig.simulator_version)
    checks.run("board", lambda: _check_board(where, checks))
    return 1 if checks.failed else 0


class _Checks:
    """Runs checks one after the other and prints each outcome."""

    def __init__(self) -> None:
        self.failed = False

    def run(self, name: str, check: Callable[[], str]) -> None:
        try:
            self.good(name, check())
        except SetaeError as error:
            self.bad(name, str(error))

    def good(self, name: str, text: str) -> None:
        console.print(f"[green]ok [/] {name:<14} {escape(text)}", soft_wrap=True)

    def bad(self, name: str, text: str) -> None:
        self.failed = True
        console.print(f"[red]bad[/] {name:<14} {escape(text)}", soft_wrap=True)


def _describe(where: Where) -> str:
    config = where.load()
    name = "the paper's robot" if where.config is None else str(where.config)
    return f"{name}, tendon model {config.motion.model}"


def _check_board(where: Where, checks: _Checks) -> str:
    with connected(where, leave="hold") as robot:
        _check_reset(robot, checks)
        _check_state(robot, checks)
        _check_pressure(robot, checks)
        _check_status(robot, checks)
        port = robot.session.transport.name
        return f"firmware {robot.firmware_version} on {port}, limits as configured"


def _check_reset(robot: Robot, checks: _Checks) -> None:
    cause = ResetCause(robot.hello.reset_cause)
    if cause is ResetCause.BROWN_OUT:
        checks.bad("supply", f"{cause.doc} Give the servos a supply of their own, common ground.")
    elif cause is ResetCause.WATCHDOG:
        checks.bad("last start", f"{cause.doc} Please report it, with what the robot did.")
    else:
        checks.good("last start", cause.doc)


def _check_state(robot: Robot, checks: _Checks) -> None:
    text = robot.state.name.lower()
    if robot.state in (State.STOPPED, State.TRIPPED, State.FAULT):
        checks.bad("state", f"{text}. See why, make it safe, then give `setae enable`.")
    else:
        checks.good("state", text)


# Of the pressure at rest, peak to peak; the threshold of a contact is 15 hPa.
_PRESSURE_NOISE_MAX_HPA = 3.0
_PRESSURE_S = 1.0


def _check_pressure(robot: Robot, checks: _Checks) -> None:
    samples: list[float] = []
    end_us = robot.now_us + round(_PRESSURE_S * 1e6)

    def done() -> bool:
        if robot.pressure_hpa is not None:
            samples.append(robot.pressure_hpa)
        return robot.now_us >= end_us

    robot.wait(done, timeout_s=_PRESSURE_S + 1, what="pressure samples", watch=False)
    sensor = robot.telemetry.sensor
    if sensor is not Sensor.OK or not samples:
        # A sensor's state has the number of its fault.
        checks.bad("sensor", f"{sensor.doc} {Fault(sensor).remedy}")
        return
    spread_hpa = float(np.ptp(samples))
    text = f"{np.mean(samples):.1f} hPa, {spread_hpa:.2f} hPa peak to peak at rest"
    if spread_hpa > _PRESSURE_NOISE_MAX_HPA:
        checks.bad("sensor", f"{text}: too noisy. Keep the bristle still; check its silicone bond.")
    else:
        checks.good("sensor", text)


def _stored(robot: Robot) -> str:
    stored = robot.limits_stored
    if stored is None:
        return "no limits: the board starts with its built-in ones; `setae store` stores these"
    return "as configured" if stored else "other limits; `setae store` replaces them"


def _supply(robot: Robot) -> str:
    return f"{robot.status.supply_mv / 1000:.2f} V"


# The board's own fault is at 3.8 V; USB gives 4.75 or more.
_SUPPLY_MIN_MV = 4300


def _check_status(robot: Robot, checks: _Checks) -> None:
    status = robot.status
    supply = f"{status.supply_mv / 1000:.2f} V"
    if status.supply_mv < _SUPPLY_MIN_MV:
        checks.bad("supply", f"{supply}. {Fault.SUPPLY_LOW.remedy}")
    else:
        checks.good("supply", supply)
    counts = (
        f"{counted(status.rx_framing_errors, 'framing error')}, "
        f"{counted(status.rx_overruns, 'overrun')}, "
        f"{status.rx_overflows} without room, "
        f"{counted(status.late_pulses, 'late pulse edge')}"
    )
    if status.rx_framing_errors or status.rx_overruns or status.rx_overflows:
        checks.bad("board's line", f"{counts}. Use a short USB cable, away from the servo leads.")
    elif status.late_pulses:
        checks.bad("board's line", f"{counts}. Please report it, with what the robot did.")
    else:
        checks.good("board's line", counts)
    if robot.config.motion.stop_switch and status.stop_switch_open:
        checks.bad("stop switch", "Open. Close it, or set motion.stop_switch = 0.")
    checks.good("stored limits", _stored(robot))


# A board that has just started needs this long for its sensor.
_SENSOR_START_US = 500_000


def _sensor(robot: Robot) -> Sensor:
    end_us = robot.now_us + _SENSOR_START_US
    robot.wait(
        lambda: robot.telemetry.sensor is Sensor.OK or robot.now_us >= end_us,
        timeout_s=1.0,
        what="the sensor to start",
        watch=False,
    )
    return robot.telemetry.sensor
