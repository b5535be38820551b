"""The plug-in behind `avr://firmware.elf`: the simulated UNO, with the plant on its pins.

SETAE_BOARDS=avr=tests.avr.robot:connect setae probe 15 0 60 --port avr://
"""

from __future__ import annotations

from pathlib import Path

from tests.avr.simavr import CYCLES_PER_US, FIRMWARE, FRAME_CYCLES, AvrTransport, Uno

from setae.sim import World
from setae_protocol.messages import SERVOS

# Before the sensor's own moment: an instruction may take the board a little beyond its end.
_BEFORE_CYCLES = 64
# A servo without a pulse for so long has none any more.
_SILENT_CYCLES = FRAME_CYCLES * 3 // 2
# Where the sensor takes no samples, the plant still moves.
_LONGEST_STEP_CYCLES = FRAME_CYCLES


def connect(target: str, world: World) -> WorldTransport:
    """Run an ELF file in a world; none: the firmware that was built here."""
    return WorldTransport(Uno(Path(target) if target else FIRMWARE), world)


class WorldTransport(AvrTransport):
    """The line to a simulated UNO whose servos and sensor are a world's.

    Board and world are in step: pulses go over as they end, pressures as the
    sensor takes its samples, and the world's time is the board's.
    """

    def __init__(self, uno: Uno, world: World) -> None:
        super().__init__(uno)
        self.uno = uno
        self._world = world
        self._rises: dict[int, int] = {}
        self._ended: dict[int, int] = {}
        self._sensed = 0
        world.remove_board()

    @property
    def name(self) -> str:
        """How a developer would name it."""
        return "avr://"

    def advance(self, until_us: int) -> None:
        """Go on by at most a servo frame, or to the end of a frame from the board."""
        end = min(until_us * CYCLES_PER_US, self._sensed + _LONGEST_STEP_CYCLES)
        sample = self.uno.next_sample
        if sample is not None:
            end = min(end, max(sample - _BEFORE_CYCLES, self.uno.cycle + 1))
        self.uno.run_to(end, stop_after_frame=True)
        self._tell_pulses()
        now = self.uno.cycle
        self._world.run(now // CYCLES_PER_US)
        at_sample = sample is not None and now >= sample - _BEFORE_CYCLES
        if at_sample or now >= self._sensed + _LONGEST_STEP_CYCLES:
            self._sensed = now
            self.uno.set_pressure(self._world.sense())
        if sample is not None and at_sample:
            self.uno.run_to(sample + 1, stop_after_frame=True)

    def _tell_pulses(self) -> None:
        for edge in self.uno.edges():
            if edge.level:
                self._rises[edge.servo] = edge.cycle
                continue
            width = edge.cycle - self._rises.pop(edge.servo)
            self._world.run(edge.cycle // CYCLES_PER_US)
            self._world.pulse(edge.servo, width / CYCLES_PER_US)
            self._ended[edge.servo] = edge.cycle
        for servo in range(SERVOS):
            ended = self._ended.get(servo)
            if ended is not None and self.uno.cycle - ended > _SILENT_CYCLES:
                del self._ended[servo]
                self._world.pulse(servo, 0)
