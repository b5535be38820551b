"""Logs: what is written comes back, a cut file gives what it holds, errors are clear."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer

from setae.errors import InputError, LogError
from setae.record import FLUSH_US, TOPICS, Recorder, read
from setae.record.topics import JSON_RECORD, PROFILE
from setae.report import solving

METADATA: dict[str, Any] = {
    "simulated": True,
    "seed": 7,
    "config": "[bristle]\nthreshold_hpa = 15\n",
    "scene": {"tube": {"axis_mm": [-104.0, 0.0], "inner_radius_mm": 174.0}, "cube": None},
}


def write_seconds(path: Path, seconds: float) -> Path:
    """A log with every topic, at the usual rates."""
    with Recorder(path, metadata=METADATA) as recorder:
        recorder.experiment(0, "trial_start", {"obstacle": None})
        for frame in range(round(seconds * 50)):
            time_us = frame * 20_000
            recorder.telemetry(
                time_us,
                frame=frame,
                state="moving",
                epoch=3,
                pulse_us=np.array([900.5, 1000, 1100, 1200]),
                guard="armed",
                reflex_running=False,
                queued=12,
                baseline_hpa=1013.25,
            )
            recorder.pressure(
                time_us + 5, pressure_hpa=1013.0 + frame / 4096, baseline_hpa=1013.25, armed=True
            )
            recorder.truth(
                time_us,
                backbone_mm=np.linspace(0, frame, 63).reshape(21, 3),
                filament_mm=np.zeros((2, 3)),
                arm_mm=(0, 0, -frame / 10),
                contact_depth_mm=0.0,
                contact_point_mm=(np.nan, np.nan, np.nan),
                tension_n=np.ones(4),
                pressure_hpa=1013.0,
            )
        recorder.stage(7, position_mm=(0, 0, -40), moving=True)
        recorder.command(8, "move_to", {"position_mm": [15, 0, 60]})
        recorder.trip(
            9,
            record_id=1,
            cause="contact",
            sample_time_us=8,
            pressure_hpa=1040.0,
            baseline_hpa=1013.0,
            pulse_us=np.full((4, 4), 1000.0),
            contact={"tip_mm": np.array([1.0, 2.0, 110.0])},
        )
        recorder.fault(
            10, record_id=1, fault="sensor_silent", detail=5, pulse_us=(900, 900, 900, 900)
        )
        recorder.refusal(
            11, record_id=1, command="segments", reason="too_fast", index=2, value=90, limit=80
        )
        recorder.status(
            12,
            supply_mv=4950,
            storing=False,
            stop_switch_open=True,
            rx_framing_errors=1,
            rx_overruns=2,
            rx_overflows=3,
            late_pulses=4,
        )
    return path


def test_what_is_written_comes_back(tmp_path: Path) -> None:
    log = read(write_seconds(tmp_path / "run.mcap", 2.0))
    assert log.damage is None
    assert log.metadata == METADATA
    assert log.simulated
    assert set(log.topics) == set(TOPICS)
    assert log.times_us("/telemetry").tolist() == [frame * 20_000 for frame in range(100)]
    np.testing.assert_array_equal(log.array("/telemetry", "pulse_us")[5], [900.5, 1000, 1100, 1200])
    assert log.array("/telemetry", "state")[0] == "moving"
    assert log.array("/pressure", "armed").dtype == bool
    assert log.array("/pressure", "pressure_hpa")[99] == pytest.approx(1013 + 99 / 4096, abs=1e-6)
    assert log.array("/truth", "backbone_mm").shape == (100, 21, 3)
    assert np.isnan(log.array("/truth", "contact_point_mm")).all()
    assert log.messages("/trip")[0]["contact"] == {"tip_mm": [1.0, 2.0, 110.0]}
    assert log.messages("/refusal")[0]["reason"] == "too_fast"
    assert log.messages("/status")[0]["rx_overruns"] == 2
    event = log.events("trial_start")[0]
    assert (event.time_us, event.name, event.data) == (0, "trial_start", {"obstacle": None})
    assert log.span_us == (0, 99 * 20_000 + 5)


def test_the_same_messages_give_the_same_bytes(tmp_path: Path) -> None:
    first = write_seconds(tmp_path / "first.mcap", 2.5)
    second = write_seconds(tmp_path / "second.mcap", 2.5)
    assert first.read_bytes() == second.read_bytes()


def test_no_name_of_this_computer_is_in_the_bytes(tmp_path: Path) -> None:
    data = write_seconds(tmp_path / "run.mcap", 0.1).read_bytes()
    assert str(tmp_path).encode() not in data
    assert b"mcap-python" not in data


def test_other_programs_can_read_it(tmp_path: Path) -> None:
    """The library's own reader, with the index, finds every message and its schema."""
    with write_seconds(tmp_path / "run.mcap", 2.0).open("rb") as file:
        found = list(make_reader(file).iter_messages(log_time_order=False))
    counts = dict.fromkeys(TOPICS, 0)
    for schema, channel, message in found:
        counts[channel.topic] += 1
        assert schema is not None
        assert schema.encoding == "jsonschema"
        fields = set(json.loads(message.data))
        assert fields == set(json.loads(schema.data)["properties"])
        assert message.log_time == json.loads(message.data)["time_us"] * 1000
    assert counts["/telemetry"] == counts["/pressure"] == counts["/truth"] == 100
    assert min(counts.values()) == 1


@pytest.mark.parametrize("share", [0.35, 0.6, 0.9, 0.999])
def test_a_cut_file_gives_what_it_holds(tmp_path: Path, share: float) -> None:
    data = write_seconds(tmp_path / "run.mcap", 8.0).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(len(data) * share)])
    log = read(cut)
    assert log.damage is not None
    assert log.metadata == METADATA
    times_us = log.times_us("/telemetry")
    assert times_us.tolist() == [frame * 20_000 for frame in range(len(times_us))]
    if share < 0.9:
        # At most the block that was cut, a second long, is lost of what was there.
        assert times_us[-1] >= share * 8e6 - 2 * FLUSH_US
    assert f"{log.damage.last_time_us / 1e6:.3f} s" in str(log.damage)


def test_a_killed_run_loses_at_most_a_second(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, metadata=METADATA)
    for tick in range(1000):
        recorder.command(tick * 10_000, "tick", {"tick": tick})
    # Nothing was closed: the file on the disk is what a killed run leaves.
    log = read(path)
    assert log.damage is not None
    assert "without closing" in log.damage.reason
    assert log.damage.bytes_lost == 0
    assert log.times_us("/command")[-1] >= 999 * 10_000 - FLUSH_US
    recorder.close()
    assert read(path).damage is None


def test_a_run_that_is_killed_at_once_leaves_a_log_that_says_what_it_was(tmp_path: Path) -> None:
    """It left an empty file, for which the report of the whole folder was refused."""
    recorder = Recorder(tmp_path / "run.mcap", metadata=METADATA)
    log = read(tmp_path / "run.mcap")
    recorder.close()
    assert log.metadata["seed"] == METADATA["seed"]
    assert log.damage is not None


def test_a_broken_block_costs_only_itself(tmp_path: Path) -> None:
    path = write_seconds(tmp_path / "run.mcap", 8.0)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(bytes(data))
    log = read(path)
    assert log.damage is not None
    times_us = log.times_us("/telemetry")
    assert len(times_us) >= 400 - 55
    assert times_us[-1] == 399 * 20_000


def test_a_size_beyond_any_memory_costs_only_its_block(tmp_path: Path) -> None:
    """A block that said to unpack to 2^63 bytes and more ended in an OverflowError."""
    path = write_seconds(tmp_path / "run.mcap", 8.0)
    data = bytearray(path.read_bytes())
    offset = 8  # behind the magic; a record is a code, its size in 8 bytes, and its body
    while data[offset] != Opcode.CHUNK:
        offset += 9 + int.from_bytes(data[offset + 1 : offset + 9], "little")
    data[offset + 25 : offset + 33] = b"\xff" * 8  # behind the times of its start and end
    path.write_bytes(bytes(data))
    log = read(path)
    assert log.damage is not None
    assert log.damage.chunks_lost == 1
    assert log.times_us("/telemetry")[-1] == 399 * 20_000


def test_no_damage_makes_reading_fail_unclearly(tmp_path: Path) -> None:
    """Broken bytes anywhere: either a log with its damage said, or a LogError."""
    data = write_seconds(tmp_path / "run.mcap", 0.2).read_bytes()
    random = np.random.default_rng(1)
    path = tmp_path / "broken.mcap"
    for _ in range(300):
        broken = bytearray(data)
        start = int(random.integers(len(data)))
        noise = random.integers(0, 256, size=int(random.integers(1, 40)), dtype=np.uint8)
        broken[start : start + len(noise)] = noise.tobytes()
        path.write_bytes(bytes(broken[: len(data)]))
        try:
            read(path)
        except LogError:
            continue


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n", b"\x89MCAP1\r\n" + bytes(99)])
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "thing.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"thing\.mcap"):
        read(path)


def test_what_is_no_log_is_not_read_whole() -> None:
    """Reading /dev/zero took all memory, until the system killed the program."""
    with pytest.raises(LogError, match="no log"):
        read("/dev/zero")


def test_errors_name_the_file_and_what_to_do(tmp_path: Path) -> None:
    path = write_seconds(tmp_path / "run.mcap", 0.1)
    with pytest.raises(LogError, match="exists already"):
        Recorder(path)
    with pytest.raises(LogError, match="No such file"):
        Recorder(tmp_path / "nowhere" / "run.mcap")
    with pytest.raises(LogError, match=r"absent\.mcap can't be read"):
        read(tmp_path / "absent.mcap")


def test_a_disk_that_fails_is_a_log_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was on the disk before stays readable."""
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, metadata=METADATA)
    for tick in range(250):
        recorder.command(tick * 10_000, "tick")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(recorder._writer, "flush", full)
    with pytest.raises(LogError, match="No space left"):
        recorder.command(3_500_000, "tick")
    assert len(read(path).messages("/command")) == 200
    recorder.close()
    # An empty file stayed, which was no log: the run before could not be resumed any more.
    monkeypatch.setattr(type(recorder._writer), "add_metadata", full)
    with pytest.raises(LogError, match="No space left"):
        Recorder(tmp_path / "run-2.mcap")
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


def test_a_path_that_may_not_be_made_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(LogError, match="Permission denied"):
        Recorder(tmp_path / "run.mcap")


def test_a_wrong_message_is_refused(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap") as recorder:
        with pytest.raises(InputError, match="topic"):
            recorder.write("/nonsense", 0, {})
        with pytest.raises(InputError, match="moving"):
            recorder.write("/stage", 0, {"position_mm": [0, 0, 0]})
        with pytest.raises(InputError, match="type object"):
            recorder.command(0, "x", {"value": object()})
    with pytest.raises(LogError, match="closed"):
        recorder.command(0, "x")


def test_an_unknown_field_is_refused(tmp_path: Path) -> None:
    log = read(write_seconds(tmp_path / "run.mcap", 0.1))
    with pytest.raises(InputError, match="pulse_us"):
        log.array("/telemetry", "pulse_ms")


@pytest.mark.parametrize(
    "body",
    [
        b"[]",
        b"7",
        b'{"time_us": null}',
        b'{"time_us": 1}',
        b'{"time_us": 9e99, "name": "", "args": {}}',
        b'{"time_us": 1, "name": [], "args": {}}',
    ],
)
def test_a_message_that_is_not_of_its_topic_is_damage(tmp_path: Path, body: bytes) -> None:
    # A whole file with a message of another shape raised TypeError, KeyError or OverflowError,
    # some while it was read, some only when it was used.
    path = tmp_path / "log.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start(profile=PROFILE, library="")
        writer.add_metadata(JSON_RECORD, {"deep": "[" * 100_000})  # RecursionError
        schema = writer.register_schema("any", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/command", "json", schema), 0, body, 0)
        writer.finish()
    log = read(path)
    assert log.damage is not None
    assert log.messages("/command") == []


def test_a_field_that_holds_objects_is_no_array(tmp_path: Path) -> None:
    # A TypeError of numpy's, without a word of what to do.
    path = tmp_path / "log.mcap"
    with Recorder(path) as recorder:
        recorder.command(0, "move", {"to": 1})
    with pytest.raises(InputError, match="messages"):
        read(path).array("/command", "args")


def test_a_log_from_before_the_residuals_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Logs get new fields; those that lack them are whole all the same."""
    path = tmp_path / "old.mcap"
    before = {name: field for name, field in TOPICS["/truth"].items() if "residual" not in name}
    del before["unsolved_samples"]
    old = {"backbone_mm": np.zeros((21, 3)), "filament_mm": np.zeros((2, 3)),
           "arm_mm": np.zeros(3), "contact_depth_mm": 0.0, "contact_point_mm": np.zeros(3),
           "tension_n": np.zeros(4), "pressure_hpa": 1013.0}  # fmt: skip
    with Recorder(path) as recorder, monkeypatch.context() as patch:
        patch.setitem(TOPICS, "/truth", before)
        recorder.write("/truth", 0, old)
    log = read(path)
    assert log.damage is None
    assert np.isnan(log.array("/truth", "largest_residual")).all()
    assert solving.told([log]) == ""


@pytest.mark.parametrize(
    ("unsolved", "said"),
    [
        (0, "solved in every sample; the largest residual is 9e-05"),
        (2, "2 samples of the spring’s"),
    ],
)
def test_a_report_says_how_well_the_spring_was_solved(
    tmp_path: Path, unsolved: int, said: str
) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path) as recorder:
        for done in (0, 1):
            recorder.truth(
                done, backbone_mm=np.zeros((21, 3)), filament_mm=np.zeros((2, 3)),
                arm_mm=np.zeros(3), contact_depth_mm=0.0, contact_point_mm=np.zeros(3),
                tension_n=np.zeros(4), pressure_hpa=1013.0, plant_residual=1e-6,
                largest_residual=9e-5, unsolved_samples=done * unsolved,
            )  # fmt: skip
    assert said in solving.told([read(path)])
