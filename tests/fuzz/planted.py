"""Bugs to plant: each breaks one promise, and the corpus alone must tell."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.fuzz import building
from tests.fuzz.building import BUILD, HERE, LIBRARIES


@dataclass(frozen=True, slots=True, kw_only=True)
class Bug:
    """One line of the firmware, made wrong.

    Attributes
    ----------
    file
        Below `firmware/lib`.
    promise
        What the observers must then say, in part.
    """

    name: str
    file: str
    right: str
    wrong: str
    promise: str
    target: str = "board"


_BOARD: Final = "board/src/board/board.cpp"
_COMMANDS: Final = "board/src/board/commands.cpp"
_SAFETY: Final = "board/src/board/safety.cpp"
_REPORTS: Final = "board/src/board/reports.cpp"
_LIMITS: Final = "motion/src/motion/limits.cpp"
_DETECTOR: Final = "contact/src/contact/detector.cpp"
_FRAME: Final = "protocol/src/protocol/frame.cpp"

BUGS: Final = (
    Bug(name="a_stop_waits_for_the_motion", file=_COMMANDS,
        right="  freeze();\n  raise(Event::kStop);", wrong="  raise(Event::kStop);",
        promise="a stop raises the epoch"),
    Bug(name="a_frozen_robot_goes_one_step_on", file=_BOARD,
        right="  next_ = current_;\n  const uint32_t running", wrong="  const uint32_t running",
        promise="nothing moves"),
    Bug(name="a_late_loop_forgets_a_frame", file=_BOARD,
        right="  latch_frame(running);\n  next_ = planned;", wrong="  next_ = planned;",
        promise=""),
    Bug(name="a_stop_keeps_the_epoch", file=_BOARD,
        right="  ++epoch_;", wrong="", promise="raises the epoch"),
    Bug(name="segments_of_another_epoch_are_queued", file=_COMMANDS,
        right="  protocol::Segments message;\n  decode(receiver_.payload(), message);\n"
              "  if (message.epoch != epoch_)",
        wrong="  protocol::Segments message;\n  decode(receiver_.payload(), message);\n"
              "  if (false)",
        promise=""),
    Bug(name="a_resume_answers_anything", file=_COMMANDS,
        right="  if (message.epoch != epoch_)\n    return verdict.refuse(Refusal::kWrongEpoch",
        wrong="  if (false)\n    return verdict.refuse(Refusal::kWrongEpoch",
        promise="a resume answers what the host has seen"),
    Bug(name="a_repeat_is_carried_out_again", file=_COMMANDS,
        right="    case Session::Order::kOld:\n      return;",
        wrong="    case Session::Order::kOld:\n      carry_out();\n      return;",
        promise="only a command in its turn"),
    Bug(name="another_session_is_obeyed", file=_COMMANDS,
        right="  if (from.session != session_.id())", wrong="  if (from.session == 99)",
        promise="a command is taken once, and in its turn"),
    Bug(name="any_pose_is_allowed", file=_LIMITS,
        right="bool Limits::check_pose(const uint16_t* ticks, Verdict& verdict) const {\n",
        wrong="bool Limits::check_pose(const uint16_t* ticks, Verdict& verdict) const {\n"
              "  if (ticks != nullptr)\n    return true;\n",
        promise=""),
    Bug(name="pairs_are_not_looked_at", file=_LIMITS,
        right="i < protocol::kPairs; ++i) {\n    const int32_t a",
        wrong="i < 0; ++i) {\n    const int32_t a",
        promise="no two opposite tendons"),
    Bug(name="a_trip_does_not_freeze", file=_SAFETY,
        right="  freeze();\n  const bool retract", wrong="  const bool retract", promise=""),
    Bug(name="one_contact_sample_too_many_is_asked_for", file=_DETECTOR,
        right="++crossed_ >= consecutive_ ?", wrong="++crossed_ > consecutive_ ?",
        promise="an armed guard sees every contact"),
    Bug(name="an_armed_guard_needs_no_sensor", file=_SAFETY,
        right="      fault(fault_of(sensor_), frame_ - sampled_frame_);", wrong="",
        promise="no guard is armed"),
    Bug(name="a_guard_has_no_deadline", file=_DETECTOR,
        right="  return deadline_frames_ == 0;", wrong="  return false;",
        promise="a guarded move ends at its deadline"),
    Bug(name="records_go_out_once", file=_BOARD,
        right="  trip_.on_frame();\n  fault_.on_frame();\n  refusal_.on_frame();\n", wrong="",
        promise="a record is repeated until it is acknowledged"),
    Bug(name="any_acknowledgement_is_taken", file=_COMMANDS,
        right="trip_.acknowledge(got.record_id)",
        wrong="trip_.acknowledge(trip_.record().record_id)",
        promise="a record is repeated until it is acknowledged"),
    Bug(name="credit_is_one_too_many", file=_REPORTS,
        right="credit = board.player_.room();", wrong="credit = board.player_.room() + 1;",
        promise="room"),
    Bug(name="a_waiting_refusal_is_not_said", file=_REPORTS,
        right="    state |= protocol::kRefusalWaits;", wrong="    state |= 0;",
        promise="a frame says whether a refusal waits"),
    Bug(name="two_servos_attach_at_once", file=_COMMANDS,
        right="  attacher_.step(attached_);", wrong="  attached_ = 3;",
        promise="servos attach one at a time"),
    Bug(name="a_full_queue_takes_more", file=_COMMANDS,
        right="  if (message.count > player_.room())\n    return verdict.wait();", wrong="",
        promise="room"),
    Bug(name="limits_change_at_any_time", file=_COMMANDS,
        right="!allows(Event::kSetLimits, verdict) || !limits_.set(message, verdict)",
        wrong="!limits_.set(message, verdict)",
        promise="limits change only while relaxed"),
    Bug(name="a_long_frame_is_written_behind_the_buffer", file=_FRAME, target="decoder",
        right="smallest(left, smallest(room, cobs.left()))", wrong="smallest(left, cobs.left())",
        promise=""),
    Bug(name="an_unfinished_run_counts_as_a_frame", file=_FRAME, target="decoder",
        right="cobs_.complete() && ", wrong="", promise="accepts no frame but a right one"),
    Bug(name="damage_is_not_counted", file=_FRAME, target="decoder",
        right="    ++damaged_;", wrong="    damaged_ += 0;", promise="counts each damaged frame"),
)  # fmt: skip


def plant(bug: Bug) -> str:
    """Return what a target says of its corpus, with this bug in the firmware; "" if nothing."""
    source = LIBRARIES / bug.file
    text = source.read_text()
    if text.count(bug.right) != 1:
        raise AssertionError(f"{bug.name}: {source} has changed; plant it anew")
    folder = BUILD / "planted" / bug.name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    wrong = folder / source.name
    wrong.write_text(text.replace(bug.right, bug.wrong))
    building.compile_object(building.QUICK, wrong, folder / "wrong.o")

    others = [path for path in building.firmware_sources() if path != source]
    own = [*building.sources_of(bug.target), HERE / "replay.cpp"]
    objects = building.objects(building.QUICK, [*others, *own], tag="quick")
    building.link(building.QUICK, [folder / "wrong.o", *objects], folder / "target")
    done = subprocess.run(
        [folder / "target", *_corpus(bug.target)], capture_output=True, text=True, check=False
    )
    return done.stderr if done.returncode != 0 else ""


def reached() -> str:
    """Return what the board's corpus reaches: lines of a name and numbers."""
    own = [*building.sources_of("board"), HERE / "replay.cpp"]
    program = building.build(building.QUICK, "board", own, tag="quick")
    done = subprocess.run(
        [program, *_corpus("board")],
        capture_output=True, text=True, check=True, env={"SETAE_REACHED": "1"},
    )  # fmt: skip
    return done.stdout


def _corpus(target: str) -> list[Path]:
    return sorted(building.unpack(target, BUILD / "planted" / f"{target}-corpus").iterdir())
