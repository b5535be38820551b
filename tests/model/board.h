// The board's rules without time, pulses and numbers: what can be asked of a model checker.
//
// The checker runs them against every line and host (world.h); walk.cpp holds them against the
// real board. `plant` names an error that is put in to see whether it is found.
#pragma once

#include "table.h"

enum {
  NO_PLANT,
  PLANT_OLD_COMMAND_AGAIN,  // a repeat is carried out again
  PLANT_GAP_ACCEPTED,       // a command after a lost one is taken
  PLANT_EPOCH_IGNORED,      // segments of an old epoch are queued
  PLANT_RESUME_OF_ANY_EPOCH,
  PLANT_STOP_KEEPS_QUEUE,
  PLANT_STOP_NEEDS_SESSION,
  PLANT_STOP_UNLATCHED,      // table: a stop of what plays leads to holding
  PLANT_PLAY_WHEN_STOPPED,   // table: segments are taken while stopped
  PLANT_DEAD_END,            // table: no resume after a stop
  PLANT_RESUME_SWITCHES_ON,  // table: a resume without pulses leads to holding
  PLANT_CELL_MISSING,        // table: the queue has something, but holding does not play
  PLANT_LIMP_KEEPS_PULSES,
  PLANT_REFUSAL_OVERWRITTEN,
  PLANT_RECORD_ONCE,  // a record is never sent again
  PLANT_SESSION_KEEPS_NUMBERS,
  PLANT_RESET_KEEPS_SESSION,
  PLANT_RECEIPT_TRUSTED,   // host: acknowledged is executed
  PLANT_TOLD_TWICE,        // host: each copy of a record is told
  PLANT_NEVER_SENT_AGAIN,  // host
  PLANT_SAME_STOP,         // host: each stop has the same number
  PLANT_STOP_TRUSTED,      // host: sent is confirmed by any telemetry
};

static int plant;  // one of them; set before the start

typedef unsigned char Byte;

// Small moduli for 256; WINDOW and the age of late frames stay in proportion.
enum { SEQUENCES = 4, WINDOW = 2, QUEUE_SLOTS = 2, STOP_NUMBERS = 4 };

enum { DETACHED, PARTLY, ATTACHED };
enum { GUARD_OFF, GUARD_TARING, GUARD_ARMED };
enum { TRIP, FAULT, REFUSAL, LATCHES };

enum {  // messages to the board
  NOTHING,
  HELLO,
  STOP,
  SETTLE,  // recall of all records, then a ping
  ACKNOWLEDGE,
  // Commands: numbered, carried out in order.
  ENABLE,
  SEGMENTS,
  GUARD,
  DISARM,
  RELAX,
  LIMP,
  RESUME,
  SEGMENTS_BAD,  // outside the limits
  COMMANDS_END,
};
enum { HELLO_REPLY = COMMANDS_END, RECEIPT, RECORD, PONG, TELEMETRY };

enum { IGNORED, NOT_TAKEN, EXECUTED, DISCARDED, REFUSED };

// To the board. `command` and `era` are the judge's, no field of the real message.
typedef struct {
  Byte kind, session, sequence, epoch;
  Byte value;  // new session and token, stop number, or latch and record id
  Byte token;
  Byte command;  // which command or stop of the user it is
  Byte era;      // the era in which the host sent it
} Down;

typedef struct {
  Byte id, session, pending, repeat, recalled;
  Byte sequence, kind;  // of a refused command
  Byte command;         // the judge's
} Latch;

typedef struct {
  Byte mode, epoch, session, expected;
  Byte attached, queued, guard, sensor_bad, switch_open;
  Byte of_sensor;  // the latched fault is
  Byte stop_known, stop_number, stop_session;
  Byte receipt, hello, token, pong, pong_token, telemetry;  // what is to be sent
  Byte guard_sequence, guard_command;                       // of the guard that is on
  Byte never;  // the table was asked what it says never happens
  Latch latch[LATCHES];
} Board;

static int cell(const Board* b, int event) {
  if (plant == PLANT_STOP_UNLATCHED && event == EVENT_STOP && b->mode == MODE_PLAYING)
    return MODE_HOLDING;
  if (plant == PLANT_PLAY_WHEN_STOPPED && event == EVENT_SEGMENTS && b->mode == MODE_STOPPED)
    return MODE_HOLDING;
  if (plant == PLANT_DEAD_END && event == EVENT_RESUME_ATTACHED && b->mode == MODE_STOPPED)
    return CELL_REFUSE;
  if (plant == PLANT_RESUME_SWITCHES_ON && event == EVENT_RESUME_DETACHED)
    return MODE_HOLDING;
  if (plant == PLANT_CELL_MISSING && event == EVENT_PLAY)
    return CELL_NEVER;
  return kCells[event][b->mode];
}

static int allows(const Board* b, int event) {
  const int to = cell(b, event);
  return to == CELL_NEVER || !(to & CELL_REFUSE);
}

static int happen(Board* b, int event) {
  const int to = cell(b, event);
  if (to == CELL_NEVER)
    b->never = 1;
  else if (to & CELL_REFUSE)
    return REFUSED;
  else
    b->mode = (Byte)to;
  return EXECUTED;
}

static void drop_plans(Board* b) {
  b->queued = 0;
  b->guard = GUARD_OFF;
  ++b->epoch;
}

static void latch(Board* b, int which, const Down* refused) {
  Latch* l = &b->latch[which];
  l->id = (Byte)(l->id + 1);
  l->session = b->session;
  l->pending = l->repeat = 1;
  l->sequence = refused ? refused->sequence : 0;
  l->kind = refused ? refused->kind : 0;
  l->command = refused ? refused->command : 0;
}

static void play_if_ready(Board* b) {
  if (b->queued && b->guard != GUARD_TARING)
    happen(b, EVENT_PLAY);
}

static void refuse(Board* b, const Down* m) {
  latch(b, REFUSAL, m);
  if (m->kind != SEGMENTS && m->kind != SEGMENTS_BAD && m->kind != GUARD)
    return;
  drop_plans(b);
  happen(b, EVENT_MOTION_REFUSED);
}

static int record_pending(const Board* b) {
  return b->latch[TRIP].pending || b->latch[FAULT].pending;
}

static int resume(Board* b, const Down* m) {
  if (m->epoch != b->epoch && plant != PLANT_RESUME_OF_ANY_EPOCH)
    return REFUSED;
  if (record_pending(b) && b->mode != MODE_REFLEX)
    return REFUSED;
  if ((b->mode == MODE_FAULT && b->of_sensor && b->sensor_bad) || b->switch_open)
    return REFUSED;
  return happen(b, b->attached == DETACHED   ? EVENT_RESUME_DETACHED
                   : b->attached == ATTACHED ? EVENT_RESUME_ATTACHED
                                             : EVENT_RESUME_PARTLY);
}

static int segments(Board* b, const Down* m) {
  if (m->epoch != b->epoch && plant != PLANT_EPOCH_IGNORED)
    return DISCARDED;
  if (!allows(b, EVENT_SEGMENTS) || m->kind == SEGMENTS_BAD)
    return REFUSED;
  if (b->queued == QUEUE_SLOTS)
    return NOT_TAKEN;
  ++b->queued;
  happen(b, EVENT_SEGMENTS);
  play_if_ready(b);
  return EXECUTED;
}

static int guard(Board* b, const Down* m) {
  if (m->epoch != b->epoch)
    return DISCARDED;
  if (!allows(b, EVENT_GUARD) || b->queued || b->sensor_bad)
    return REFUSED;
  b->guard = GUARD_TARING;
  b->guard_sequence = m->sequence;
  b->guard_command = m->command;
  return happen(b, EVENT_GUARD);
}

static int decide(Board* b, const Down* m) {
  switch (m->kind) {
    case ENABLE:
      if (!allows(b, EVENT_ENABLE) || record_pending(b))
        return REFUSED;
      b->attached = PARTLY;
      return happen(b, EVENT_ENABLE);
    case SEGMENTS:
    case SEGMENTS_BAD:
      return segments(b, m);
    case GUARD:
      return guard(b, m);
    case DISARM:
      if (!allows(b, EVENT_DISARM) || (b->mode == MODE_HOLDING && b->queued))
        return REFUSED;
      b->guard = GUARD_OFF;
      return happen(b, EVENT_DISARM);
    case RELAX:
      if (!allows(b, EVENT_RELAX))
        return REFUSED;
      b->queued = 0;
      b->guard = GUARD_OFF;
      return happen(b, EVENT_RELAX);
    case LIMP:
      b->guard = GUARD_OFF;
      b->queued = 0;
      if (plant != PLANT_LIMP_KEEPS_PULSES)
        b->attached = DETACHED;
      return happen(b, EVENT_LIMP);
    default:
      return resume(b, m);
  }
}

static int take_command(Board* b, const Down* m) {
  int end;
  b->receipt = 1;
  if (m->sequence != b->expected) {
    const int behind = (b->expected - m->sequence + SEQUENCES) % SEQUENCES;
    const int old = behind < SEQUENCES / 2;
    if (!(old && plant == PLANT_OLD_COMMAND_AGAIN) && !(!old && plant == PLANT_GAP_ACCEPTED))
      return IGNORED;
  }
  end = decide(b, m);
  if (end == REFUSED && b->latch[REFUSAL].pending && plant != PLANT_REFUSAL_OVERWRITTEN)
    return NOT_TAKEN;
  if (end == NOT_TAKEN)
    return end;
  if (end == REFUSED)
    refuse(b, m);
  b->expected = (Byte)((b->expected + 1) % SEQUENCES);
  return end;
}

static int take_hello(Board* b, const Down* m) {
  b->hello = 1;
  b->token = m->token;
  if (m->value == 0 || m->value == b->session)
    return IGNORED;
  b->session = m->value;
  if (plant != PLANT_SESSION_KEEPS_NUMBERS)
    b->expected = 0;
  b->stop_known = b->receipt = 0;
  drop_plans(b);
  happen(b, EVENT_NEW_SESSION);
  return EXECUTED;
}

static int take_stop(Board* b, const Down* m) {
  b->receipt = 1;
  if (b->stop_known && b->stop_number == m->value && b->stop_session == m->session)
    return IGNORED;
  if (plant == PLANT_STOP_NEEDS_SESSION && m->session != b->session)
    return IGNORED;
  if (plant == PLANT_STOP_KEEPS_QUEUE)
    ++b->epoch;
  else
    drop_plans(b);
  happen(b, EVENT_STOP);
  b->stop_known = 1;
  b->stop_number = m->value;
  b->stop_session = m->session;
  return EXECUTED;
}

static int board_receive(Board* b, const Down* m) {
  int which;
  if (m->kind == STOP)
    return take_stop(b, m);
  if (m->kind == HELLO)
    return take_hello(b, m);
  if (m->session != b->session)
    return IGNORED;
  if (m->kind == SETTLE) {
    for (which = 0; which < LATCHES; ++which)
      b->latch[which].recalled = b->latch[which].id != 0;
    b->pong = 1;
    b->pong_token = m->token;
    return IGNORED;
  }
  if (b->session == 0)
    return IGNORED;
  if (m->kind == ACKNOWLEDGE) {
    Latch* l = &b->latch[m->value];
    if (l->id == m->token)
      l->pending = l->repeat = 0;
    return IGNORED;
  }
  return take_command(b, m);
}

// ---- what the board does by itself ----

static void board_trip(Board* b, int retract) {
  const int second = b->mode == MODE_REFLEX;
  drop_plans(b);
  happen(b, retract ? EVENT_TRIP_RETRACT : EVENT_TRIP);
  if (!second)
    latch(b, TRIP, 0);
}

static void board_switched_off(Board* b) {
  if (b->mode == MODE_STOPPED || b->mode == MODE_FAULT)
    return;
  drop_plans(b);
  happen(b, EVENT_STOP);
}

static void board_fault(Board* b, int of_sensor) {
  drop_plans(b);
  happen(b, EVENT_FAULT);
  if (b->latch[FAULT].pending) {
    b->latch[FAULT].repeat = 1;  // it counts one more
  } else {
    latch(b, FAULT, 0);
    b->of_sensor = (Byte)of_sensor;
  }
}

static void board_tared(Board* b) {
  b->guard = GUARD_ARMED;
  play_if_ready(b);
}

static void board_tare_refused(Board* b) {
  const Down command = {GUARD, b->session, b->guard_sequence, 0, 0, 0, b->guard_command, 0};
  if (!b->latch[REFUSAL].pending)
    refuse(b, &command);
}

static void board_hold_timeout(Board* b) {
  happen(b, EVENT_HOLD_TIMEOUT);
  drop_plans(b);
}

static void board_played(Board* b) {  // one message of segments
  --b->queued;
  if (!b->queued)
    happen(b, EVENT_QUEUE_EMPTY);
}

static void board_unwound(Board* b) {
  happen(b, EVENT_UNWOUND);
  b->attached = DETACHED;
  b->queued = 0;
}

static void board_attached(Board* b) {
  b->attached = ATTACHED;
  happen(b, EVENT_ATTACHED);
}

static void board_reset(Board* b) {
  static Board fresh;
  const Board before = *b;
  int which;
  *b = fresh;
  b->sensor_bad = before.sensor_bad;
  b->switch_open = before.switch_open;
  b->of_sensor = before.of_sensor;
  for (which = 0; which < LATCHES; ++which) {
    b->latch[which] = before.latch[which];
    b->latch[which].repeat = b->latch[which].pending;
    b->latch[which].recalled = 0;
  }
  if (plant == PLANT_RESET_KEEPS_SESSION)
    b->session = before.session;
  if (b->switch_open)
    board_switched_off(b);
}
