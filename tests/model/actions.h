// What may happen next, one action at a time; and whether all arrives once the line is fair.
#pragma once

#include "actions.def"
#include "world.h"

#define NAME(action) DO_##action,
enum { ACTIONS(NAME) ACTION_COUNT };
#undef NAME

// Not so old that the number means another command again.
static int young_enough(const World* w, const Down* m) {
  return !is_command(m->kind) || m->session != w->taken_session ||
         w->taken - m->command + 1 < SEQUENCES;
}

static int line_delivers(World* w, int i) {
  if (i >= DOWN_SLOTS || !w->down[i].kind || !young_enough(w, &w->down[i]))
    return 0;
  board_takes(w, &w->down[i]);
  return 1;
}

static int line_loses(World* w, int i) {
  if (i >= DOWN_SLOTS || !w->down[i].kind)
    return 0;
  take_down(w, i);
  return 1;
}

static int up_goes(World* w, int action) {
  const Up f = w->up[0];
  if (w->up_count == 0)
    return 0;
  if (action == DO_line_delays_up) {
    // Late, a frame's header says nothing any more.
    if (!limits.late || (f.kind != RECORD && f.kind != PONG && f.kind != HELLO_REPLY))
      return 0;
    w->late = f;
  }
  take_up(w);
  if (action == DO_line_delivers_up)
    host_takes(w, &f, 1);
  report(w);
  return 1;
}

static int board_alone(World* w, int action) {
  Board* b = &w->board;
  const Board before = *b;
  switch (action) {
    case DO_board_attached:
      if (b->mode != MODE_ATTACHING)
        return 0;
      board_attached(b);
      break;
    case DO_board_played:
      if (b->mode != MODE_PLAYING)
        return 0;
      board_played(b);
      break;
    case DO_board_unwound:
      if (b->mode != MODE_UNWINDING)
        return 0;
      board_unwound(b);
      break;
    case DO_board_held_too_long:
      if (b->mode != MODE_HOLDING)
        return 0;
      board_hold_timeout(b);
      break;
    case DO_board_tared:
      if (b->guard != GUARD_TARING)
        return 0;
      board_tared(b);
      break;
    case DO_board_could_not_tare:
      if (b->guard != GUARD_TARING || b->latch[REFUSAL].pending)
        return 0;
      w->fate[b->guard_command] = REFUSED;
      board_tare_refused(b);
      break;
    case DO_board_trips:
      if (w->trips == limits.trips || b->mode == MODE_RELAXED || b->mode == MODE_STOPPED ||
          b->mode == MODE_TRIPPED || b->mode == MODE_FAULT ||
          (b->mode == MODE_HOLDING && b->guard != GUARD_ARMED))
        return 0;
      ++w->trips;
      board_trip(b, 0);
      w->latched = 1;
      break;
    case DO_board_trips_and_retracts:
      if (w->trips == limits.trips || b->guard != GUARD_ARMED)
        return 0;
      ++w->trips;
      board_trip(b, 1);
      w->latched = 1;
      break;
    case DO_board_retracted:
      if (b->mode != MODE_REFLEX)
        return 0;
      happen(b, EVENT_REFLEX_DONE);
      break;
    case DO_board_faults:
      if (w->faults == limits.faults)
        return 0;
      ++w->faults;
      b->sensor_bad |= b->guard == GUARD_ARMED;
      board_fault(b, b->guard == GUARD_ARMED);
      w->latched = 1;
      break;
    case DO_sensor_recovers:
      if (!b->sensor_bad)
        return 0;
      b->sensor_bad = 0;
      break;
    case DO_board_is_switched_off:
      if (w->switches == limits.switches || b->switch_open)
        return 0;
      ++w->switches;
      b->switch_open = 1;
      board_switched_off(b);
      w->latched = 1;
      break;
    case DO_board_is_switched_on:
      if (!b->switch_open)
        return 0;
      b->switch_open = 0;
      break;
    case DO_board_resets:
      if (w->resets == limits.resets)
        return 0;
      ++w->resets;
      board_reset(b);
      ++w->era;
      w->enabled = 0;
      w->latched = b->switch_open;
      memset(w->down, 0, sizeof w->down);  // a board that starts is deaf
      break;
    default:
      if (b->telemetry)
        return 0;  // the last frame's has not found room yet
      board_frame(b);
      break;
  }
  if (action == DO_board_resets)
    report(w);
  else
    judge_board(w, &before);
  return 1;
}

// Does it. False, and nothing is changed, where it can't happen now.
static int act(World* w, int action) {
  switch (action) {
    case DO_user_stops:
      return host_stops(w);
    case DO_host_sends_again:
      return host_sends_again(w);
    case DO_host_stops_again:
      return host_stops_again(w);
    case DO_host_asks_again:
      return host_asks_again(w);
    case DO_host_is_replaced:
      if (w->hosts == limits.hosts)
        return 0;
      next_host(w);
      return 1;
    case DO_line_delivers_0:
    case DO_line_delivers_1:
    case DO_line_delivers_2:
      return line_delivers(w, action - DO_line_delivers_0);
    case DO_line_loses_0:
    case DO_line_loses_1:
    case DO_line_loses_2:
      return line_loses(w, action - DO_line_loses_0);
    case DO_line_delivers_up:
    case DO_line_loses_up:
    case DO_line_delays_up:
      return up_goes(w, action);
    case DO_line_delivers_late:
      if (!w->late.kind)
        return 0;
      host_takes(w, &w->late, 0);
      return 1;
    default:
      return action <= DO_user_sends_bad_segments ? host_commands(w, ENABLE + action)
                                                  : board_alone(w, action);
  }
}

// What can't matter any more is forgotten, so that states that differ in nothing else are one.
static void forget(World* w) {
  int i;
  for (i = 0; i < REMEMBERED; ++i) {
    Ticket* t = &w->host.recent[i];
    if (t->acked)
      t->epoch = t->era = 0;
    if (t->done)
      t->end = 0;
  }
  if (w->board.guard == GUARD_OFF)
    w->board.guard_sequence = w->board.guard_command = 0;
  if (w->late.kind == RECORD || w->late.kind == PONG)
    w->late.expected = w->late.credit = w->late.epoch = w->late.stopped = w->late.waits =
        w->late.era = 0;
}

static World following;

__attribute__((noinline)) static int may(const World* w, int action) {
  following = *w;
  if (action <= DO_user_sends_bad_segments &&
      (w->commands >= limits.commands || !(limits.kinds >> action & 1)))
    return 0;
  if (!act(&following, action) || following.era > limits.eras)
    return 0;
  forget(&following);
  return 1;
}

// ---- a fair line from here on ----

static int settled(const World* w) {
  const Host* h = &w->host;
  int i;
  if (h->phase != OPEN || h->stop_under_way || w->up_count || w->down[0].kind)
    return 0;
  for (i = 0; i < REMEMBERED; ++i)
    if (h->recent[i].kind && !h->recent[i].done)
      return 0;
  for (i = 0; i < LATCHES; ++i)
    if (w->board.latch[i].pending)
      return 0;
  return 1;
}

// One round trip: nothing is lost, time passes on both sides.
static void fair_round(World* w) {
  static const Byte alone[] = {DO_board_attached,       DO_board_tared,       DO_board_played,
                               DO_board_unwound,        DO_board_retracted,   DO_sensor_recovers,
                               DO_board_is_switched_on, DO_board_begins_frame};
  unsigned i;
  if (w->host.phase == FAILED)
    next_host(w);
  act(w, DO_host_sends_again);
  act(w, DO_host_stops_again);
  act(w, DO_host_asks_again);
  while (w->down[0].kind) {
    if (young_enough(w, &w->down[0])) {
      const Down m = w->down[0];
      take_down(w, 0);
      board_takes(w, &m);
    } else {
      take_down(w, 0);
    }
    while (w->up_count)
      act(w, DO_line_delivers_up);
  }
  for (i = 0; i < sizeof alone; ++i)
    act(w, alone[i]);
  while (w->up_count)
    act(w, DO_line_delivers_up);
}

__attribute__((noinline)) static int all_right(const World* w) {
#define NAME(wrong) #wrong,
  static const char* const kNames[] = {WRONGS(NAME)};
#undef NAME
  if (w->wrong)
    printf("wrong: %s\n", kNames[w->wrong]);
  return !w->wrong;
}

static void settle(World* w) {
  int round;
  for (round = 0; round < ROUNDS && !settled(w) && !w->wrong; ++round)
    fair_round(w);
  if (!settled(w))
    blame(w, NOT_DELIVERED);
}

// From here on: does all arrive, and nothing go wrong?
__attribute__((noinline)) static int settles(const World* w) {
  World fair = *w;
  memset(&fair.late, 0, sizeof fair.late);
  settle(&fair);
  // And no state is a dead end.
  if (!fair.wrong && fair.latched) {
    fair_round(&fair);  // the host sees the epoch
    act(&fair, DO_user_resumes);
    settle(&fair);
    if (fair.latched)
      blame(&fair, DEAD_END);
  }
  return all_right(&fair);
}

// What the environment asks for: SETAE_MODEL holds the plant and the limits, in their order.
static void read_scope(void) {
  const char* text = getenv("SETAE_MODEL");
  int* const values[] = {&plant,         &limits.commands, &limits.stops,     &limits.trips,
                         &limits.faults, &limits.resets,   &limits.switches,  &limits.hosts,
                         &limits.eras,   &limits.kinds,    &limits.handshake, &limits.holding,
                         &limits.late};
  unsigned i;
  for (i = 0; text && i < sizeof values / sizeof values[0]; ++i) {
    char* end;
    *values[i] = (int)strtol(text, &end, 10);
    text = end;
  }
}

static void start(World* w) {
  read_scope();
  memset(w, 0, sizeof *w);
  next_host(w);
  while (!limits.handshake && !settled(w))
    fair_round(w);
  if (limits.holding)
    act(w, DO_user_enables);
  while (limits.holding && !(settled(w) && w->board.mode == MODE_HOLDING))
    fair_round(w);
  memset(&w->down, 0, sizeof w->down);
}
