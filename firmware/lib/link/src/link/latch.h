// One record that the host must not miss: repeated until acknowledged, readable ever after.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

// Record: a message with a `record_id` and a `session`.
template <typename Record>
class Latch {
 public:
  // The host has not acknowledged it.
  bool pending() const { return pending_; }
  const Record& record() const { return record_; }

  // The newest wins; that the id then rises by more than one shows the host what it missed.
  void set(const Record& record, uint8_t session) {
    const uint8_t id = record_.record_id == 255 ? 1 : record_.record_id + 1;
    record_ = record;
    record_.record_id = id;
    record_.session = session;
    pending_ = true;
    repeat_ = true;
    age_frames_ = 0;
  }

  void acknowledge(uint8_t record_id) {
    if (record_id != record_.record_id)
      return;
    pending_ = false;
    repeat_ = false;
  }

  // Send it once more. Nothing to send where nothing was ever latched.
  void recall() { recalled_ = record_.record_id != 0; }

  void on_frame() {
    if (!pending_ || ++age_frames_ < protocol::kRecordRepeatFrames)
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
  Record record_ = {};
  bool pending_ = false;
  bool repeat_ = false;
  bool recalled_ = false;
  uint8_t age_frames_ = 0;
};

}  // namespace setae
