// The model that the checker explores (tests/model) against the real board: whatever state the
// model gets into within kDepth events, each event must lead both to the same one.
#include <doctest/doctest.h>
#include <stdlib.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "../support/rig.h"

namespace model {
#include "../../model/board.h"
}  // namespace model

namespace setae {

using protocol::ResetCause;

struct BoardProbe {
  // What both have, in the model's terms.
  static model::Board look(const Board& board) {
    model::Board seen = {};
    seen.mode = static_cast<uint8_t>(board.mode_);
    seen.epoch = board.epoch_;
    seen.session = board.session_.id();
    seen.expected = board.session_.expected();
    seen.attached = board.attached_ == 0            ? model::DETACHED
                    : board.attached_ == kAllServos ? model::ATTACHED
                                                    : model::PARTLY;
    seen.queued = board.player_.queued();
    seen.guard = static_cast<uint8_t>(board.detector_.guard());
    keep(board.trip_, seen.latch[model::TRIP]);
    keep(board.fault_, seen.latch[model::FAULT]);
    keep(board.refusal_, seen.latch[model::REFUSAL]);
    return seen;
  }

  template <typename Record>
  static void keep(const Latch<Record>& latch, model::Latch& seen) {
    seen.id = latch.record().record_id;
    seen.session = latch.record().session;
    seen.pending = latch.pending();
  }
};

namespace {

static_assert(static_cast<int>(protocol::Guard::kTaring) == model::GUARD_TARING, "");
static_assert(static_cast<int>(protocol::Guard::kArmed) == model::GUARD_ARMED, "");

// All there are: SETAE_WALK_DEPTH=99. These take a second.
constexpr int kDepth = 6;
constexpr uint16_t kPose = 1900;
constexpr int32_t kRest = 1013 * kHpa;

enum class Act {
  kEnable,
  kSegments,
  kSegmentsBad,
  kSegmentsOld,  // of an epoch that is over
  kGuard,
  kDisarm,
  kRelax,
  kLimp,
  kResume,
  kResumeOld,
  kRepeat,   // a command that was taken already
  kAhead,    // one before it was lost
  kForeign,  // of another session
  kAcknowledge,
  kStop,
  kStopAgain,
  kStopForeign,
  kHello,
  kNewSession,
  kTimePasses,
  kHeldTooLong,
  kTouch,
  kSensorFails,
  kSensorRecovers,
  kSupplyDips,
  kSwitchOpens,
  kSwitchCloses,
  kReset,
};
constexpr int kActs = 28;
const char* const kNames[kActs] = {
    "enable",        "segments",      "bad segments", "old segments",    "guard",
    "disarm",        "relax",         "limp",         "resume",          "old resume",
    "repeat",        "ahead",         "foreign",      "acknowledge",     "stop",
    "stop again",    "foreign stop",  "hello",        "new session",     "time passes",
    "held too long", "touch",         "sensor fails", "sensor recovers", "supply dips",
    "switch opens",  "switch closes", "reset"};

// The real board and the model, side by side.
class Pair {
 public:
  Pair() {
    rig.hal.set_stop_switch(false);
    rig.open(session_);
    protocol::SetLimits limits = kDefaultLimits;
    limits.stop_switch = 1;
    limits.hold_timeout_s = 2;
    rig.command(limits);
    rig.command(protocol::StoreLimits{});
    rig.run_frames(20);  // a reset finds them again
    board = BoardProbe::look(*rig.board);
  }

  // False where it can't happen now, or says nothing.
  bool act(Act what) {
    const model::Down none = {};
    model::Down m = none;
    m.session = rig.session;
    m.sequence = board.expected;
    m.epoch = board.epoch;
    rig.next_sequence = board.expected;
    switch (what) {
      case Act::kEnable:
        return command(m, model::ENABLE, Rig::enable(kPose));
      case Act::kSegments:
        if (board.queued == model::QUEUE_SLOTS)
          return false;  // the real queue is longer
        return command(m, model::SEGMENTS, segments(board.epoch, 1));
      case Act::kSegmentsBad:
        return command(m, model::SEGMENTS_BAD, segments(board.epoch, 0));
      case Act::kSegmentsOld:
        --m.epoch;
        return command(m, model::SEGMENTS, segments(m.epoch, 1));
      case Act::kGuard: {
        protocol::GuardMessage guard = rig.guard(protocol::Reflex::kRetract);
        guard.epoch = m.epoch;
        return command(m, model::GUARD, guard);
      }
      case Act::kDisarm:
        return command(m, model::DISARM, protocol::Disarm{});
      case Act::kRelax:
        return command(m, model::RELAX, Rig::relax());
      case Act::kLimp:
        return command(m, model::LIMP, protocol::Limp{});
      case Act::kResume:
        return command(m, model::RESUME, protocol::Resume{m.epoch});
      case Act::kResumeOld:
        --m.epoch;
        return command(m, model::RESUME, protocol::Resume{m.epoch});
      case Act::kRepeat:
      case Act::kAhead:
        m.sequence += what == Act::kAhead ? 1 : -1;
        rig.next_sequence = m.sequence;
        return command(m, model::LIMP, protocol::Limp{});
      case Act::kForeign:
        return foreign(m);
      case Act::kAcknowledge:
        return acknowledge(m);
      case Act::kStop:
        ++stop_number_;
        return stop(m, rig.session);
      case Act::kStopAgain:
        return stop_number_ != 0 && stop(m, rig.session);
      case Act::kStopForeign:
        return stop(m, 99);
      case Act::kHello:
      case Act::kNewSession:
        return hello(m, what == Act::kNewSession);
      default:
        return surroundings(what);
    }
  }

  // Where they differ; empty where they don't.
  std::string difference() const {
    const model::Board seen = BoardProbe::look(*rig.board);
    std::string found;
    tell(found, "mode", seen.mode, board.mode);
    tell(found, "epoch", seen.epoch, board.epoch);
    tell(found, "session", seen.session, board.session);
    tell(found, "expected", seen.expected, board.expected);
    tell(found, "attached", seen.attached, board.attached);
    tell(found, "queued", seen.queued, board.queued);
    tell(found, "guard", seen.guard, board.guard);
    for (int i = 0; i < model::LATCHES; ++i) {
      tell(found, "record", seen.latch[i].id, board.latch[i].id);
      tell(found, "its session", seen.latch[i].session, board.latch[i].session);
      tell(found, "pending", seen.latch[i].pending, board.latch[i].pending);
    }
    tell(found, "never", 0, board.never);
    return found;
  }

  // What decides on everything that can follow, without what only counts up.
  std::string key() const {
    std::string bytes = {
        static_cast<char>(board.mode),        static_cast<char>(board.session != 0),
        static_cast<char>(board.attached),    static_cast<char>(board.queued),
        static_cast<char>(board.guard),       static_cast<char>(board.sensor_bad),
        static_cast<char>(board.switch_open), static_cast<char>(board.of_sensor),
        static_cast<char>(board.stop_known)};
    for (const model::Latch& latch : board.latch)
      bytes += static_cast<char>(latch.pending);
    return bytes;
  }

  Rig rig;
  model::Board board = {};

 private:
  static void tell(std::string& found, const char* name, int real, int modelled) {
    if (real == modelled)
      return;
    found += std::string(name) + " is " + std::to_string(real) + ", in the model " +
             std::to_string(modelled) + "; ";
  }

  protocol::Segments segments(uint8_t epoch, uint8_t count) {
    there_ = !there_;
    protocol::Segments message =
        rig.segments({Rig::segment(12, static_cast<uint16_t>(kPose + (there_ ? 200 : 0)))});
    message.epoch = epoch;
    message.count = count;
    return message;
  }

  // The model counts modulo 4, the board modulo 256.
  void receive(model::Down m) {
    const uint8_t expected = board.expected;
    const int ahead = static_cast<int8_t>(m.sequence - expected);
    board.expected = 1;
    m.sequence = static_cast<uint8_t>(1 + ahead);
    model::board_receive(&board, &m);
    // What could not be refused before, because a refusal waited, is refused in the same poll.
    if (board.guard == model::GUARD_TARING && board.sensor_bad)
      model::board_tare_refused(&board);
    const bool restarted = m.kind == model::HELLO && board.expected == 0;
    board.expected = restarted ? 0 : static_cast<uint8_t>(expected + board.expected - 1);
  }

  template <typename Message>
  bool command(model::Down m, int kind, const Message& message) {
    m.kind = static_cast<uint8_t>(kind);
    receive(m);
    rig.send(message, rig.next_sequence);
    return true;
  }

  bool foreign(model::Down m) {
    m.kind = model::LIMP;
    m.session = 99;
    receive(m);
    rig.send_as(99, protocol::Limp{}, rig.next_sequence);
    return true;
  }

  bool acknowledge(model::Down m) {
    m.kind = model::ACKNOWLEDGE;
    for (int i = 0; i < model::LATCHES; ++i) {
      m.value = static_cast<uint8_t>(i);
      m.token = board.latch[i].id;
      if (m.token != 0) {
        receive(m);
        rig.acknowledge(static_cast<protocol::Record>(i + kFirstRecord), m.token);
      }
    }
    rig.poll();
    return true;
  }

  bool stop(model::Down m, uint8_t as_session) {
    m.kind = model::STOP;
    m.session = as_session;
    m.value = stop_number_;
    receive(m);
    rig.send_as(as_session, protocol::Stop{stop_number_});
    return true;
  }

  bool hello(model::Down m, bool other) {
    if (other)
      ++session_;
    m.kind = model::HELLO;
    m.value = session_;
    receive(m);
    rig.open(session_);
    return true;
  }

  bool surroundings(Act what) {
    switch (what) {
      case Act::kTimePasses:
        rig.send(protocol::Ping{1});  // a host that lives
        rig.run_frames(60);
        settle();
        return true;
      case Act::kHeldTooLong:
        if (board.mode != model::MODE_HOLDING)
          return false;
        rig.run_frames(180);
        settle();
        model::board_hold_timeout(&board);
        settle();
        return true;
      case Act::kTouch:
        if (board.guard != model::GUARD_ARMED)
          return false;
        model::board_trip(&board, 1);
        rig.pressure_raw = kRest + 30 * kHpa;
        rig.run_frames(3);
        rig.pressure_raw = kRest;
        return true;
      case Act::kSensorFails:
        // In the midst of a motion or a tare its frames would do more than this one thing.
        if (board.sensor_bad || board.mode == model::MODE_ATTACHING)
          return false;
        board.sensor_bad = 1;
        if (board.guard == model::GUARD_ARMED)
          model::board_fault(&board, 1);
        else if (board.guard == model::GUARD_TARING)
          model::board_tare_refused(&board);
        rig.sensor = protocol::Sensor::kBus;
        rig.run_frames(1);
        return true;
      case Act::kSensorRecovers:
        if (!board.sensor_bad)
          return false;
        rig.send(protocol::Ping{1});
        rig.sensor = protocol::Sensor::kOk;
        rig.run_frames(60);
        board.sensor_bad = 0;
        settle();
        return true;
      case Act::kSupplyDips:
        rig.hal.set_supply_mv(3500);
        rig.run_frames(1);
        model::board_fault(&board, 0);
        rig.hal.set_supply_mv(5000);
        rig.run_frames(1);
        return true;
      case Act::kSwitchOpens:
      case Act::kSwitchCloses:
        if (board.switch_open == (what == Act::kSwitchOpens))
          return false;
        board.switch_open = !board.switch_open;
        rig.hal.set_stop_switch(board.switch_open);
        for (int polls = 0; polls < 20; ++polls)
          rig.poll();
        if (board.switch_open)
          model::board_switched_off(&board);
        return true;
      default:
        rig.restart(ResetCause::kExternal);
        model::board_reset(&board);
        return true;
    }
  }

  // All that time brings about.
  void settle() {
    for (;;) {
      if (board.mode == model::MODE_ATTACHING)
        model::board_attached(&board);
      else if (board.guard == model::GUARD_TARING && !board.sensor_bad)
        model::board_tared(&board);
      else if (board.mode == model::MODE_PLAYING)
        model::board_played(&board);
      else if (board.mode == model::MODE_UNWINDING)
        model::board_unwound(&board);
      else if (board.mode == model::MODE_REFLEX)
        model::happen(&board, model::EVENT_REFLEX_DONE);
      else
        return;
    }
  }

  static constexpr int kFirstRecord = static_cast<int>(protocol::Record::kTrip);
  uint8_t session_ = 7;
  uint8_t stop_number_ = 0;
  bool there_ = false;
};

std::string words(const std::vector<Act>& path) {
  std::string all;
  for (Act act : path)
    all += std::string(kNames[static_cast<int>(act)]) + ", ";
  return all;
}

}  // namespace

TEST_CASE("the model does what the board does, from every state within six events") {
  const char* const wanted = getenv("SETAE_WALK_DEPTH");
  const int deepest = wanted ? atoi(wanted) : kDepth;
  std::set<std::string> known;
  std::vector<std::vector<Act>> paths = {{}};
  int compared = 0;
  for (int depth = 0; depth < deepest && !paths.empty(); ++depth) {
    std::vector<std::vector<Act>> longer;
    for (const std::vector<Act>& path : paths) {
      for (int next = 0; next < kActs; ++next) {
        std::unique_ptr<Pair> pair(new Pair);
        for (Act act : path)
          pair->act(act);
        if (!pair->act(static_cast<Act>(next)))
          continue;
        ++compared;
        std::vector<Act> way = path;
        way.push_back(static_cast<Act>(next));
        const std::string difference = pair->difference();
        if (difference != "") {
          INFO(words(way));
          CHECK(difference == "");
          continue;
        }
        if (known.insert(pair->key()).second)
          longer.push_back(way);
      }
    }
    paths = longer;
  }
  MESSAGE(compared << " steps, " << known.size() << " states");
  CHECK(known.size() > 100);
}

TEST_CASE("a model that does something else is noticed") {
  model::plant = model::PLANT_STOP_KEEPS_QUEUE;
  Pair pair;
  for (Act act : {Act::kEnable, Act::kTimePasses, Act::kSegments}) {
    pair.act(act);
    CHECK(pair.difference() == "");
  }
  pair.act(Act::kStop);
  CHECK(pair.difference() == "queued is 0, in the model 1; ");
  model::plant = model::NO_PLANT;
}

}  // namespace setae
