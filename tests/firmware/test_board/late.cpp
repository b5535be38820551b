// A loop that is late: a servo frame begins between two looks at the time.
#include <doctest/doctest.h>
#include <stdlib.h>

#include "board/board.h"
#include "hal_host/host_hal.h"
#include "protocol/frame.h"

using namespace setae;

namespace {

// The next frame begins just before the pulses are set for the `calls`th time from now.
class LateHal final : public HostHal {
 public:
  uint32_t set_pulses(const Pulses& pulses, uint8_t attached) override {
    if (calls != 0 && --calls == 0)
      next_frame();
    return HostHal::set_pulses(pulses, attached);
  }
  void next_frame() {
    advance_to((board_us() / protocol::kServoFrameUs + 1) * protocol::kServoFrameUs);
    step_ticks = abs(output().ticks[0] - last_ticks_);
    last_ticks_ = output().ticks[0];
  }

  uint8_t calls = 0;
  int step_ticks = 0;  // of the first servo, in this frame

 private:
  int last_ticks_ = 0;
};

struct Late {
  template <typename Message>
  void send(const Message& message) {
    uint8_t wire[protocol::kFrameWireBytesMax];
    uint8_t* const frame = wire + 1;
    encode(protocol::HostHeader{static_cast<uint8_t>(Message::kType), session, sequence}, frame);
    encode(message, frame + protocol::HostHeader::kSize);
    const uint8_t size =
        protocol::encode_frame(frame, protocol::HostHeader::kSize + Message::kSize, wire);
    for (uint8_t i = 0; i < size; ++i)
      hal.push_rx(wire[i]);
    board.poll();
    sequence += protocol::is_reliable(Message::kType);
  }
  void run_frames(int frames) {
    for (; frames > 0; --frames) {
      hal.next_frame();
      board.poll();
      uint8_t byte;
      while (hal.pop_tx(byte)) {
      }
    }
  }
  void hold() {
    board.poll();
    send(protocol::Hello{protocol::kProtocolVersion, protocol::kSchemaHash, 7, 0});
    session = 7;
    send(protocol::Enable{{1700, 1700, 1700, 1700}});
    run_frames(25);
  }
  // Ten ticks a frame.
  void begin() {
    protocol::Segments message = {};
    message.epoch = board.epoch();
    message.count = 1;
    message.segments[0] = {50, {2200, 2200, 2200, 2200}};
    send(message);
  }
  void play() {
    hold();
    begin();
    run_frames(5);
    REQUIRE(hal.step_ticks == 10);
  }

  LateHal hal;
  Board board{hal};
  uint8_t session = 0;
  uint8_t sequence = 0;
};

}  // namespace

// A frame that began between a poll's look at the time and its set_pulses() got the pulses of the
// frame before; the board took it to have got those that it had just set. So a stop then let the
// robot go one step on, and without a stop the next step was twice as long.
TEST_CASE("a stop holds when a frame has begun before its pulses were set") {
  Late late;
  late.play();
  late.hal.calls = 1;
  late.run_frames(1);
  late.send(protocol::Stop{1});
  for (int frame = 0; frame < 5; ++frame) {
    late.run_frames(1);
    CHECK(late.hal.step_ticks == 0);
  }
}

TEST_CASE("no step is longer when a frame has begun before its pulses were set") {
  Late late;
  late.play();
  late.hal.calls = 1;
  late.run_frames(1);
  late.board.poll();
  for (int frame = 0; frame < 10; ++frame) {
    late.run_frames(1);
    CHECK(late.hal.step_ticks <= 10);
  }
}

TEST_CASE("a motion's first step is not lost when a frame has begun before it was set") {
  Late late;
  late.hold();
  late.hal.calls = 1;
  late.begin();
  CHECK(late.hal.step_ticks == 0);
  for (int frame = 1; frame <= 50; ++frame) {
    late.run_frames(1);
    CHECK(late.hal.step_ticks == 10);
  }
  late.run_frames(1);
  CHECK(late.hal.step_ticks == 0);
}
