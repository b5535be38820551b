"""The protocol's one source: every message, number, size, code and its meaning.

`protocol/generate.py` reads this module and writes the C++ header, the Python
structs, the reference page and the shared test vectors. Nothing else may state
a message number, a size or a layout.

Frame on the wire::

    COBS( header, payload, CRC-32C little-endian ) 0x00

All integers are little-endian. One message type has exactly one length.
"""

from __future__ import annotations

from dataclasses import dataclass

from construct import (
    Array,
    Construct,
    Int8ul,
    Int16sl,
    Int16ul,
    Int32sl,
    Int32ul,
    Struct,
)

# --------------------------------------------------------------------- constants


@dataclass(frozen=True, slots=True)
class Constant:
    """A number that both sides must agree on."""

    name: str
    value: int
    doc: str


CONSTANTS = (
    Constant("PROTOCOL_VERSION", 1, "Raised whenever host and board of two versions can't work together."),
    Constant("BAUD", 500_000, "Line rate; exact at 16 MHz, where 115200 is 2.1 % off, and one that every operating system knows."),
    Constant("FRAME_WIRE_BYTES_MAX", 64, "Longest frame on the wire, COBS and delimiter included."),
    Constant("SERVO_FRAME_US", 20_000, "Servo frame period: the board's clock tick and the player's step."),
    Constant("PULSE_TICKS_PER_US", 2, "A pulse tick is 0.5 us: Timer1 at 16 MHz / 8."),
    Constant("SERVOS", 4, "Servos, one for each tendon."),
    Constant("PAIRS", 2, "Pairs of opposite tendons: servos (0, 2) and (1, 3)."),
    Constant("SEGMENTS_PER_MESSAGE", 5, "Segment slots in one `segments` message."),
    Constant("SEGMENT_QUEUE_SLOTS", 50, "Segments the board can hold: one second at one per servo frame."),
    Constant("WINDOW_FRAMES", 4, "Reliable frames in flight at most; bounds the bytes that delay a stop."),
    Constant("PRESSURE_LSB_PER_HPA", 4096, "LPS33HW, datasheet section 9.18: 4096 LSB/hPa."),
    Constant("TELEMETRY_SAMPLES", 3, "Pressure-sample slots in one telemetry frame (75 Hz + 3 % gives two at most, three after a late poll)."),
    Constant("TRIP_HISTORY_FRAMES", 4, "Servo frames whose pulses a trip record holds."),
    Constant("RECORD_REPEAT_FRAMES", 5, "Servo frames between repeats of an unacknowledged record."),
    Constant("REFUSAL_WAITS", 0x80, "In the state of a board frame's header: a refusal waits to be acknowledged."),
    Constant("TARE_SAMPLES", 8, "Pressure samples averaged into the baseline when a guard is armed."),
    Constant("SENSOR_SILENT_FRAMES", 5, "Servo frames without a fresh sample after which the sensor counts as silent."),
    Constant("SENSOR_STUCK_SAMPLES", 16, "Samples that agree in every bit after which the sensor counts as stuck (the LPS33HW's own noise is about 30 LSB)."),
    Constant("STATUS_FRAMES", 50, "Servo frames between two `status` messages."),
    Constant("PULSE_TICKS_ABSOLUTE_MIN", 1000, "Compiled-in lower bound of every pulse (500 us)."),
    Constant("PULSE_TICKS_ABSOLUTE_MAX", 5000, "Compiled-in upper bound of every pulse (2500 us)."),
    Constant("ATTACH_INTERVAL_FRAMES", 5, "Servo frames between attaching one servo and the next: one start-up current at a time."),
)

# -------------------------------------------------------------------------- codes


@dataclass(frozen=True, slots=True)
class Code:
    """One value of an enumeration."""

    name: str
    value: int
    doc: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Codes:
    """An enumeration of one byte, shared by board and host."""

    name: str
    doc: str
    values: tuple[Code, ...]


STATE = Codes(
    "State",
    "What the board is doing; in the header of every board frame.",
    (
        Code("relaxed", 0, "No pulses; the servos are limp."),
        Code("holding", 1, "Pulses on, commanded pose constant."),
        Code("moving", 2, "Pulses on: attaching, playing segments, or unwinding to relax."),
        Code("stopped", 3, "Frozen by a stop. Left only by an in-sequence `resume`."),
        Code("tripped", 4, "Frozen by a trip; the reflex may be running. Left only by `resume` or a stop."),
        Code("fault", 5, "Frozen by a fault. Left only by `resume`, once its cause is gone."),
    ),
)

GUARD = Codes(
    "Guard",
    "State of the contact detector.",
    (
        Code("off", 0, "Only the coarse threshold watches."),
        Code("taring", 1, "Averaging the baseline; queued segments wait."),
        Code("armed", 2, "Baseline frozen; the threshold of the guarded move watches."),
    ),
)

REFLEX = Codes(
    "Reflex",
    "What the board does by itself after a trip.",
    (
        Code("hold", 0, "Stay at the frozen pulses."),
        Code("retract", 1, "Move to the preset pulses, all servos arriving together."),
    ),
)

TRIP_CAUSE = Codes(
    "TripCause",
    "Why the pulses froze.",
    (
        Code("contact", 0, "The guarded move's threshold was crossed."),
        Code("coarse_contact", 1, "The coarse threshold of unguarded motion was crossed."),
        Code("deadline", 2, "The guarded move's deadline passed before it was disarmed."),
    ),
)

RECORD = Codes(
    "Record",
    "The latches: each holds one record until the host acknowledges it.",
    (
        Code("trip", 0, "The last trip."),
        Code("fault", 1, "The last fault."),
        Code("refusal", 2, "The last refused command."),
    ),
)

FAULT = Codes(
    "Fault",
    "What is broken. Each one freezes the pulses.",
    (
        Code("none", 0, "No fault.", "Nothing to do."),
        Code(
            "sensor_absent", 1,
            "The pressure sensor does not answer on the I2C bus.",
            "Check the sensor's 3.3 V supply, SDA on A4, SCL on A5, and the level shifter.",
        ),
        Code(
            "sensor_wrong", 2,
            "A chip answers at the sensor's address, but it is not an LPS33HW (WHO_AM_I is not 0xB1).",
            "Check which sensor is wired to the bus.",
        ),
        Code(
            "sensor_silent", 3,
            "No fresh pressure sample arrived in time while a guard was armed.",
            "Check the sensor's cable; a loose one fails when the robot bends.",
        ),
        Code(
            "sensor_bus", 4,
            "The I2C bus failed in the middle of a transfer.",
            "Check the pull-ups and keep the cable shorter than 30 cm, away from the servo leads.",
        ),
        Code(
            "sensor_range", 5,
            "The pressure is outside 260 to 1260 hPa, which the sensor can't measure.",
            "Check that the silicone does not press on the sensor's port.",
        ),
        Code(
            "sensor_stuck", 6,
            "Samples arrive, but their value has not changed in a single bit.",
            "Power the board off and on; if it comes back, replace the sensor.",
        ),
        Code(
            "sensor_noisy", 7,
            "The pressure jumps up and down by more than 5 hPa from sample to sample.",
            "Look for a loose silicone bond or wire, and keep the cable away from the servo leads.",
        ),
        Code(
            "watchdog", 8,
            "The firmware's loop stalled and the watchdog reset the board.",
            "Report it with the log; power the board off and on before the next run.",
        ),
        Code(
            "supply_low", 9,
            "The board's supply fell below 3.8 V.",
            "Give the servos a supply of their own, 5 A or more, with a common ground.",
        ),
        Code(
            "internal", 10,
            "The firmware found its own state inconsistent.",
            "Report it with the log; power the board off and on before the next run.",
        ),
    ),
)

REFUSAL = Codes(
    "Refusal",
    "Why a command was not carried out. A refused `segments` or `guard` also drops the queue and raises the epoch.",
    (
        Code("none", 0, "Not refused.", "Nothing to do."),
        Code("not_enabled", 1, "The servos have no pulses yet.", "Call enable() first, or give `setae enable`."),
        Code("stopped", 2, "The board is stopped.", "Once the robot may move again, call resume(), or give `setae enable`."),
        Code("tripped", 3, "The board is tripped.", "Read the contact, then call resume(), or give `setae enable`."),
        Code("fault", 4, "The board is in fault.", "Remove the fault's cause, then call resume(), or give `setae enable`."),
        Code("busy", 5, "The board is moving, and this command needs it at rest.", "Wait for the motion to end."),
        Code("out_of_limits", 6, "A pulse is outside its servo's limits.", "Choose a target inside the servo's travel."),
        Code("pair_limit", 7, "The pulses of two opposite tendons would crush or over-bend the spring.", "Choose a target inside the workspace."),
        Code("too_fast", 8, "A segment exceeds the slew limit.", "Give the move more time."),
        Code("wrong_epoch", 9, "A resume that answers an older stop, trip or fault.", "Look at the board's state and decide again."),
        Code("bad_field", 10, "A field holds a value that means nothing.", "Host and board disagree: flash the firmware of this version."),
        Code("record_pending", 11, "A record of this kind still waits to be acknowledged.", "Read and acknowledge the record first."),
        Code("already_enabled", 12, "The servos have pulses already.", "Nothing to do, or relax() first."),
        Code("sensor_unavailable", 13, "A guard needs a pressure sensor that answers.", "Run `setae doctor`."),
        Code("tare_noisy", 14, "The pressure was not steady while the baseline was taken.", "Let the robot rest before a guarded move; check the silicone bond."),
        Code("tare_far", 15, "The pressure at arming was far from its rest value: the bristle seems to be in contact already.", "Retract first; armed in contact means blind."),
        Code("reflex_running", 16, "The reflex has not ended yet.", "Wait for it, then call resume(), or give `setae enable`."),
        Code("stop_switch", 17, "The stop switch is open.", "Close it, then call resume(), or give `setae enable`."),
    ),
)

RESET_CAUSE = Codes(
    "ResetCause",
    "Why the board started.",
    (
        Code("unknown", 0, "The board could not tell."),
        Code("power_on", 1, "Power came up, or this firmware runs for the first time."),
        Code("external", 2, "The reset pin: the button, or a host opening the port (DTR)."),
        Code("brown_out", 3, "The supply fell below 2.7 V."),
        Code("watchdog", 4, "The firmware's loop stalled."),
    ),
)

SENSOR = Codes(
    "Sensor",
    "State of the pressure sensor.",
    (
        Code("ok", 0, "Samples arrive."),
        Code("absent", 1, "No answer on the bus."),
        Code("wrong", 2, "Another chip answers."),
        Code("silent", 3, "It answers, but no fresh sample comes."),
        Code("bus", 4, "The bus failed in a transfer."),
        Code("range", 5, "The sample is outside the sensor's range."),
        Code("stuck", 6, "Samples arrive, but their value never changes."),
        Code("noisy", 7, "The samples jump up and down."),
    ),
)

CODES = (STATE, GUARD, REFLEX, TRIP_CAUSE, RECORD, FAULT, REFUSAL, RESET_CAUSE, SENSOR)

# ------------------------------------------------------------------------ headers

HOST_HEADER = Struct(
    "type" / Int8ul * "Message type.",
    "session" / Int8ul * "The host's session; the board drops frames of any other (hello excepted).",
    "sequence" / Int8ul * "Sequence number of a reliable command, modulo 256; 0 in the other types.",
)

BOARD_HEADER = Struct(
    "type" / Int8ul * "Message type.",
    "session" / Int8ul * "The session the board is in; 0 after a reset.",
    "sequence" / Int8ul * "Counts board frames, modulo 256, so that the host can count lost ones.",
    "expected" / Int8ul * "Next reliable sequence number the board will accept: acknowledges all before it.",
    "credit" / Int8ul * "Free segment slots, once all commands before `expected` were carried out.",
    "epoch" / Int8ul * "Motion epoch, modulo 256. A stop, trip, fault, refusal of motion and new session raise it.",
    "state" / Int8ul * "State of the board (State), and REFUSAL_WAITS while the host has not acknowledged a refusal.",
)

# ----------------------------------------------------------------------- messages


@dataclass(frozen=True, slots=True)
class Message:
    """One message type.

    Attributes
    ----------
    codes
        Field name to enumeration, for the fields that hold a code.
    reliable
        Sequenced, acknowledged and carried out exactly once (host to board only).
    frozen
        Layout and meaning never change, in no version of the protocol.
    """

    name: str
    number: int
    payload: Construct
    doc: str
    reliable: bool = False
    frozen: bool = False
    codes: tuple[tuple[str, str], ...] = ()


SEGMENT = Struct(
    "duration_frames" / Int16ul * "Servo frames that the segment takes; 0 in unused slots.",
    "target_ticks" / Array(4, Int16ul) * "Pulses at the segment's end.",
)

SAMPLE = Struct(
    "pressure_raw" / Int32sl * "PRESS_OUT, 4096 LSB/hPa.",
    "age_us" / Int16ul * "Age of the sample at the telemetry's own time.",
)

LIMITS = Struct(
    "pulse_min_ticks" / Array(4, Int16ul) * "Lowest pulse of each servo.",
    "pulse_max_ticks" / Array(4, Int16ul) * "Highest pulse of each servo.",
    "slew_ticks" / Int16ul * "Fastest change of any pulse, ticks per servo frame.",
    "pair_sum_min_ticks" / Array(2, Int16sl) * "For pairs (0, 2), (1, 3): lowest p_a + p_b.",
    "pair_sum_max_ticks" / Array(2, Int16sl) * "Highest p_a + p_b.",
    "pair_difference_min_ticks" / Array(2, Int16sl) * "Lowest p_a - p_b.",
    "pair_difference_max_ticks" / Array(2, Int16sl) * "Highest p_a - p_b.",
    "coarse_threshold_raw" / Int32ul * "Contact threshold of unguarded motion; 0 switches it off.",
    "hold_timeout_s" / Int16ul * "Holding this long without a host relaxes; 0 never does.",
    "stop_switch" / Int8ul * "1: a normally closed switch from D4 to ground stops the robot when it opens; 0: D4 is not looked at.",
)

HOST_MESSAGES = (
    Message(
        "hello", 0x01,
        Struct(
            "protocol_version" / Int16ul * "The host's PROTOCOL_VERSION.",
            "schema_hash" / Int32ul * "The host's schema hash.",
            "new_session" / Int8ul * "0: only ask. Else open this session: sequence restarts at 0, the queue is dropped, the epoch is raised.",
            "token" / Int32ul * "Comes back in the answer.",
        ),
        "Handshake. Repeated with the running session it changes nothing, so it may be retransmitted.",
        frozen=True,
    ),
    Message(
        "stop", 0x02,
        Struct("stop_number" / Int8ul * "The host's count of stops; the same number again is the same stop."),
        "Freeze now. Acted on as soon as the frame is valid, ahead of everything queued.",
    ),
    Message(
        "ping", 0x03,
        Struct("token" / Int32ul * "Comes back in the answer."),
        "Ask for the board's time.",
    ),
    Message(
        "acknowledge", 0x04,
        Struct(
            "record" / Int8ul * "Which latch.",
            "record_id" / Int8ul * "The record's id; another id changes nothing.",
        ),
        "The host has a record; the board stops repeating it, and the next one may take its place.",
        codes=(("record", "Record"),),
    ),
    Message(
        "recall", 0x05,
        Struct("record" / Int8ul * "Which latch."),
        "Send the latched record once more, acknowledged or not.",
        codes=(("record", "Record"),),
    ),
    Message(
        "read_limits", 0x06,
        Struct("token" / Int8ul * "Reserved, 0."),
        "Ask for the limits in force.",
    ),
    Message(
        "enable", 0x10,
        Struct("pulse_ticks" / Array(4, Int16ul) * "The commanded pose; the servos attach there, one at a time."),
        "Switch the pulses on.",
        reliable=True,
    ),
    Message(
        "resume", 0x11,
        Struct("epoch" / Int8ul * "The epoch that the host saw: a newer stop, trip or fault wins."),
        "Leave stopped, tripped or fault for holding (relaxed where no servo is attached).",
        reliable=True,
    ),
    Message(
        "relax", 0x12,
        Struct("slew_ticks" / Int16ul * "Unwinding speed, ticks per servo frame.",
               "free_ticks" / Array(4, Int16ul) * "Pulses at which the tendons are free."),
        "Unwind slowly to the free length, then switch the pulses off.",
        reliable=True,
    ),
    Message(
        "limp", 0x13,
        Struct("reserved" / Int8ul * "0."),
        "Switch the pulses off at the end of this servo frame. Works in every state.",
        reliable=True,
    ),
    Message(
        "segments", 0x14,
        Struct(
            "epoch" / Int8ul * "Segments of another epoch are acknowledged and discarded.",
            "count" / Int8ul * "Slots in use, 1 to SEGMENTS_PER_MESSAGE.",
            "segments" / Array(5, SEGMENT) * "Straight lines in pulse space, each from where the one before ends.",
        ),
        "Queue motion.",
        reliable=True,
    ),
    Message(
        "guard", 0x15,
        Struct(
            "epoch" / Int8ul * "As in `segments`.",
            "threshold_raw" / Int32ul * "Absolute change against the baseline that is a contact, 4096 LSB/hPa.",
            "consecutive" / Int8ul * "Samples in a row that must cross it, 1 to 8.",
            "deadline_frames" / Int16ul * "Servo frames after arming at which the guarded move trips by itself.",
            "reflex" / Int8ul * "What follows a contact.",
            "retract_ticks" / Array(4, Int16ul) * "Where `retract` goes.",
            "retract_slew_ticks" / Int16ul * "Speed of the fastest servo while retracting, ticks per servo frame.",
        ),
        "Take the baseline, then watch for a contact. Only while holding. Segments sent after it wait until it is armed.",
        reliable=True,
        codes=(("reflex", "Reflex"),),
    ),
    Message(
        "disarm", 0x16,
        Struct("reserved" / Int8ul * "0."),
        "End the guarded move.",
        reliable=True,
    ),
    Message(
        "set_limits", 0x17,
        LIMITS,
        "Set the limits. Only while relaxed; inside the compiled-in bounds.",
        reliable=True,
    ),
    Message(
        "store_limits", 0x18,
        Struct("reserved" / Int8ul * "0."),
        "Write the limits in force to EEPROM, for the next start. Only while relaxed; `status` tells when it is done.",
        reliable=True,
    ),
)

BOARD_MESSAGES = (
    Message(
        "hello_reply", 0x81,
        Struct(
            "protocol_version" / Int16ul * "The board's PROTOCOL_VERSION.",
            "schema_hash" / Int32ul * "The board's schema hash.",
            "token" / Int32ul * "From the question.",
            "firmware_major" / Int8ul * "Firmware version.",
            "firmware_minor" / Int8ul * "Firmware version.",
            "firmware_patch" / Int8ul * "Firmware version.",
            "previous_session" / Int8ul * "The session before this one; 0 where there was none.",
            "reset_cause" / Int8ul * "Why the board started.",
            "limits_crc" / Int32ul * "CRC-32C of the limits in force, as a `limits` payload.",
            "pose_known" / Int8ul * "1 if `pulse_ticks` tells where the servos are; else the first pulse may jump.",
            "pulse_ticks" / Array(4, Int16ul) * "Last commanded pulses, retained through a reset.",
            "sensor" / Int8ul * "State of the pressure sensor.",
        ),
        "Answer to hello.",
        frozen=True,
        codes=(("reset_cause", "ResetCause"), ("sensor", "Sensor")),
    ),
    Message(
        "receipt", 0x82,
        Struct("gap" / Int8ul * "1: a reliable frame came out of order and was dropped; send again from `expected`."),
        "Acknowledges through its header; sent for every reliable frame and every stop.",
    ),
    Message(
        "pong", 0x83,
        Struct(
            "token" / Int32ul * "From the question.",
            "frame" / Int32ul * "Board time: servo frames since start.",
            "phase_us" / Int16ul * "Board time: microseconds into that frame.",
        ),
        "The board's time at the moment of answering.",
    ),
    Message(
        "telemetry", 0x84,
        Struct(
            "frame" / Int32ul * "Board time: servo frames since start.",
            "phase_us" / Int16ul * "Board time: microseconds into that frame.",
            "pulse_ticks" / Array(4, Int16ul) * "Pulses put out in this frame.",
            "attached" / Int8ul * "Bit i: servo i has pulses.",
            "queued" / Int8ul * "Segments in the queue, the playing one included.",
            "guard" / Int8ul * "State of the contact detector.",
            "reflex_running" / Int8ul * "1 while the reflex moves.",
            "sensor" / Int8ul * "State of the pressure sensor.",
            "baseline_raw" / Int32sl * "Baseline that samples are compared with.",
            "sample_count" / Int8ul * "Sample slots in use.",
            "samples" / Array(3, SAMPLE) * "Samples since the last telemetry, oldest first.",
            "rx_damaged" / Int8ul * "Frames dropped since start, modulo 256.",
            "stop_number" / Int8ul * "The last stop that was acted on.",
            "underruns" / Int8ul * "Times the queue ran dry in motion since start, modulo 256.",
        ),
        "Once per servo frame.",
        codes=(("guard", "Guard"), ("sensor", "Sensor")),
    ),
    Message(
        "trip", 0x85,
        Struct(
            "record_id" / Int8ul * "Raised with each trip; never 0.",
            "session" / Int8ul * "The session in which it was latched; 0 where there was none.",
            "cause" / Int8ul * "Why.",
            "sample_frame" / Int32ul * "Board time of the deciding sample.",
            "sample_phase_us" / Int16ul * "Board time of the deciding sample.",
            "pressure_raw" / Int32sl * "The deciding sample.",
            "baseline_raw" / Int32sl * "The baseline it was compared with.",
            "pulse_ticks" / Array(4, Array(4, Int16ul)) * "Pulses put out in the last four frames, oldest first; the last are the frozen ones.",
        ),
        "Latched record of a trip.",
        codes=(("cause", "TripCause"),),
    ),
    Message(
        "fault", 0x86,
        Struct(
            "record_id" / Int8ul * "Raised with each fault; never 0.",
            "session" / Int8ul * "The session in which it was latched; 0 where there was none.",
            "further" / Int8ul * "Faults since then that this record kept from being latched, at most 255.",
            "fault" / Int8ul * "What is broken.",
            "detail" / Int32ul * "A figure that depends on the fault.",
            "frame" / Int32ul * "Board time of the fault.",
            "phase_us" / Int16ul * "Board time of the fault.",
            "pulse_ticks" / Array(4, Int16ul) * "The frozen pulses.",
        ),
        "Latched record of a fault.",
        codes=(("fault", "Fault"),),
    ),
    Message(
        "refusal", 0x87,
        Struct(
            "record_id" / Int8ul * "Raised with each refusal; never 0.",
            "session" / Int8ul * "The session in which it was latched; 0 where there was none.",
            "command_type" / Int8ul * "Type of the refused command.",
            "command_sequence" / Int8ul * "Its sequence number.",
            "reason" / Int8ul * "Why.",
            "index" / Int8ul * "Which servo, pair or segment; 255 where none is to blame.",
            "value" / Int32sl * "The value that was refused.",
            "limit" / Int32sl * "The limit that it broke.",
        ),
        "Latched record of a refused command.",
        codes=(("reason", "Refusal"),),
    ),
    Message(
        "limits", 0x88,
        LIMITS,
        "Answer to read_limits: the limits in force.",
    ),
    Message(
        "status", 0x89,
        Struct(
            "supply_mv" / Int16ul * "The board's supply; 0 before it was measured.",
            "stored_crc" / Int32ul * "CRC-32C of the limits in EEPROM, as a `limits` payload; 0 where there are none.",
            "storing" / Int8ul * "1 while limits are being written.",
            "stop_switch_open" / Int8ul * "1 if D4 is not connected to ground.",
            "rx_framing_errors" / Int8ul * "Bytes without a stop bit since start, modulo 256.",
            "rx_overruns" / Int8ul * "Bytes that the UART lost because its handler came too late, modulo 256.",
            "rx_overflows" / Int8ul * "Bytes that the receive ring had no room for, modulo 256.",
            "late_pulses" / Int8ul * "Pulse edges that were armed too late, modulo 256.",
        ),
        "Once per STATUS_FRAMES, and when a write to EEPROM ends.",
    ),
)

MESSAGES = HOST_MESSAGES + BOARD_MESSAGES
