"""Contacts and stops that come just before a servo frame begins, under load."""

from __future__ import annotations

import random
from dataclasses import dataclass

from tests.avr.driver import Driver, Load, Ticks, first_still
from tests.avr.simavr import CYCLES_PER_US, FRAME_CYCLES

from setae_protocol.frame import encode_host
from setae_protocol.messages import Guard, State, Stop

# The sensor's own oscillator.
RATE_SPREAD = 0.03
_RATE_HZ = 75
_HZ = 1_000_000 * CYCLES_PER_US
# The pulses rise so long after their frame began.
_RISE_CYCLES = 60 * CYCLES_PER_US
_LOW: Ticks = (1700, 1800, 1900, 2000)
_HIGH: Ticks = (3500, 3600, 3700, 3800)
# So fast that every frame shows that it moves.
_TICKS_PER_FRAME = 9
_REST_HPA = 1013.25
_TOUCH_HPA = 1040.0
_THRESHOLD_HPA = 15.0
_MS = 1_000 * CYCLES_PER_US


@dataclass(frozen=True, slots=True, kw_only=True)
class Aimed:
    """One contact or stop.

    Attributes
    ----------
    lead_us
        From the sample's being ready, or the stop's last byte, to the next frame.
    frames_late
        How many frames moved that began after it.
    """

    lead_us: float
    frames_late: int

    @property
    def time_ms(self) -> float:
        """Until the start of the first frame whose pulses no longer move."""
        return (self.lead_us + self.frames_late * FRAME_CYCLES / CYCLES_PER_US) / 1_000


class Range:
    """A board whose four servos move, the line full in both directions.

    Parameters
    ----------
    driver
        Its session; the servos have no pulses yet.
    rng
        Draws where exactly to aim at, and the sensor's rate each time.
    """

    def __init__(self, driver: Driver, rng: random.Random) -> None:
        self._driver = driver
        self._rng = rng
        driver.enable(_LOW)
        self._phase = (driver.pulses()[-1].rise - _RISE_CYCLES) % FRAME_CYCLES
        self._load = Load(driver)

    def contact(self, lead_us: tuple[float, float]) -> Aimed:
        """Touch so that the sample is ready within these times before a frame."""
        driver, uno = self._driver, self._driver.uno
        driver.guard(_THRESHOLD_HPA)
        self._move()
        driver.session.run_until(
            lambda: driver.reports[-1].telemetry.guard is Guard.ARMED, 1_000_000, what="armed"
        )
        sample, _ = self._coming_sample(lead_us)
        uno.set_pressure(_TOUCH_HPA, from_cycle=sample - 3 * _MS)
        driver.wait_for(State.TRIPPED)
        uno.set_pressure(_REST_HPA)
        return self._see(sample)

    def stop(self, lead_us: tuple[float, float], sample_lead_us: tuple[float, float]) -> Aimed:
        """Stop within these times before a frame before which a sample becomes ready, too."""
        driver, uno = self._driver, self._driver.uno
        self._move()
        _, frame = self._coming_sample(sample_lead_us)
        size = len(encode_host(Stop(stop_number=1), session=driver.session_id))
        arrival = frame - round(self._rng.uniform(*lead_us) * CYCLES_PER_US)
        driver.session.run_for((arrival - uno.cycle - 20 * _MS) // CYCLES_PER_US)
        self._load.fill_until(arrival, leave_bytes=size)
        driver.session.send_stop()
        arrived = uno.line_free
        driver.wait_for(State.STOPPED)
        return self._see(arrived)

    def _move(self) -> None:
        """Go to the end that is further away, the sensor at another rate."""
        at = self._driver.reports[-1].telemetry.pulse_ticks[0]
        target = max(_LOW, _HIGH, key=lambda ticks: abs(ticks[0] - at))
        self._new_rate()
        self._driver.queue([target], frames_each=abs(target[0] - at) // _TICKS_PER_FRAME)
        self._driver.wait_for(State.MOVING)

    def _new_rate(self) -> None:
        self._rate = self._rng.uniform(1 - RATE_SPREAD, 1 + RATE_SPREAD)
        self._driver.uno.set_sensor_rate(self._rate)
        self._driver.session.run_for(100_000)  # the board follows

    def _coming_sample(self, lead_us: tuple[float, float]) -> tuple[int, int]:
        """A sample that becomes ready so long before a frame, and the frame; soon, but not now."""
        earliest = round(lead_us[0] * CYCLES_PER_US)
        while True:
            following = self._driver.uno.next_sample
            assert following is not None
            for count in range(4, 30):
                sample = following + round(count * _HZ / (_RATE_HZ * self._rate))
                frame = self._frame_after(sample + earliest)
                if (frame - sample) / CYCLES_PER_US <= lead_us[1]:
                    return sample, frame
            self._new_rate()

    def _frame_after(self, cycle: int) -> int:
        return cycle + (self._phase - cycle) % FRAME_CYCLES

    def _see(self, happened: int) -> Aimed:
        """When it froze; then go on."""
        driver = self._driver
        driver.session.run_for(45_000)
        still = first_still(driver.frames()).first_rise - _RISE_CYCLES
        due = self._frame_after(happened)
        driver.forget()
        driver.resume()
        return Aimed(
            lead_us=(due - happened) / CYCLES_PER_US, frames_late=(still - due) // FRAME_CYCLES
        )
