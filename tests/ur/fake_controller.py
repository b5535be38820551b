"""A stand-in for a UR controller, good enough for the unmodified ur-rtde.

    python -m tests.ur.fake_controller 127.0.0.7

Serves what ur-rtde asks for: the dashboard (29999), scripts (30001 to 30003) and RTDE
version 2 (30004), whose ports it can't be told. So each fake has a loopback address of
its own. Of the control script it runs only the conversation in the registers: a command's
number in input_int_register_0, its arguments in input_double_register_0 and on, "done" in
output_int_register_0.

It says `ready` when it listens, then obeys lines on its standard input: see `Fake.obey`.
Written from UR's RTDE guide and from what ur-rtde 1.6 sends.
"""

from __future__ import annotations

import asyncio
import json
import math
import struct
import sys
import time
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.ur.turns import Turn, after, back, turn_of, turned, vector_of

DASHBOARD, SCRIPTS, RTDE = 29999, (30001, 30002, 30003), 30004
STEP_S = 0.002

# RTDE's data types (UR's RTDE guide).
TYPES = {
    "BOOL": "?", "UINT8": "B", "UINT32": "I", "UINT64": "Q", "INT32": "i", "DOUBLE": "d",
    "VECTOR3D": "3d", "VECTOR6D": "6d", "VECTOR6INT32": "6i", "VECTOR6UINT32": "6I",
}  # fmt: skip
OUTPUTS = {
    **dict.fromkeys(
        ("timestamp", "actual_execution_time", "speed_scaling", "target_speed_fraction",
         "actual_momentum", "actual_main_voltage", "actual_robot_voltage",
         "actual_robot_current", "payload", "tcp_force_scalar", "standard_analog_input0",
         "standard_analog_input1", "standard_analog_output0", "standard_analog_output1"),
        "DOUBLE",
    ),
    **dict.fromkeys(
        ("target_q", "target_qd", "target_qdd", "target_current", "target_moment", "actual_q",
         "actual_qd", "actual_current", "joint_control_output", "actual_TCP_pose",
         "actual_TCP_speed", "actual_TCP_force", "target_TCP_pose", "target_TCP_speed",
         "joint_temperatures", "actual_joint_voltage", "ft_raw_wrench", "payload_inertia"),
        "VECTOR6D",
    ),
    **dict.fromkeys(
        ("actual_tool_accelerometer", "payload_cog", "elbow_position", "elbow_velocity"),
        "VECTOR3D",
    ),
    **dict.fromkeys(("robot_mode", "safety_mode", "safety_status"), "INT32"),
    **dict.fromkeys(("actual_digital_input_bits", "actual_digital_output_bits"), "UINT64"),
    **dict.fromkeys(
        ("runtime_state", "robot_status_bits", "safety_status_bits",
         "output_bit_registers0_to_31", "output_bit_registers32_to_63"),
        "UINT32",
    ),
    "joint_mode": "VECTOR6INT32",
    **{f"output_int_register_{i}": "INT32" for i in range(48)},
    **{f"output_double_register_{i}": "DOUBLE" for i in range(48)},
}  # fmt: skip
INPUTS = {
    "external_force_torque": "VECTOR6D", "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE", "standard_digital_output_mask": "UINT8",
    "standard_digital_output": "UINT8",
    **{f"input_int_register_{i}": "INT32" for i in range(48)},
    **{f"input_double_register_{i}": "DOUBLE" for i in range(48)},
}  # fmt: skip

# Commands of ur-rtde's control script that do something here.
MOVE_L, SET_PAYLOAD, SET_TCP, STOP_L, WATCHDOG, STOP_SCRIPT = 3, 17, 29, 33, 35, 255
READY, DONE = 1, 2

Vector = NDArray[np.float64]


@dataclass
class Fake:
    """The controller's state, and how it changes."""

    flange_m: Vector = field(default_factory=lambda: np.array([0.4, 0.1, 0.6]))
    flange_turn: Turn = (0.0, 1.0, 0.0, 0.0)  # it looks down
    tcp: list[float] = field(default_factory=lambda: [0.0] * 6)
    payload: list[float] = field(default_factory=lambda: [0.0] * 4)
    move: list[float] = field(default_factory=list)
    brake: float = 0.0
    speed: Vector = field(default_factory=lambda: np.zeros(3))
    target_m: Vector | None = None
    target_turn: Turn = (1.0, 0.0, 0.0, 0.0)
    speed_max: float = 0.0
    acceleration: float = 1.0
    braking: bool = False
    remote: bool = True
    mute: bool = False
    deaf: bool = False
    robot_mode: int = 7
    safety_mode: int = 1
    playing: bool = False
    done: bool = False
    watchdog_hz: float = 0.0
    heard_s: float = 0.0
    slider: float = 1.0
    inputs: dict[str, Any] = field(default_factory=dict)
    started_s: float = field(default_factory=time.monotonic)

    def obey(self, line: str) -> None:
        """A line on standard input: what goes wrong next."""
        word, _, rest = line.strip().partition(" ")
        if word == "local":
            self.remote = False
        elif word == "mute":
            self.mute = True
        elif word == "deaf":
            self.deaf = True
        elif word == "safety":
            self.safety_mode = int(rest)
            self.playing = self.playing and self.safety_mode in (1, 2)
            self.halt()
        elif word == "mode":
            self.robot_mode = int(rest)
        elif word == "slider":
            self.slider = float(rest)
        elif word == "flange":
            self.flange_turn = turn_of([float(value) for value in rest.split()])
        elif word == "stop_program":
            self.playing = False
            self.halt()
        elif word == "tell":
            sys.stdout.write(json.dumps(self.told()) + "\n")
            sys.stdout.flush()

    def told(self) -> dict[str, Any]:
        """Where the flange is, and what the last commands said; metres and rotation vectors."""
        return {
            "flange": [*self.flange_m.tolist(), *vector_of(self.flange_turn)],
            "tcp": self.tcp,
            "payload": self.payload,
            "move": self.move,
            "brake": self.brake,
            "watchdog_hz": self.watchdog_hz,
            "playing": self.playing,
        }

    def halt(self) -> None:
        self.target_m = None
        self.speed = np.zeros(3)

    @property
    def tcp_m(self) -> Vector:
        return self.flange_m + turned(self.flange_turn, self.tcp[:3])

    @property
    def tcp_turn(self) -> Turn:
        return after(self.flange_turn, turn_of(self.tcp[3:]))

    def _carry(self, way_m: Vector, share: float) -> None:
        """Take the TCP along, and turn it by a share of what it has to turn."""
        here_m, here = self.tcp_m, self.tcp_turn
        left = vector_of(after(back(here), self.target_turn))
        there = after(here, turn_of([share * value for value in left]))
        self.flange_turn = after(there, back(turn_of(self.tcp[3:])))
        self.flange_m = here_m + way_m - turned(self.flange_turn, self.tcp[:3])

    def step(self, step_s: float) -> None:
        """Let a little time pass."""
        if self.playing:
            self._converse()
            starved = (
                time.monotonic() - self.heard_s > 1 / self.watchdog_hz
                if self.watchdog_hz
                else False
            )
            if starved:
                self.playing = False
                self.halt()
        if self.target_m is None:
            return
        left = self.target_m - self.tcp_m
        left_m = float(np.linalg.norm(left))
        speed = float(np.linalg.norm(self.speed))
        if self.braking:
            speed = max(0.0, speed - self.acceleration * step_s)
        else:
            allowed = min(self.speed_max * self.slider, math.sqrt(2 * self.acceleration * left_m))
            speed = min(speed + self.acceleration * step_s, allowed)
        if (self.braking and speed == 0.0) or left_m <= max(speed * step_s, 1e-7):
            if not self.braking:
                self._carry(left, 1.0)
            self.halt()
        else:
            self.speed = left / left_m * speed
            self._carry(self.speed * step_s, speed * step_s / left_m)

    def _converse(self) -> None:
        """The control script's side of the registers."""
        command = self.inputs.get("input_int_register_0", 0)
        if self.deaf:
            return
        if command == 0:
            self.done = False
            return
        if self.done:
            return
        values = [float(self.inputs.get(f"input_double_register_{i}", 0.0)) for i in range(12)]
        self.done = True
        if command == MOVE_L:
            self.move = values[:8]
            self.target_m, self.target_turn = np.array(values[:3]), turn_of(values[3:6])
            self.speed_max, self.acceleration = values[6], values[7]
            self.braking = False
        elif command == STOP_L:
            self.brake = self.acceleration = values[0]
            self.braking = True
        elif command == SET_PAYLOAD:
            self.payload = values[:4]
        elif command == SET_TCP:
            self.tcp = values[:6]
        elif command == WATCHDOG:
            self.watchdog_hz, self.heard_s = values[0], time.monotonic()
        elif command == STOP_SCRIPT:
            self.playing = False
            self.halt()

    def output(self, name: str) -> Any:
        """A variable of RTDE's output."""
        pose = [*self.tcp_m.tolist(), *vector_of(self.tcp_turn)]
        values = {
            "timestamp": time.monotonic() - self.started_s,
            "actual_TCP_pose": pose,
            "target_TCP_pose": pose,
            "actual_TCP_speed": [*self.speed.tolist(), 0.0, 0.0, 0.0],
            "robot_mode": self.robot_mode,
            "safety_mode": self.safety_mode,
            "runtime_state": 2 if self.playing else 1,
            "robot_status_bits": 3,
            "safety_status_bits": 1,
            "speed_scaling": self.slider,
            "target_speed_fraction": 1.0,
            "output_int_register_0": (DONE if self.done else READY) if self.playing else 0,
        }
        size = TYPES[OUTPUTS[name]][:-1]
        return values.get(name, [0] * int(size) if size else 0)

    def script(self, text: str) -> None:
        """A script that was uploaded."""
        if "RTDE Control" in text:
            self.inputs["input_int_register_0"] = 0
            self.done, self.playing, self.watchdog_hz = False, True, 0.0


async def rtde(fake: Fake, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """UR's real-time data exchange, as far as ur-rtde uses it."""
    outputs: list[str] = []
    recipes: list[list[str]] = []
    streaming: asyncio.Task[None] | None = None

    def send(command: int, payload: bytes) -> None:
        writer.write(struct.pack(">HB", 3 + len(payload), command) + payload)

    async def stream(rate_hz: float) -> None:
        due_s = time.monotonic()
        while True:
            packed = b"".join(_pack(TYPES[OUTPUTS[name]], fake.output(name)) for name in outputs)
            send(85, b"\1" + packed)
            due_s += 1 / rate_hz
            await asyncio.sleep(max(0.0, due_s - time.monotonic()))

    rate_hz = 125.0
    try:
        while True:
            size, command = struct.unpack(">HB", await reader.readexactly(3))
            payload = await reader.readexactly(size - 3)
            if fake.mute:
                continue
            if command == ord("V"):
                send(command, b"\1")
            elif command == ord("v"):
                send(command, struct.pack(">4I", 5, 15, 0, 0))
            elif command == ord("O"):
                rate_hz = min(500.0, struct.unpack(">d", payload[:8])[0])
                outputs = [name for name in payload[8:].decode().split(",") if name]
                types = [OUTPUTS.get(name, "NOT_FOUND") for name in outputs]
                send(command, b"\1" + ",".join(types).encode())
            elif command == ord("I"):
                recipes.append([name for name in payload.decode().split(",") if name])
                types = [INPUTS.get(name, "NOT_FOUND") for name in recipes[-1]]
                send(command, bytes([len(recipes)]) + ",".join(types).encode())
            elif command == ord("S"):
                send(command, b"\1")
                streaming = asyncio.create_task(stream(rate_hz))
            elif command == ord("P"):
                send(command, b"\1")
                if streaming is not None:
                    streaming.cancel()
            elif command == ord("U"):
                _take(fake, recipes[payload[0] - 1], payload[1:])
    except (asyncio.IncompleteReadError, ConnectionError):
        pass
    finally:
        if streaming is not None:
            streaming.cancel()
        writer.close()


def _pack(kind: str, value: Any) -> bytes:
    return struct.pack(">" + kind, *(value if isinstance(value, list) else [value]))


def _take(fake: Fake, names: list[str], payload: bytes) -> None:
    fake.heard_s = time.monotonic()
    at = 0
    for name in names:
        kind = ">" + TYPES[INPUTS[name]]
        if at + struct.calcsize(kind) > len(payload):
            return
        values = struct.unpack_from(kind, payload, at)
        fake.inputs[name] = values[0] if len(values) == 1 else list(values)
        at += struct.calcsize(kind)


async def scripts(fake: Fake, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Uploads of URScript; a script ends with a line of its own."""
    text = ""
    try:
        while data := await reader.read(65536):
            text += data.decode(errors="replace")
            if text.rstrip().endswith("end"):
                fake.script(text)
                text = ""
    except ConnectionError:
        pass
    finally:
        writer.close()


async def dashboard(fake: Fake, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """The dashboard server's lines."""
    writer.write(b"Connected: Universal Robots Dashboard Server\n")
    answers: dict[str, Callable[[], str]] = {
        "polyscopeversion": lambda: "URSoftware 5.15.0.1234567 (Aug 01 2023)",
        "get serial number": lambda: "20235500001",
        "get robot model": lambda: "UR16",
        "is in remote control": lambda: str(fake.remote).lower(),
        "robotmode": lambda: "Robotmode: RUNNING",
        "safetystatus": lambda: "Safetystatus: NORMAL",
        "running": lambda: f"Program running: {str(fake.playing).lower()}",
        "stop": lambda: "Stopped",
        "quit": lambda: "Disconnected",
    }
    try:
        while line := await reader.readline():
            word = line.decode().strip().lower()
            answer = answers.get(word, lambda: "could not understand")()
            writer.write(f"{answer}\n".encode())
            if word == "stop":
                fake.playing = False
                fake.halt()
    except ConnectionError:
        pass
    finally:
        writer.close()


async def main(address: str) -> None:
    fake = Fake()
    servers = [(RTDE, rtde), (DASHBOARD, dashboard), *((port, scripts) for port in SCRIPTS)]
    Handler = Callable[
        [Fake, asyncio.StreamReader, asyncio.StreamWriter], Coroutine[Any, Any, None]
    ]

    def serve(handler: Handler) -> Callable[..., Coroutine[Any, Any, None]]:
        return lambda reader, writer: handler(fake, reader, writer)

    for port, handler in servers:
        await asyncio.start_server(serve(handler), address, port)
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(lines), sys.stdin
    )

    async def listen() -> None:
        while line := await lines.readline():
            fake.obey(line.decode())

    sys.stdout.write("ready\n")
    sys.stdout.flush()
    listening = asyncio.create_task(listen())
    last_s = time.monotonic()
    while not listening.done():  # until whoever started it is gone
        await asyncio.sleep(STEP_S)
        now_s = time.monotonic()
        fake.step(now_s - last_s)
        last_s = now_s


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
