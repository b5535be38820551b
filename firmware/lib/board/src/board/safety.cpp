// From a pressure sample to the stop.
#include "board/board.h"

namespace setae {

using protocol::Fault;
using protocol::Guard;
using protocol::Refusal;
using protocol::Sensor;
using protocol::TripCause;

namespace {

// The stop switch's: 0.2 ms at least, which a servo's spark does not last. An idle loop turns in
// 15 us.
constexpr uint8_t kOpenPolls = 14;

constexpr Fault fault_of(Sensor sensor) {
  return static_cast<Fault>(sensor);
}
static_assert(fault_of(Sensor::kAbsent) == Fault::kSensorAbsent, "");
static_assert(fault_of(Sensor::kWrong) == Fault::kSensorWrong, "");
static_assert(fault_of(Sensor::kSilent) == Fault::kSensorSilent, "");
static_assert(fault_of(Sensor::kBus) == Fault::kSensorBus, "");
static_assert(fault_of(Sensor::kRange) == Fault::kSensorRange, "");
static_assert(fault_of(Sensor::kStuck) == Fault::kSensorStuck, "");
static_assert(fault_of(Sensor::kNoisy) == Fault::kSensorNoisy, "");

}  // namespace

void Board::read_sensor() {
  const SensorReading reading = hal_.read_sensor();
  if (reading.fresh)
    judged_ = judge_.take(reading.pressure_raw);
  if (reading.status != Sensor::kOk) {
    sensor_ = reading.status;
  } else if (judged_ != Sensor::kOk) {
    sensor_ = judged_;
  } else if (frame_ - sampled_frame_ > protocol::kSensorSilentFrames && !reading.fresh) {
    sensor_ = Sensor::kSilent;
  } else {
    sensor_ = Sensor::kOk;
  }
  if (reading.fresh && sensor_ == Sensor::kOk)
    take_sample(reading);

  if (sensor_ == Sensor::kOk)
    return;
  switch (detector_.guard()) {
    case Guard::kArmed:
      fault(fault_of(sensor_), frame_ - sampled_frame_);
      break;
    case Guard::kTaring:
      refuse_tare(Refusal::kSensorUnavailable, static_cast<uint8_t>(sensor_), 0);
      break;
    default:
      break;
  }
}

void Board::take_sample(const SensorReading& reading) {
  sampled_ = reading.sampled;
  sampled_frame_ = frame_;
  samples_.add(reading.pressure_raw, reading.sampled);
  switch (detector_.take(reading.pressure_raw, rest_follow())) {
    case Finding::kContact:
      trip(TripCause::kContact);
      break;
    case Finding::kCoarseContact:
      trip(TripCause::kCoarseContact);
      break;
    case Finding::kArmed:
      play_if_ready();
      break;
    case Finding::kTareNoisy:
      refuse_tare(Refusal::kTareNoisy, detector_.tare_figure_raw(), detector_.tare_limit_raw());
      break;
    case Finding::kTareFar:
      refuse_tare(Refusal::kTareFar, detector_.tare_figure_raw(), detector_.tare_limit_raw());
      break;
    case Finding::kNothing:
      break;
  }
}

RestLevel::Follow Board::rest_follow() const {
  if (mode_ == Mode::kRelaxed)
    return RestLevel::Follow::kClosely;
  if (mode_ == Mode::kHolding && detector_.guard() == Guard::kOff) {
    return RestLevel::Follow::kSlowly;
  }
  return RestLevel::Follow::kNot;
}

void Board::refuse_tare(Refusal reason, uint32_t value, uint32_t limit) {
  if (refusal_.pending()) {  // the host has to read another refusal first: try again meanwhile
    detector_.tare_again();
    return;
  }
  Verdict verdict;
  verdict.refuse(reason, kNoIndex, static_cast<int32_t>(value), static_cast<int32_t>(limit));
  refuse(protocol::MessageType::kGuard, guard_sequence_, verdict);
}

// A contact becomes a stop here: frozen pulses first, then the record.
void Board::trip(TripCause cause) {
  const int32_t baseline_raw = detector_.baseline_raw();
  const bool second = mode_ == Mode::kReflex;  // the retract itself ran into something
  freeze();
  const bool retract = cause == TripCause::kContact && reflex_ == protocol::Reflex::kRetract;
  raise(retract ? Event::kTripRetract : Event::kTrip);
  if (retract)
    start_line(retract_ticks_, retract_slew_ticks_);
  if (second)
    return;  // the record of the first one stands

  protocol::Trip record = {};
  record.cause = static_cast<uint8_t>(cause);
  record.sample_frame = sampled_.frame;
  record.sample_phase_us = sampled_.phase_us;
  record.pressure_raw = detector_.last_raw();
  record.baseline_raw = baseline_raw;
  for (uint8_t frame = 0; frame < protocol::kTripHistoryFrames; ++frame) {
    for (uint8_t i = 0; i < protocol::kServos; ++i) {
      record.pulse_ticks[frame][i] = history_[frame].ticks[i];
    }
  }
  trip_.set(record, session_.id());
}

void Board::watch_supply() {
  const uint16_t part = hal_.bandgap_part();
  const bool low = part > (supply_low_ ? kSupplyGoodPart : kSupplyLowPart);
  if (low && !supply_low_)
    fault(Fault::kSupplyLow, supply_mv(part));
  supply_low_ = low;
}

void Board::watch_stop_switch() {
  if (!stop_switch_open()) {
    open_polls_ = 0;
    return;
  }
  if (open_polls_ < kOpenPolls) {
    ++open_polls_;
    return;
  }
  if (mode_ == Mode::kStopped || mode_ == Mode::kFault)
    return;
  freeze();
  raise(Event::kStop);
}

void Board::fault(Fault fault, uint32_t detail) {
  freeze();
  mode_ = look_up(mode_, Event::kFault).mode();
  if (fault_.pending())
    return fault_.count_further();

  protocol::FaultMessage record = {};
  record.fault = static_cast<uint8_t>(fault);
  record.detail = detail;
  const BoardTime time = now();
  record.frame = time.frame;
  record.phase_us = time.phase_us;
  for (uint8_t i = 0; i < protocol::kServos; ++i)
    record.pulse_ticks[i] = current_.ticks[i];
  fault_.set(record, session_.id());
}

bool Board::fault_persists() const {
  const Fault cause = static_cast<Fault>(fault_.record().fault);
  const bool of_sensor = cause >= Fault::kSensorAbsent && cause <= Fault::kSensorNoisy;
  return supply_low_ || (of_sensor && sensor_ != Sensor::kOk);
}

}  // namespace setae
