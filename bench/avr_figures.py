"""The figures of the built firmware on the simulated UNO, named and worded."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from functools import cache, partial

from bench import avr, avr_line, avr_reaction
from bench.figure import Figure
from tests.avr.stack import deepest_in_tests

from setae_protocol.messages import BAUD, SERVOS

_UPDATES = 3_000
_CONTACTS = 1_000
_AIMED_CONTACTS = 200
_STOPS = 300
_AIMED_STOPS = 100
_COMMANDS = 300
_QUERIES = 300
_REFILLS = 40

_UNO = f"built ELF in the cycle-accurate UNO, {BAUD} baud"
_LOAD = "line full in both directions, sensor at 75 Hz +-3 %"

_loaded = cache(partial(avr.loaded, _UPDATES))
_contacts = cache(partial(avr.parallel, avr_reaction.contacts, _CONTACTS, 2))
_stops = cache(partial(avr.parallel, avr_reaction.stops, _STOPS, 3))
_aimed_contacts = cache(partial(avr.parallel, avr_reaction.aimed_contacts, _AIMED_CONTACTS, 8))
_aimed_stops = cache(partial(avr.parallel, avr_reaction.aimed_stops, _AIMED_STOPS, 9))
_commands = cache(partial(avr.parallel, avr_reaction.commands, _COMMANDS, 4))
_idle_queries = cache(partial(avr_line.round_trips, _QUERIES, 5, loaded=False))
_loaded_queries = cache(partial(avr_line.round_trips, _QUERIES, 6, loaded=True))
_refills = cache(partial(avr_line.refills, _REFILLS, 7))
_full_line = cache(avr_line.full_line)
_decoding = cache(avr_line.decoding)


def loaded() -> Iterable[Figure]:
    """How exact the pulses are, and how near the chip is to its limits."""
    seen = _loaded()
    how = (
        f"{_UNO}, {seen.duration_s:.0f} s: {_LOAD}, new random widths over the whole range each"
        " frame"
    )
    yield Figure(
        "servo_error_cycles_max",
        seen.servo_error_cycles_max,
        "cycles",
        f"{how}; width at the pins against the told one, {seen.pulses // SERVOS} pulses of each"
        " servo, 62.5 ns a cycle",
    )
    yield Figure(
        "servo_split_updates",
        seen.split_updates,
        "frames",
        f"{how}; frames in which not all four had the told width",
    )
    yield Figure(
        "servo_span_ms",
        round(seen.servo_span_ms, 4),
        "ms",
        f"{_UNO}: a frame's start, by the board's clock, to the end of its last pulse, all four"
        " 2.5 ms wide",
    )
    yield Figure("rx_overruns", seen.rx_overruns, "B", f"{how}; bytes the USART lost")
    yield Figure(
        "interrupts_off_us_max",
        round(seen.interrupts_off_us_max, 2),
        "us",
        f"{how}; handlers and critical sections, entry and return included",
    )
    yield Figure(
        "cpu_idle_percent_loaded",
        round(seen.idle_percent, 1),
        "%",
        f"{how}; turns of the main loop, of those of a relaxed board with a silent line",
    )


def contacts() -> Iterable[Figure]:
    """How long a contact takes to freeze the pulses."""
    found = _contacts()
    times_ms = [contact.time_ms for contact in found]
    how = f"{_UNO}: {len(found)} pressure steps at random phases, {_LOAD}, four servos moving"
    yield Figure(
        "contact_to_freeze_ms_max",
        round(max(times_ms), 2),
        "ms",
        f"{how}; from the step to the start of the first frame that repeats the one before; mean"
        f" {statistics.mean(times_ms):.1f}",
    )
    yield Figure(
        "contact_late_frames",
        sum(contact.late_frames for contact in [*found, *_aimed_contacts()]),
        "frames",
        f"{how}, and {len(_aimed_contacts())} whose sample is ready 0.5 to 1 ms before a frame;"
        " frames that moved with a sample over the threshold ready 0.5 ms before them",
    )


def stops() -> Iterable[Figure]:
    """How long a stop takes to freeze the pulses."""
    times_ms = [stop.time_ms for stop in _stops()]
    aimed_ms = [stop.time_ms for stop in _aimed_stops()]
    yield Figure(
        "stop_to_freeze_ms_max",
        round(max(times_ms + aimed_ms), 2),
        "ms",
        f"{_UNO}: {len(times_ms)} stops at random phases, and {len(aimed_ms)} that come 0.5 to 0.9"
        f" ms before a frame while a sample is fetched, {_LOAD}, four servos moving; from the"
        " stop's last byte to the start of the first frame that repeats the one before; mean"
        f" {statistics.mean(times_ms):.1f}",
    )


def commands() -> Iterable[Figure]:
    """How long a new pose takes to the pins."""
    found = _commands()
    times_ms = [max(command.ends_ms) for command in found]

    def by_servo(times: Iterable[tuple[float, ...]]) -> str:
        return ", ".join(
            f"{statistics.mean(one):.1f}/{max(one):.1f}" for one in zip(*times, strict=True)
        )

    begins = by_servo(command.begins_ms for command in found)
    ends = by_servo(command.ends_ms for command in found)
    how = (
        f"{_UNO}: {len(found)} new poses within the robot's travel at random phases, {_LOAD}; from"
        " the command's last byte to the end of the last of the four new pulses"
    )
    yield Figure(
        "command_to_pulse_ms_mean",
        round(statistics.mean(times_ms), 2),
        "ms",
        f"{how}; mean/max until each servo's new pulse begins: {begins}, and ends: {ends}",
    )
    yield Figure("command_to_pulse_ms_max", round(max(times_ms), 2), "ms", how)


def line() -> Iterable[Figure]:
    """What the serial line carries, and how soon it answers."""
    times_ms = [refill.time_ms for refill in _refills()]
    yield Figure(
        "queue_refill_ms",
        round(max(times_ms), 2),
        "ms",
        f"{_UNO}: 50 segments of one frame to an idle board, until all are acknowledged; the"
        f" longest of {len(times_ms)} at random phases",
    )
    full = _full_line()
    yield Figure(
        "valid_frames_per_s",
        round(full.valid_per_s),
        "1/s",
        f"{_UNO}: pings of 13 bytes without a gap, four servos moving; {full.lost} lost,"
        f" {full.overruns} bytes overrun",
    )
    for name, found, condition in (
        ("query_round_trip_idle_ms", _idle_queries(), "line else idle"),
        ("query_round_trip_loaded_ms", _loaded_queries(), f"{_LOAD}, four servos moving"),
    ):
        trips_ms = [trip.time_ms for trip in found]
        yield Figure(
            name,
            round(statistics.median(trips_ms), 3),
            "ms",
            f"{_UNO}: a ping's first start bit to the last stop bit of its answer, {condition},"
            f" median of {len(trips_ms)}; at most {max(trips_ms):.2f}",
        )
    decoding = _decoding()
    how = (
        f"{_UNO}: frames of 64 bytes for another session without a gap; what the loop turns less"
        " than with a silent line"
    )
    yield Figure(
        "frame_decode_cycles_per_byte",
        round(decoding.with_interrupt - decoding.interrupt, 1),
        "cycles",
        f"{how}, the receive interrupt's {decoding.interrupt:.0f} cycles taken off",
    )
    yield Figure(
        "frame_decode_cycles_per_byte_with_interrupt",
        round(decoding.with_interrupt, 1),
        "cycles",
        how,
    )


def stack() -> Iterable[Figure]:
    """How deep the stack gets, over all that is measured here and all tests on the chip."""
    many = (
        _contacts(), _aimed_contacts(), _stops(), _aimed_stops(), _commands(),
        _idle_queries(), _loaded_queries(), _refills(),
    )  # fmt: skip
    found = [_loaded().stack_bytes, _full_line().stack_bytes, _decoding().stack_bytes]
    for boards in many:
        found += [one.stack_bytes for one in boards]
    in_tests, boards_in_tests = deepest_in_tests()
    yield Figure(
        "stack_deepest_bytes",
        max(*found, in_tests),
        "B",
        f"{_UNO}: RAM below the stack that was written to since power-on, over all of its figures, "
        f"and over {boards_in_tests} boards of tests/avr and tests/system",
    )


FIGURES: dict[str, Callable[[], Iterable[Figure]]] = {
    "uno_loaded": loaded,
    "uno_contacts": contacts,
    "uno_stops": stops,
    "uno_commands": commands,
    "uno_line": line,
    "uno_stack": stack,
}
