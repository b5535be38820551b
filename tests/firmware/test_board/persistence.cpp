// What outlives a reset or a power cut: records, the last pose, limits in EEPROM.
#include <doctest/doctest.h>

#include "../support/rig.h"
#include "protocol/crc32c.h"

using namespace setae;
using protocol::Fault;
using protocol::Record;
using protocol::Refusal;
using protocol::ResetCause;
using protocol::Sensor;
using protocol::State;

namespace {

constexpr int32_t kTouch = 1013 * kHpa + 30 * kHpa;

uint32_t crc_of(const protocol::SetLimits& limits) {
  uint8_t payload[protocol::SetLimits::kSize];
  encode(limits, payload);
  return protocol::crc32c(payload, sizeof(payload));
}

protocol::SetLimits limits_with(uint16_t slew_ticks) {
  protocol::SetLimits limits = kDefaultLimits;
  limits.slew_ticks = slew_ticks;
  return limits;
}

// What a host reads that connects now.
uint32_t crc_in_force(Rig& rig) {
  rig.open(static_cast<uint8_t>(rig.session % 255 + 1));
  rig.run_frames(1);
  return rig.hellos.back().message.limits_crc;
}

const protocol::Status& status(Rig& rig) {
  rig.run_frames(protocol::kStatusFrames + 2);
  return rig.statuses.back().message;
}

// Until the last byte is written; a slot takes 0.16 s.
void store(Rig& rig, uint16_t slew_ticks) {
  CHECK(rig.command(limits_with(slew_ticks)));
  CHECK(rig.command(protocol::StoreLimits{}));
  rig.run_frames(15);
}

void trip(Rig& rig) {
  rig.hold();
  rig.arm();
  rig.pressure_raw = kTouch;
  rig.run_frames(3);
}

}  // namespace

// ---------------------------------------------------------------- records

// The host was killed; the next one opened the port, which resets the board, and read nothing.
TEST_CASE("a trip is read after a reset by a host that comes later") {
  Rig rig;
  trip(rig);
  REQUIRE(!rig.trips.empty());
  const protocol::Trip before = rig.trips.back().message;
  rig.pressure_raw = 1013 * kHpa;
  rig.restart(ResetCause::kExternal);
  rig.trips.clear();
  rig.open(9);
  rig.run_frames(3);
  REQUIRE(rig.trips.size() >= 1);  // without being asked: nobody has acknowledged it
  const protocol::Trip after = rig.trips.back().message;
  CHECK(after.record_id == before.record_id);
  CHECK(after.session == before.session);
  CHECK(after.pressure_raw == before.pressure_raw);
  CHECK(after.sample_frame == before.sample_frame);
  CHECK(after.pulse_ticks[3][2] == before.pulse_ticks[3][2]);

  SUBCASE("nothing moves before it is acknowledged") {
    rig.command(Rig::enable());
    CHECK(rig.last_refusal() == Refusal::kRecordPending);
    rig.acknowledge_all();
    CHECK(rig.command(Rig::enable()));
  }
  SUBCASE("acknowledged, it is silent through the next reset, but can be recalled") {
    rig.acknowledge_all();
    rig.restart(ResetCause::kExternal);
    rig.trips.clear();
    rig.open(10);
    rig.run_frames(20);
    CHECK(rig.trips.empty());
    rig.send(protocol::Recall{static_cast<uint8_t>(Record::kTrip)});
    REQUIRE(rig.trips.size() == 1);
    CHECK(rig.trips[0].message.record_id == before.record_id);
  }
  SUBCASE("the next one has the next number") {
    rig.acknowledge_all();
    trip(rig);
    CHECK(rig.trips.back().message.record_id == before.record_id + 1);
  }
  SUBCASE("after a power cut there is none") {
    rig.power_cycle();
    rig.trips.clear();
    rig.open(10);
    rig.send(protocol::Recall{static_cast<uint8_t>(Record::kTrip)});
    rig.run_frames(20);
    CHECK(rig.trips.empty());
  }
}

TEST_CASE("a refusal is read after a reset too") {
  Rig rig;
  rig.hold();
  rig.command(Rig::enable());
  REQUIRE(!rig.refusals.empty());
  rig.restart(ResetCause::kExternal);
  rig.refusals.clear();
  rig.open(9);
  rig.run_frames(3);
  REQUIRE(!rig.refusals.empty());
  CHECK(rig.refusals[0].message.session == 7);
  CHECK(rig.last_refusal() == Refusal::kAlreadyEnabled);
}

TEST_CASE("a fault that nobody has read stays, and counts those after it") {
  Rig rig;
  rig.hold();
  rig.arm();
  rig.sensor = Sensor::kAbsent;
  rig.run_frames(2);
  rig.sensor = Sensor::kOk;
  rig.restart(ResetCause::kWatchdog);
  rig.restart(ResetCause::kWatchdog);
  rig.faults.clear();
  rig.open(9);
  rig.run_frames(6);
  REQUIRE(!rig.faults.empty());
  CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(Fault::kSensorAbsent));
  CHECK(rig.faults.back().message.further == 2);
  CHECK(rig.hellos.back().message.reset_cause == static_cast<uint8_t>(ResetCause::kWatchdog));
  rig.acknowledge_all();
  rig.restart(ResetCause::kWatchdog);
  rig.open(10);
  rig.run_frames(6);
  CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(Fault::kWatchdog));
  CHECK(rig.faults.back().message.further == 0);
}

TEST_CASE("retained memory whose bits have changed counts as none, each part for itself") {
  Rig rig;
  trip(rig);
  Retained& retained = rig.hal.retained();
  SUBCASE("a reset came while the pose was written") {
    retained.pose.value.pulses.ticks[1] ^= 0x100;
    rig.restart(ResetCause::kExternal);
    rig.open(9);
    rig.run_frames(1);  // behind the record
    CHECK(rig.hellos.back().message.pose_known == 1);
    CHECK(rig.hellos.back().message.pulse_ticks[1] == kFree);
  }
  SUBCASE("both copies") {
    retained.pose.value.pulses.ticks[1] ^= 0x100;
    retained.pose_copy.value.known ^= 1;
    rig.restart(ResetCause::kExternal);
    rig.open(9);
    rig.run_frames(1);  // behind the record
    CHECK(rig.hellos.back().message.pose_known == 0);
    CHECK(rig.hal.retained().trip.value.pending);
  }
  SUBCASE("a record") {
    retained.trip.value.record.pressure_raw ^= 1;
    rig.restart(ResetCause::kExternal);
    rig.trips.clear();
    rig.open(9);
    rig.run_frames(10);
    CHECK(rig.trips.empty());
    CHECK(rig.hellos.back().message.pose_known == 1);
  }
}

// ---------------------------------------------------------------- limits in EEPROM

TEST_CASE("stored limits are in force after a power cut; those that were only set are not") {
  Rig rig;
  CHECK(crc_in_force(rig) == crc_of(kDefaultLimits));
  CHECK(status(rig).stored_crc == 0);
  store(rig, 50);
  CHECK(rig.statuses.back().message.stored_crc == crc_of(limits_with(50)));
  CHECK(rig.statuses.back().message.storing == 0);
  CHECK(rig.command(limits_with(60)));
  rig.power_cycle();
  CHECK(crc_in_force(rig) == crc_of(limits_with(50)));
}

TEST_CASE("a power cut after any byte leaves the old limits or the new ones") {
  // Stored over and over: each slot in turn is the one that is overwritten, and generations wrap.
  Rig rig;
  rig.open();
  uint16_t old_slew = 0;
  bool new_seen = false;
  for (uint16_t round = 0; round < 300; ++round) {
    const uint32_t writes_before_cut = round % (kSlotBytes + 1);
    const uint16_t slew = 20 + round % 90;
    const uint32_t before = rig.hal.eeprom_writes();
    CHECK(rig.command(limits_with(slew)));
    CHECK(rig.command(protocol::StoreLimits{}));
    while (rig.hal.eeprom_writes() - before < writes_before_cut)
      rig.run_until(rig.hal.board_us() + kStepUs);
    const bool whole = rig.hal.eeprom_writes() - before == kSlotBytes;
    if (!whole && round % 2 && writes_before_cut != 0) {
      // In the middle of the byte: it holds anything.
      for (uint16_t slot : kSlotAt) {
        if (rig.hal.last_eeprom_address() - slot < kSlotBytes)
          rig.hal.eeprom(rig.hal.last_eeprom_address()) ^= 0x5A;
      }
    }
    rig.power_cycle();
    const uint32_t now = crc_in_force(rig);
    CAPTURE(round);
    if (whole) {
      CHECK(now == crc_of(limits_with(slew)));
      old_slew = slew;
      new_seen = true;
    } else {
      CHECK(now == crc_of(old_slew == 0 ? kDefaultLimits : limits_with(old_slew)));
    }
  }
  CHECK(new_seen);
}

TEST_CASE("EEPROM is written only while relaxed, a byte at a time, and goes on afterwards") {
  Rig rig;
  rig.open();
  CHECK(rig.command(limits_with(50)));
  CHECK(rig.command(protocol::StoreLimits{}));
  rig.run_frames(3);
  const uint32_t begun = rig.hal.eeprom_writes();
  CHECK(begun >= 15);  // 3.4 ms each
  CHECK(begun <= 20);
  CHECK(rig.command(Rig::enable()));
  rig.run_frames(30);
  CHECK(rig.hal.eeprom_writes() == begun);
  CHECK(status(rig).storing == 1);
  rig.command(protocol::StoreLimits{});
  CHECK(rig.last_refusal() == Refusal::kAlreadyEnabled);
  rig.acknowledge_all();
  CHECK(rig.command(Rig::relax()));
  rig.run_frames(20);
  CHECK(rig.hal.eeprom_writes() == kSlotBytes);
  CHECK(status(rig).stored_crc == crc_of(limits_with(50)));
}

TEST_CASE("other limits end a write that was begun: never a mixture") {
  Rig rig;
  rig.open();
  store(rig, 50);
  CHECK(rig.command(limits_with(60)));
  CHECK(rig.command(protocol::StoreLimits{}));
  rig.run_frames(3);
  CHECK(rig.command(limits_with(70)));
  rig.run_frames(20);
  CHECK(status(rig).stored_crc == crc_of(limits_with(50)));
  rig.power_cycle();
  CHECK(crc_in_force(rig) == crc_of(limits_with(50)));
}

TEST_CASE("with a low supply nothing is written, and it is a fault with hysteresis") {
  Rig rig;
  rig.open();
  CHECK(rig.command(limits_with(50)));
  CHECK(rig.command(protocol::StoreLimits{}));
  rig.run_frames(3);
  const uint32_t begun = rig.hal.eeprom_writes();
  rig.hal.set_supply_mv(3700);
  rig.run_until(rig.hal.board_us() + 15000);
  CHECK(rig.hal.eeprom_writes() == begun);  // at once, not only from the next frame on
  rig.run_frames(10);
  CHECK(rig.state() == State::kFault);
  REQUIRE(!rig.faults.empty());
  CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(Fault::kSupplyLow));
  CHECK(rig.faults.back().message.detail / 100 == 37);
  CHECK(rig.faults.back().message.further == 0);
  CHECK(status(rig).supply_mv / 100 == 37);

  rig.hal.set_supply_mv(3900);
  rig.run_frames(3);
  rig.acknowledge_all();
  rig.command(rig.resume());
  CHECK(rig.last_refusal() == Refusal::kFault);
  rig.acknowledge_all();
  rig.hal.set_supply_mv(4700);
  rig.run_frames(2);
  CHECK(rig.command(rig.resume()));
  CHECK(rig.state() == State::kRelaxed);
  rig.run_frames(15);
  CHECK(rig.hal.eeprom_writes() == kSlotBytes);
}

TEST_CASE("stored limits that this firmware does not allow are not in force") {
  Rig rig;
  rig.open();
  store(rig, 50);
  // As an older firmware could have written it: a whole slot, with a slew of 0.
  uint8_t bytes[kSlotBytes];
  for (uint8_t i = 0; i < sizeof(bytes); ++i)
    bytes[i] = rig.hal.eeprom(kSlotAt[1] + i);
  encode(limits_with(0), bytes + kSlotHeaderBytes);
  const uint8_t content = sizeof(bytes) - protocol::kCrcBytes;
  const uint32_t crc = protocol::crc32c(bytes, content);
  for (uint8_t i = 0; i < protocol::kCrcBytes; ++i)
    bytes[content + i] = static_cast<uint8_t>(crc >> 8 * i);
  for (uint8_t i = 0; i < sizeof(bytes); ++i)
    rig.hal.eeprom(kSlotAt[1] + i) = bytes[i];
  rig.power_cycle();
  CHECK(crc_in_force(rig) == crc_of(kDefaultLimits));
}
