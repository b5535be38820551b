// What the board says: whole frames, numbered, true, and every record until it is acknowledged.
#pragma once

#include "step.h"

namespace setae {
namespace fuzz {

constexpr int kRecords = protocol::kRecordCount;

// What a fuzzer's inputs have met, all together; for the test that asks whether they meet all.
struct Reached {
  bool mode[kModeCount];
  bool fault[256];
  bool refusal[256];
  bool trip_cause[256];
};
extern Reached reached;

class LineWatch {
 public:
  // A record that was not acknowledged is told after a reset too.
  void on_restart(bool powered_off);
  // What was heard before, by a host that listens again, says nothing of the next step.
  void on_poll() { last_is_new_ = false; }
  // A byte that the board sent.
  void on_bytes(const uint8_t* wire, size_t size);
  // After the bytes of that step.
  void on_step(const Step& step);

  uint8_t record_id(protocol::Record record) const { return records_[static_cast<int>(record)].id; }

 private:
  struct Record {
    uint8_t id = 0;  // the last one seen
    bool pending = false;
    uint32_t due_tick = 0;  // the next copy comes by then
  };

  void hear(const Inside& inside);
  void note(protocol::Record record, uint8_t id);
  void latched(protocol::Record record);

  ReferenceDecoder decoder_;
  bool heard_ = false;
  protocol::BoardHeader last_ = {};
  bool last_is_new_ = false;  // of this poll
  uint32_t ticks_ = 0;        // frames that the board has seen begin
  Record records_[kRecords];
};

}  // namespace fuzz
}  // namespace setae
