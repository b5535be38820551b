#include <doctest/doctest.h>

#include "hal_host/host_hal.h"
#include "link/latch.h"
#include "link/receiver.h"
#include "link/session.h"
#include "link/transmitter.h"

using namespace setae;
using Order = Session::Order;

TEST_CASE("commands are taken in order; what was lost or seen before is told apart") {
  Session session;
  session.start(5);
  CHECK(session.judge(0) == Order::kNext);
  CHECK(session.judge(1) == Order::kGap);
  CHECK(session.judge(255) == Order::kOld);
  bool right = true;
  for (int i = 0; i < 1000; ++i) {
    right = right && session.judge(uint8_t(i)) == Order::kNext;
    session.accept();
    right = right && session.judge(uint8_t(i)) == Order::kOld;
    right = right && session.judge(uint8_t(i + 2)) == Order::kGap;
  }
  CHECK(right);
}

TEST_CASE("a session remembers the one before, and starts at 0") {
  Session session;
  CHECK_FALSE(session.open());
  session.start(5);
  session.accept();
  session.start(9);
  CHECK(session.id() == 9);
  CHECK(session.previous() == 5);
  CHECK(session.expected() == 0);
}

namespace {

struct FaultLatch : Latch<protocol::FaultMessage> {
  FaultLatch() {
    memory.clear();
    begin(memory);
  }
  Memory memory;
};

}  // namespace

TEST_CASE("a record is repeated until its own id is acknowledged, and can be recalled ever after") {
  FaultLatch latch;
  latch.recall();
  CHECK_FALSE(latch.wanted(true));  // there is nothing yet
  latch.set({}, 9);
  CHECK(latch.record().record_id == 1);
  CHECK(latch.record().session == 9);
  CHECK(latch.wanted(true));
  CHECK_FALSE(latch.wanted(false));
  latch.sent();
  int sent = 0;
  for (int frame = 0; frame < 3 * protocol::kRecordRepeatFrames; ++frame) {
    latch.on_frame();
    if (latch.wanted(true)) {
      ++sent;
      latch.sent();
    }
  }
  CHECK(sent == 3);
  latch.acknowledge(2);
  CHECK(latch.pending());
  latch.acknowledge(1);
  CHECK_FALSE(latch.pending());
  for (int frame = 0; frame < 20; ++frame)
    latch.on_frame();
  CHECK_FALSE(latch.wanted(true));
  latch.recall();
  CHECK(latch.wanted(false));
}

TEST_CASE("record ids skip 0 when they wrap") {
  FaultLatch latch;
  for (int i = 0; i < 255; ++i)
    latch.set({}, 9);
  CHECK(latch.record().record_id == 255);
  latch.set({}, 9);
  CHECK(latch.record().record_id == 1);
}

TEST_CASE("a frame is written wholly or not at all") {
  HostHal hal;
  Transmitter transmitter(hal);
  const protocol::Receipt receipt = {};
  int sent = 0;
  while (transmitter.send(protocol::BoardHeader{}, receipt))
    ++sent;
  // What waits already delays whatever is urgent.
  CHECK(hal.to_send().size() <= Transmitter::kAheadBytes + protocol::kFrameWireBytesMax);
  CHECK(sent > 1);
  uint8_t byte;
  int bytes = 0;
  int delimiters = 0;
  while (hal.pop_tx(byte)) {
    ++bytes;
    delimiters += byte == 0;
  }
  CHECK(delimiters == sent);
  CHECK(bytes % sent == 0);
  CHECK(transmitter.send(protocol::BoardHeader{}, receipt));
}
