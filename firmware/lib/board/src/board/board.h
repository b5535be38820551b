// The board: messages and samples in, pulses and messages out. It never waits; call poll() as
// often as possible.
//
// One class in four files, by what starts the work:
//   board.cpp     time: the servo frame, the modes, what the pulses do next
//   commands.cpp  the host: each message, checked and carried out
//   safety.cpp    danger: sample to contact to stop, faults
//   reports.cpp   what the host gets to know
#pragma once

#include <stdint.h>

#include "board/limits_store.h"
#include "board/pulse_history.h"
#include "board/sample_log.h"
#include "board/state_table.h"
#include "contact/detector.h"
#include "contact/sample_judge.h"
#include "hal/hal.h"
#include "link/latch.h"
#include "link/receiver.h"
#include "link/session.h"
#include "link/transmitter.h"
#include "motion/attacher.h"
#include "motion/limits.h"
#include "motion/line.h"
#include "motion/player.h"
#include "protocol/messages.h"

namespace setae {

// Keeps a message's bytes off the stack once the function that needs them is done: inlined, the
// caller would hold those of all its messages at once.
#ifdef __AVR__
#define SETAE_OWN_FRAME __attribute__((noinline))
#else
#define SETAE_OWN_FRAME
#endif

class Board {
 public:
  // Touches no hardware: that begins with the first poll(). All members begin as zeros, so that
  // on the UNO it is made before the program starts, without code.
  explicit constexpr Board(HalRef hal) : hal_(hal), transmitter_(hal), store_(hal) {}

  void poll();

  Mode mode() const { return mode_; }
  uint8_t epoch() const { return epoch_; }

 private:
  friend struct BoardProbe;  // tests/fuzz

  // What comes 0.5 ms before a frame, a sample or a stop, is to reach that frame. Writing a report
  // takes up to 0.45 ms while a sample is being fetched, so none is begun so near the frame's end.
  // What is written already lasts the line for most of that.
  static constexpr uint16_t kQuietUs = 700;

  // ---- board.cpp: time ----
  SETAE_OWN_FRAME void start();
  SETAE_OWN_FRAME void start_limits();
  bool sample_is_urgent();
  BoardTime now();
  SETAE_OWN_FRAME void begin_frame(uint32_t frame);
  void advance_motion();
  void watch_hold_timeout();
  void put_out(const Pulses& set_before);
  void check_consistency();

  // Makes the pulses last set those of this frame.
  void latch_frame(uint32_t frame);

  // What the state table says to an event: why it is refused, or kNone.
  protocol::Refusal ask(Event event) const;
  // The same, and changes the mode unless the event is refused.
  protocol::Refusal raise(Event event);
  SETAE_OWN_FRAME void play_if_ready();
  // The servos stay where they are in this frame, and the plans are dropped.
  void freeze();
  // What is queued or guarded is forgotten. The new epoch tells it from what the host sent
  // before it knew.
  void drop_plans();
  void switch_off();
  void end_motion();
  void start_line(const uint16_t* to_ticks, uint16_t slew_ticks);

  // ---- commands.cpp: the host ----
  void receive();
  bool take_received();
  SETAE_OWN_FRAME void handle_message();
  SETAE_OWN_FRAME void handle_hello();
  void handle_stop();
  void handle_reliable();
  bool carry_out();
  // These are false where the command is not carried out, and say why in `verdict`.
  bool decide(Verdict& verdict);
  SETAE_OWN_FRAME bool enable(Verdict& verdict);
  bool resume(Verdict& verdict);
  SETAE_OWN_FRAME bool relax(Verdict& verdict);
  void limp();
  SETAE_OWN_FRAME bool segments(Verdict& verdict);
  SETAE_OWN_FRAME bool guard(Verdict& verdict);
  bool disarm(Verdict& verdict);
  SETAE_OWN_FRAME bool set_limits(Verdict& verdict);
  bool store_limits(Verdict& verdict);
  // Whether the state table allows it.
  bool allows(Event event, Verdict& verdict) const;
  bool check_segments(const protocol::Segments& message, Verdict& verdict) const;
  bool check_guard(const protocol::GuardMessage& message, Verdict& verdict) const;
  // Latches the refusal, and stops the motion where a motion was refused.
  SETAE_OWN_FRAME void refuse(protocol::MessageType type, uint8_t sequence, const Verdict& verdict);

  // ---- safety.cpp: danger ----
  void read_sensor();
  void take_sample(const SensorReading& reading);
  RestLevel::Follow rest_follow() const;
  void refuse_tare(protocol::Refusal reason, uint32_t value, uint32_t limit);
  void watch_supply();
  void watch_stop_switch();
  bool stop_switch_open() const {
    return limits_.in_force().stop_switch && hal_.stop_switch_open();
  }
  SETAE_OWN_FRAME void trip(protocol::TripCause cause);
  SETAE_OWN_FRAME void fault(protocol::Fault fault, uint32_t detail);
  bool fault_persists() const;
  // While one waits, no motion: so none that the host has not read is ever overwritten.
  bool record_pending() const { return trip_.pending() || fault_.pending(); }

  // ---- reports.cpp: what the host gets to know ----
  // The first goes first.
  enum Report : uint8_t {
    kTelemetry = 1 << 0,
    kReceipt = 1 << 1,
    kHelloReply = 1 << 2,
    kPong = 1 << 3,
    kStatus = 1 << 4,
    kLimits = 1 << 5,
  };
  void want(Report report) { wanted_ |= report; }
  void report();
  void send(Report report);
  SETAE_OWN_FRAME void send_receipt();
  SETAE_OWN_FRAME void send_hello_reply();
  SETAE_OWN_FRAME void send_limits();
  SETAE_OWN_FRAME void send_pong();
  SETAE_OWN_FRAME void send_telemetry();
  SETAE_OWN_FRAME void send_status();
  template <typename Record>
  SETAE_OWN_FRAME bool send_latched(Latch<Record>& latch);
  // What each message begins with; the transmitter adds the rest.
  struct Header : protocol::BoardHeader {
    explicit Header(const Board& board);
  };

  HalRef hal_;
  Receiver receiver_;
  Session session_;
  Transmitter transmitter_;
  Limits limits_;
  LimitsStore store_;
  Player player_;
  Attacher attacher_;
  Detector detector_;

  // Time and motion.
  bool started_ = false;
  uint32_t frame_ = 0;
  Mode mode_ = Mode::kRelaxed;
  uint8_t epoch_ = 0;
  Pulses current_ = {};  // put out in this frame
  Pulses next_ = {};     // to be put out in the next one
  uint8_t current_attached_ = 0;
  uint8_t attached_ = 0;  // for the next frame
  Line line_;             // unwinding and reflex
  PulseHistory history_;
  Pulses rest_pose_ = {};          // where the servos attached: a hold that timed out returns there
  uint32_t idle_since_frame_ = 0;  // no motion, and nothing from the host
  uint32_t ran_dry_frame_ = 0;
  bool ran_dry_ = false;
  uint8_t underruns_ = 0;

  // Guarded move.
  protocol::Reflex reflex_ = protocol::Reflex::kHold;
  uint16_t retract_ticks_[protocol::kServos] = {};
  uint16_t retract_slew_ticks_ = 0;
  uint8_t guard_sequence_ = 0;

  // Sensor.
  protocol::Sensor sensor_ = protocol::Sensor::kOk;  // from the first poll on
  SampleJudge judge_;
  protocol::Sensor judged_ = protocol::Sensor::kOk;  // of the last sample's value
  BoardTime sampled_ = {};                           // the last sample
  uint32_t sampled_frame_ = 0;
  SampleLog samples_;

  // Supply and stop switch.
  bool supply_low_ = false;
  uint8_t open_polls_ = 0;

  // Link.
  bool stop_known_ = false;
  uint8_t stop_number_ = 0;
  uint8_t stop_session_ = 0;
  uint32_t hello_token_ = 0;
  uint32_t ping_token_ = 0;
  uint8_t wanted_ = 0;  // a bit for each Report
  bool gap_ = false;
  uint8_t status_age_frames_ = 0;

  Latch<protocol::Trip> trip_;
  Latch<protocol::FaultMessage> fault_;
  Latch<protocol::RefusalMessage> refusal_;
};

}  // namespace setae
