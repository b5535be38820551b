// One record that the host must not miss: repeated until acknowledged, readable ever after,
// through a reset too.
#pragma once

#include <stdint.h>

#include "hal/retained.h"
#include "protocol/messages.h"

namespace setae {

// Record: a message with a `record_id` and a `session`.
template <typename Record>
class Latch {
 public:
  using Memory = Sealed<LatchMemory<Record>>;

  // Takes over what the last run left.
  void begin(Memory& memory) {
    memory_ = &memory;
    if (!memory.whole())
      memory.clear();
    repeat_ = pending();
  }

  // The host has not acknowledged it. Then nothing may take its place.
  bool pending() const { return memory_->value.pending; }
  const Record& record() const { return memory_->value.record; }

  void set(const Record& record, uint8_t session) {
    Record& kept = memory_->value.record;
    const uint8_t id = kept.record_id == 255 ? 1 : kept.record_id + 1;
    kept = record;
    kept.record_id = id;
    kept.session = session;
    memory_->value.pending = true;
    send();
  }

  // Another one came while this one waits.
  void count_further() {
    uint8_t& further = memory_->value.record.further;
    if (further != 255)
      ++further;
    send();
  }

  void acknowledge(uint8_t record_id) {
    if (record_id != record().record_id)
      return;
    memory_->value.pending = false;
    memory_->seal();
    repeat_ = false;
  }

  // Send it once more. Nothing to send where nothing was ever latched.
  void recall() { recalled_ = record().record_id != 0; }

  void on_frame() {
    if (!pending() || ++age_frames_ < protocol::kRecordRepeatFrames)
      return;
    age_frames_ = 0;
    repeat_ = true;
  }

  // Without a session only what was recalled is sent.
  bool wanted(bool session_open) const { return recalled_ || (repeat_ && session_open); }
  void sent() {
    recalled_ = false;
    repeat_ = false;
  }

 private:
  void send() {
    memory_->seal();
    repeat_ = true;
    age_frames_ = 0;
  }

  Memory* memory_ = nullptr;
  bool repeat_ = false;
  bool recalled_ = false;
  uint8_t age_frames_ = 0;
};

}  // namespace setae
