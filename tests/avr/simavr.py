"""The simulated UNO from Python: the board that runs the real firmware, and the line to it."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from setae.errors import LinkLostError, SimulatorMissingError
from setae_protocol.messages import (
    BAUD,
    PRESSURE_LSB_PER_HPA,
    PULSE_TICKS_PER_US,
    SERVO_FRAME_US,
    SERVOS,
)

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "build" / "avr" / "libuno.so"
FIRMWARE = ROOT / ".pio" / "build" / "uno" / "firmware.elf"
BOOTLOADER = ROOT / "build" / "avr" / "optiboot.bin"
BOOT_START = 0x7E00

CYCLES_PER_US = 16
CYCLES_PER_TICK = CYCLES_PER_US // PULSE_TICKS_PER_US
FRAME_CYCLES = SERVO_FRAME_US * CYCLES_PER_US
_BIT_CYCLES = 1e6 * CYCLES_PER_US / BAUD
_ROOM = 4096
_INTERRUPTS_OFF = b"\xf8\x94"  # CLI
_TURN_ON_THE_SPOT = b"\xff\xcf"  # RJMP to itself
# A Python program still sees Ctrl-C.
_SLICE_US = 100_000


class _Edge(ctypes.Structure):
    _fields_ = (
        ("cycle", ctypes.c_uint64),
        ("servo", ctypes.c_uint32),
        ("level", ctypes.c_uint32),
    )


class _Sample(ctypes.Structure):
    _fields_ = (("ready", ctypes.c_uint64), ("raw", ctypes.c_int64))


class _Statistics(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_uint64)
        for name in (
            "receive_overruns",
            "receive_frame_errors",
            "receive_longest_wait",
            "interrupts_off_longest",
            "interrupts_off_at",
            "stack_bytes",
            "resets",
            "turns",
            "eeprom_writes",
            "timers_misused",
            "crashed",
        )
    )


@dataclass(frozen=True, slots=True)
class Edge:
    """A servo pin changed its level."""

    cycle: int
    servo: int
    level: int


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse at a servo's pin, in core cycles of 62.5 ns."""

    servo: int
    rise: int
    width: int


@dataclass(frozen=True, slots=True)
class Sample:
    """A pressure sample, and the cycle at which the sensor had it ready."""

    ready: int
    raw: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """What the chip went through.

    Attributes
    ----------
    receive_overruns, receive_frame_errors
        Bytes that the USART lost, and those it found broken, since power-on.
    receive_longest_wait_cycles
        From a byte's arrival to its being read, at worst.
    interrupts_off_cycles
        Longest time with interrupts off, while watched.
    interrupts_off_at
        Where in the flash that began.
    stack_bytes
        Deepest stack since power-on.
    resets
        Since power-on, the watchdog's included.
    turns
        How often the firmware fed the watchdog, which its loop does once a turn.
    eeprom_writes
        Bytes that were written to the EEPROM.
    """

    receive_overruns: int
    receive_frame_errors: int
    receive_longest_wait_cycles: int
    interrupts_off_cycles: int
    interrupts_off_at: int
    stack_bytes: int
    resets: int
    turns: int
    eeprom_writes: int


@dataclass(frozen=True, slots=True)
class HandlerTime:
    """Cycles in one interrupt's handler since power-on, from its entry to the end of RETI."""

    count: int
    total: int
    longest: int


def _load() -> ctypes.CDLL:
    if not LIBRARY.is_file():
        raise SimulatorMissingError(
            f"The simulated UNO was not built: {LIBRARY} is missing.", "Run `make avr`."
        )
    library = ctypes.CDLL(str(LIBRARY))
    handle, cycle, size = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_size_t
    signatures: dict[str, tuple[object, Sequence[object]]] = {
        "uno_create": (handle, [ctypes.c_char_p]),
        "uno_error": (ctypes.c_char_p, []),
        "uno_destroy": (None, [handle]),
        "uno_press_reset": (None, [handle]),
        "uno_cycle": (cycle, [handle]),
        "uno_cycle_power": (None, [handle, ctypes.c_uint8]),
        "uno_supply": (None, [handle, ctypes.c_double]),
        "uno_bandgap": (None, [handle, ctypes.c_double]),
        "uno_load": (None, [handle, ctypes.c_uint16, ctypes.c_char_p, size]),
        "uno_flash_get": (ctypes.c_uint8, [handle, ctypes.c_uint16]),
        "uno_start": (None, [handle, ctypes.c_uint16]),
        "uno_eeprom_get": (ctypes.c_uint8, [handle, ctypes.c_uint16]),
        "uno_eeprom_set": (None, [handle, ctypes.c_uint16, ctypes.c_uint8]),
        "uno_stop_switch_closed": (None, [handle, ctypes.c_int]),
        "uno_hold_program": (None, [handle, cycle, cycle]),
        "uno_program_counter": (ctypes.c_uint32, [handle]),
        "uno_interrupts_on": (ctypes.c_int, [handle]),
        "uno_usb_chip": (None, [handle, ctypes.c_int]),
        "uno_sensor_ready_wired": (None, [handle, ctypes.c_int]),
        "uno_run": (None, [handle, cycle, ctypes.c_int]),
        "uno_send": (None, [handle, ctypes.c_char_p, size, cycle, ctypes.c_double]),
        "uno_line_free": (cycle, [handle]),
        "uno_receive": (size, [handle, ctypes.c_char_p, size, ctypes.POINTER(cycle)]),
        "uno_edges": (size, [handle, ctypes.POINTER(_Edge), size]),
        "uno_samples": (size, [handle, ctypes.POINTER(_Sample), size]),
        "uno_sensor_pressure": (None, [handle, cycle, ctypes.c_int32]),
        "uno_sensor_next": (cycle, [handle]),
        "uno_sensor_rate": (None, [handle, ctypes.c_double]),
        "uno_sensor_present": (None, [handle, ctypes.c_int]),
        "uno_sensor_silent": (None, [handle, ctypes.c_int]),
        "uno_sensor_identity": (None, [handle, ctypes.c_uint8]),
        "uno_sensor_address": (None, [handle, ctypes.c_uint8]),
        "uno_stick_bus": (None, [handle, ctypes.c_int]),
        "uno_watch_interrupts": (None, [handle, ctypes.c_int]),
        "uno_handler": (None, [handle, ctypes.c_int, *[ctypes.POINTER(cycle)] * 3]),
        "uno_peek": (ctypes.c_uint8, [handle, ctypes.c_uint16]),
        "uno_timer1_was_at": (cycle, [handle, ctypes.c_uint32]),
        "uno_statistics_get": (None, [handle, ctypes.POINTER(_Statistics)]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class Uno:
    """An Arduino UNO with an LPS33HW, from power-on, in virtual time.

    Parameters
    ----------
    firmware
        The ELF file that it runs.
    pressure_hpa
        What the sensor measures at first.

    Attributes
    ----------
    firmware
        The ELF file.
    """

    def __init__(self, firmware: Path = FIRMWARE, *, pressure_hpa: float = 1013.25) -> None:
        self._handle: int | None = None
        self._library = _load()
        self.firmware = firmware
        if not firmware.is_file():
            raise SimulatorMissingError(
                f"There is no firmware {firmware}.",
                "Build it with `make firmware`, or name another ELF file.",
            )
        self._handle = self._library.uno_create(str(firmware).encode())
        if not self._handle:
            raise RuntimeError(self._library.uno_error().decode())
        self._data = ctypes.create_string_buffer(_ROOM)
        self.set_pressure(pressure_hpa)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """Whether it was freed."""
        return not self._handle

    def close(self) -> None:
        """Free it. Closing twice is fine."""
        if self._handle:
            self._library.uno_destroy(self._handle)
            self._handle = None

    # ----------------------------------------------------------------------------- time

    @property
    def cycle(self) -> int:
        """Core cycles since power-on; 16 a microsecond."""
        return int(self._library.uno_cycle(self._handle))

    def run_to(self, cycle: int, *, stop_after_frame: bool = False) -> None:
        """Run until a cycle, or until a whole frame has come from the board."""
        self._library.uno_run(self._handle, cycle, stop_after_frame)

    def run_for_us(self, duration_us: float) -> None:
        """Run for a time."""
        self.run_to(self.cycle + round(duration_us * CYCLES_PER_US))

    def press_reset(self) -> None:
        """Reset as the button does, or a host that opens the port. RAM keeps its content."""
        self._library.uno_press_reset(self._handle)

    def hold_program(self, from_cycle: int, cycles: int) -> None:
        """Let the program stand still from then on, as in a section with interrupts off.

        Timers, serial line and sensor go on. One hold at a time.
        """
        self._library.uno_hold_program(self._handle, from_cycle, cycles)

    def hang(self, *, interrupts: bool = True) -> tuple[int, bytes]:
        """Let the program turn on the spot. Returns what `load` mends it with."""
        while not self._library.uno_interrupts_on(self._handle):
            self.run_to(self.cycle + 1)
        address = self._library.uno_program_counter(self._handle)
        program = _TURN_ON_THE_SPOT if interrupts else _INTERRUPTS_OFF + _TURN_ON_THE_SPOT
        before = self.flash(address, len(program))
        self.load(address, program)
        return address, before

    # ---------------------------------------------------------------------------- power

    def cycle_power(self, *, torn: int = 0xA5) -> None:
        """Take the power away and give it back, within no time.

        RAM and the sensor's settings are lost. An EEPROM byte that is being
        written may be anything afterwards: `torn`.
        """
        self._library.uno_cycle_power(self._handle, torn)

    def set_supply(self, volts: float) -> None:
        """Set the chip's supply. Below 2.7 V it is held in reset until it is fed again."""
        self._library.uno_supply(self._handle, volts)

    def set_bandgap(self, volts: float) -> None:
        """Set the chip's reference, 1.0 to 1.2 V from one to another."""
        self._library.uno_bandgap(self._handle, volts)

    # --------------------------------------------------------------------------- memory

    def load(self, address: int, data: bytes) -> None:
        """Put bytes into the flash, as a programmer does."""
        self._library.uno_load(self._handle, address, data, len(data))

    def flash(self, address: int, size: int) -> bytes:
        """Return what the flash holds."""
        return bytes(self._library.uno_flash_get(self._handle, address + i) for i in range(size))

    def install_bootloader(self) -> None:
        """Put the UNO's bootloader where the fuses have it, and start there."""
        self.load(BOOT_START, BOOTLOADER.read_bytes())
        self.set_start(BOOT_START)

    def set_start(self, address: int) -> None:
        """Start there at power-on and after each reset: the fuses of a chip with a bootloader."""
        self._library.uno_start(self._handle, address)

    def eeprom(self, address: int, size: int) -> bytes:
        """Return what the EEPROM holds."""
        return bytes(self._library.uno_eeprom_get(self._handle, address + i) for i in range(size))

    def set_eeprom(self, address: int, data: bytes) -> None:
        """Put bytes into the EEPROM."""
        for i, value in enumerate(data):
            self._library.uno_eeprom_set(self._handle, address + i, value)

    # ----------------------------------------------------------------------------- line

    def set_usb_chip(self, present: bool = True) -> None:
        """Put the USB chip between: 1 ms to the board, up to 4 ms from it."""
        self._library.uno_usb_chip(self._handle, present)

    def send(self, data: bytes, *, bit_cycles: float = _BIT_CYCLES) -> None:
        """Put bytes on the line to the board, behind those that are on it already."""
        self._library.uno_send(self._handle, data, len(data), self.cycle, bit_cycles)

    @property
    def line_free(self) -> int:
        """The cycle at which all bytes sent to the board have passed."""
        return int(self._library.uno_line_free(self._handle))

    def receive(self) -> tuple[bytes, int]:
        """Take what came from the board; and the cycle at which the last byte had passed."""
        end = ctypes.c_uint64()
        size = self._library.uno_receive(self._handle, self._data, _ROOM, ctypes.byref(end))
        return self._data.raw[:size], end.value

    # ----------------------------------------------------------------------------- pins

    def edges(self) -> list[Edge]:
        """Take the edges of the servo pins since the last call."""
        edges: list[Edge] = []
        room = (_Edge * _ROOM)()
        while count := self._library.uno_edges(self._handle, room, _ROOM):
            edges += [Edge(edge.cycle, edge.servo, edge.level) for edge in room[:count]]
        return edges

    # --------------------------------------------------------------------------- sensor

    def set_pressure(self, pressure_hpa: float, *, from_cycle: int = 0) -> None:
        """Set what the sensor measures from a cycle on; calls must be in order of time."""
        raw = round(pressure_hpa * PRESSURE_LSB_PER_HPA)
        self._library.uno_sensor_pressure(self._handle, from_cycle, raw)

    @property
    def next_sample(self) -> int | None:
        """The cycle at which the sensor takes its next sample; None where it takes none."""
        return int(self._library.uno_sensor_next(self._handle)) or None

    def set_sensor_rate(self, relative: float) -> None:
        """Make the sensor's oscillator fast or slow."""
        self._library.uno_sensor_rate(self._handle, relative)

    def set_sensor_present(self, present: bool) -> None:
        """Connect the sensor, or pull its plug."""
        self._library.uno_sensor_present(self._handle, present)

    def set_sensor_silent(self, silent: bool) -> None:
        """Let it answer, but measure nothing."""
        self._library.uno_sensor_silent(self._handle, silent)

    def set_sensor_identity(self, identity: int) -> None:
        """Set what WHO_AM_I says."""
        self._library.uno_sensor_identity(self._handle, identity)

    def set_sensor_address(self, address: int) -> None:
        """Set its address: 0x5D, or 0x5C where SA0 is low."""
        self._library.uno_sensor_address(self._handle, address)

    def wire_data_ready(self, wired: bool = True) -> None:
        """Connect the sensor's data-ready pin to D2."""
        self._library.uno_sensor_ready_wired(self._handle, wired)

    def close_stop_switch(self, closed: bool = True) -> None:
        """Close the switch between D4 and ground, or open it, as it is where there is none."""
        self._library.uno_stop_switch_closed(self._handle, closed)

    def stick_bus(self, clocks: int) -> None:
        """Let a slave hold SDA until it has seen that many clocks."""
        self._library.uno_stick_bus(self._handle, clocks)

    def samples(self) -> list[Sample]:
        """Take the samples that became ready since the last call."""
        samples: list[Sample] = []
        room = (_Sample * _ROOM)()
        while count := self._library.uno_samples(self._handle, room, _ROOM):
            samples += [Sample(sample.ready, sample.raw) for sample in room[:count]]
        return samples

    # ------------------------------------------------------------------------ statistics

    def watch_interrupts(self, on: bool = True) -> None:
        """Measure how long interrupts are off, from now on. The simulation is slower meanwhile."""
        self._library.uno_watch_interrupts(self._handle, on)

    def statistics(self) -> Statistics:
        """Return what the chip went through.

        Raises
        ------
        RuntimeError
            The firmware drives a servo from a timer mode that is not modelled, or did
            what ends simavr's run.
        """
        raw = _Statistics()
        self._library.uno_statistics_get(self._handle, ctypes.byref(raw))
        if raw.timers_misused:
            raise RuntimeError("A servo pin is driven by a timer mode that is not modelled.")
        if raw.crashed:
            raise RuntimeError("The program left the ground: simavr's message above says where.")
        return Statistics(
            receive_overruns=raw.receive_overruns,
            receive_frame_errors=raw.receive_frame_errors,
            receive_longest_wait_cycles=raw.receive_longest_wait,
            interrupts_off_cycles=raw.interrupts_off_longest,
            interrupts_off_at=raw.interrupts_off_at,
            stack_bytes=raw.stack_bytes,
            resets=raw.resets,
            turns=raw.turns,
            eeprom_writes=raw.eeprom_writes,
        )

    def handler(self, vector: int) -> HandlerTime:
        """Return how long an interrupt's handler ran; vectors count from 1, as avr-libc's do."""
        count, total, longest = ctypes.c_uint64(), ctypes.c_uint64(), ctypes.c_uint64()
        self._library.uno_handler(
            self._handle, vector, ctypes.byref(count), ctypes.byref(total), ctypes.byref(longest)
        )
        return HandlerTime(count.value, total.value, longest.value)

    def peek(self, address: int, size: int = 1) -> int:
        """Return what stands in RAM, low byte first."""
        return int.from_bytes(
            bytes(self._library.uno_peek(self._handle, address + i) for i in range(size)), "little"
        )

    def timer1_was_at(self, count: int) -> int:
        """Return the last cycle at which timer 1 became `count`."""
        return int(self._library.uno_timer1_was_at(self._handle, count))


class AvrTransport:
    """A `setae.link.transport.Transport` to a simulated UNO.

    Bytes come in whole frames, at the time at which their last stop bit has
    passed. There is no USB chip between.

    Parameters
    ----------
    uno
        The board. Closing the transport leaves it running.
    """

    def __init__(self, uno: Uno) -> None:
        self._uno = uno
        self._closed = False

    @property
    def name(self) -> str:
        """How a developer would name it."""
        return "avr://"

    @property
    def simulated(self) -> bool:
        """True: time passes only inside `receive`."""
        return True

    def now_us(self) -> int:
        """Return the time since power-on."""
        return self._uno.cycle // CYCLES_PER_US

    def send(self, data: bytes) -> None:
        """Put bytes on the line. Raises LinkLostError after close()."""
        self._require_open()
        self._uno.send(data)

    def receive(self, deadline_us: int) -> tuple[bytes, int] | None:
        """Let the board run until a frame has come or the deadline is there.

        Raises
        ------
        LinkLostError
            The transport was closed.
        """
        self._require_open()
        while True:
            data, end = self._uno.receive()
            if data:
                return data, end // CYCLES_PER_US
            if self.now_us() >= deadline_us:
                return None
            self.advance(min(deadline_us, self.now_us() + _SLICE_US))

    def advance(self, until_us: int) -> None:
        """Let the board run until then, or until a frame has come."""
        self._uno.run_to(until_us * CYCLES_PER_US, stop_after_frame=True)

    def close(self) -> None:
        """Let go of the line. Closing twice is fine."""
        self._closed = True

    def _require_open(self) -> None:
        if self._closed:
            raise LinkLostError("The line to the simulated UNO was closed.", "Connect again.")


def pulses(edges: Sequence[Edge]) -> list[Pulse]:
    """Pair edges into pulses, in order of their start.

    A pulse that has not ended is left out; a pin that falls without having
    risen is an error.
    """
    rises: dict[int, int] = {}
    found: list[Pulse] = []
    for edge in edges:
        if edge.level:
            rises[edge.servo] = edge.cycle
        else:
            rise = rises.pop(edge.servo)
            found.append(Pulse(edge.servo, rise, edge.cycle - rise))
    return sorted(found, key=lambda pulse: pulse.rise)


def by_servo(found: Sequence[Pulse]) -> list[list[Pulse]]:
    """Sort pulses by their servo."""
    return [[pulse for pulse in found if pulse.servo == servo] for servo in range(SERVOS)]
