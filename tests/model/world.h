// A host, a board and the line between them; what may happen; and what must not.
#pragma once

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host.h"

// How much may happen in a run.
typedef struct {
  int commands, stops, trips, faults, resets, switches;
  int hosts;      // one after the other
  int eras;       // changes of the epoch, the one at the session's start included
  int kinds;      // of commands, a bit each, from ENABLE on
  int handshake;  // 0: the session is open at the start
  int holding;    // 1: the servos are on at the start
  int late;       // 1: frames to the host may come late
} Limits;
static Limits limits = {2, 1, 0, 0, 0, 0, 1, 4, 0xFF, 0, 0, 0};

enum { DOWN_SLOTS = 2, UP_SLOTS = 1, COMMANDS_MAX = 8, HOSTS_MAX = 6 };
enum { ROUNDS = 24 };  // of a fair line, until all must have arrived

// What must not happen.
// clang-format off
#define WRONGS(X) \
  X(ALL_RIGHT) X(MOVES_WITHOUT_ENABLE) X(MOVES_THOUGH_LATCHED) X(OLD_EPOCH_QUEUED) \
  X(RESUMED_BLINDLY) X(STOP_IGNORED) X(STOP_CONFIRMED_TOO_EARLY) X(TWICE_OR_OUT_OF_ORDER) \
  X(WRONG_VERDICT) X(RECORD_LOST) X(RECORD_TWICE) X(TABLE_SAYS_NEVER) X(INCONSISTENT) \
  X(NOT_DELIVERED) X(DEAD_END)
// clang-format on
#define NAME(wrong) wrong,
enum { WRONGS(NAME) };
#undef NAME

typedef struct {
  Host host;
  Board board;
  // To the board: whatever lies here comes whenever and as often as it likes, until it is lost.
  Down down[DOWN_SLOTS];
  // To the host: in order, with losses, and one frame that comes late, as often as it likes.
  Up up[UP_SLOTS];
  Up late;
  Byte up_count;

  // How often it happened.
  Byte commands, stops, trips, faults, resets, switches, hosts;

  // The judge's.
  Byte era;  // rises with the epoch, and with a reset
  Byte latched, enabled, queue_era;
  Byte taken, taken_session;
  Byte first[HOSTS_MAX + 1];  // first command of a session
  Byte fate[COMMANDS_MAX + 1];
  Byte stop_acted;
  Byte heard[LATCHES];  // the newest id that any host was told
  Byte told[LATCHES];   // to this host, a bit each
  Byte wrong;
} World;

static void blame(World* w, int what) {
  if (!w->wrong)
    w->wrong = (Byte)what;
}

// ---------------------------------------------------------------------------- the line

// Where the host's frames are written down (walk.c).
#ifndef NOTE_SENT
#define NOTE_SENT(frame) ((void)(frame))
#endif

static void send_down(World* w, Down m) {
  int i = 0, at;
  m.session = w->host.session;
  NOTE_SENT(&m);
  while (i < DOWN_SLOTS && w->down[i].kind) {
    if (memcmp(&w->down[i], &m, sizeof m) == 0)
      return;
    ++i;
  }
  if (i == DOWN_SLOTS)
    return;  // lost
  // In one order, whichever came first: the same frames are the same line.
  for (at = i; at > 0 && memcmp(&w->down[at - 1], &m, sizeof m) > 0; --at)
    w->down[at] = w->down[at - 1];
  w->down[at] = m;
}

static void take_down(World* w, int i) {
  for (; i + 1 < DOWN_SLOTS; ++i)
    w->down[i] = w->down[i + 1];
  memset(&w->down[DOWN_SLOTS - 1], 0, sizeof w->down[0]);
}

static int send_up(World* w, int kind, int token, const Latch* record, int which) {
  const Board* b = &w->board;
  Up f = {0};
  if (w->up_count == UP_SLOTS)
    return 0;
  f.kind = (Byte)kind;
  f.session = b->session;
  f.expected = b->expected;
  f.credit = (Byte)(QUEUE_SLOTS - b->queued);
  f.epoch = b->epoch;
  f.stopped = b->mode == MODE_STOPPED || b->mode == MODE_FAULT;
  f.token = (Byte)token;
  f.era = w->era;
  f.waits = b->latch[REFUSAL].pending;
  if (record) {
    f.which = (Byte)which;
    f.id = record->id;
    f.record_session = record->session;
    f.sequence = record->sequence;
    f.refused_kind = record->kind;
    f.command = record->command;
  }
  w->up[w->up_count++] = f;
  return 1;
}

static void take_up(World* w) {
  int i;
  for (i = 0; i + 1 < UP_SLOTS; ++i)
    w->up[i] = w->up[i + 1];
  memset(&w->up[UP_SLOTS - 1], 0, sizeof w->up[0]);
  --w->up_count;
}

// What is to be sent, the urgent first; nothing overtakes what finds no room.
static void report(World* w) {
  Board* b = &w->board;
  int which;
  for (which = 0; which < LATCHES; ++which) {
    Latch* l = &b->latch[which];
    if (!l->recalled && !(l->repeat && b->session))
      continue;
    if (!send_up(w, RECORD, 0, l, which))
      return;
    l->recalled = l->repeat = 0;
  }
  if (b->telemetry) {
    if (!send_up(w, TELEMETRY, b->stop_number, 0, 0))
      return;
    b->telemetry = 0;
  }
  if (b->receipt) {
    if (!send_up(w, RECEIPT, 0, 0, 0))
      return;
    b->receipt = 0;
  }
  if (b->hello) {
    if (!send_up(w, HELLO_REPLY, b->token, 0, 0))
      return;
    b->hello = b->token = 0;
  }
  if (b->pong && send_up(w, PONG, b->pong_token, 0, 0))
    b->pong = b->pong_token = 0;
}

// --------------------------------------------------------------------------- the board

// A servo frame begins.
static void board_frame(Board* b) {
  int which;
  for (which = 0; which < LATCHES; ++which)
    if (b->latch[which].pending && plant != PLANT_RECORD_ONCE)
      b->latch[which].repeat = 1;
  b->telemetry = b->session != 0;
}

static int moves(int mode) {
  return mode == MODE_ATTACHING || mode == MODE_HOLDING || mode == MODE_PLAYING ||
         mode == MODE_UNWINDING || mode == MODE_REFLEX;
}

// After each step of the board.
static void judge_board(World* w, const Board* before) {
  Board* b = &w->board;
  int which;
  if (b->epoch != before->epoch)
    ++w->era;
  if (w->latched && moves(b->mode) && b->mode != MODE_REFLEX)
    blame(w, MOVES_THOUGH_LATCHED);
  if (moves(b->mode) && !w->enabled)
    blame(w, MOVES_WITHOUT_ENABLE);
  if (!b->queued)
    w->queue_era = 0;
  else if (w->queue_era != w->era)
    blame(w, OLD_EPOCH_QUEUED);
  if (b->never)
    blame(w, TABLE_SAYS_NEVER);
  if ((moves(b->mode) && b->mode != MODE_ATTACHING && b->attached != ATTACHED) ||
      (b->mode == MODE_RELAXED && b->attached != DETACHED) ||
      (b->guard != GUARD_OFF && b->mode != MODE_HOLDING && b->mode != MODE_PLAYING))
    blame(w, INCONSISTENT);
  for (which = 0; which < LATCHES; ++which) {
    const Latch* l = &b->latch[which];
    if (l->id && !l->pending && w->heard[which] < l->id)
      blame(w, RECORD_LOST);
    if (l->id > 1 && w->heard[which] + 1 < l->id)
      blame(w, RECORD_LOST);  // overwritten before anybody had it
  }
  if (b->attached == DETACHED)
    w->enabled = 0;
  report(w);
}

static void judge_command(World* w, const Down* m, int end) {
  if (end == IGNORED || end == NOT_TAKEN)
    return;
  if (m->command != (w->taken_session == m->session ? w->taken + 1 : w->first[m->session]) ||
      w->fate[m->command])
    blame(w, TWICE_OR_OUT_OF_ORDER);
  w->taken = m->command;
  w->taken_session = m->session;
  w->fate[m->command] = (Byte)end;
  if (end != EXECUTED)
    return;
  if (m->kind == ENABLE)
    w->enabled = 1;
  if (m->kind == SEGMENTS)
    w->queue_era = m->era;
  if (m->kind == RESUME) {
    if (m->era != w->era)
      blame(w, RESUMED_BLINDLY);
    w->latched = 0;
  }
}

static void judge_stop(World* w, const Down* m, int end) {
  const Board* b = &w->board;
  if (end == EXECUTED)
    w->latched = 1;
  else if (m->command > w->stop_acted)
    blame(w, STOP_IGNORED);
  if (end == EXECUTED &&
      ((b->mode != MODE_STOPPED && b->mode != MODE_FAULT) || b->queued || b->guard))
    blame(w, STOP_IGNORED);
  if (m->command > w->stop_acted)
    w->stop_acted = m->command;
}

static void board_takes(World* w, const Down* m) {
  const Board before = w->board;
  const int end = board_receive(&w->board, m);
  if (m->kind == STOP)
    judge_stop(w, m, end);
  else if (is_command(m->kind))
    judge_command(w, m, end);
  judge_board(w, &before);
}

// ---------------------------------------------------------------------------- the host

static void send_hello(World* w, int new_session) {
  Host* h = &w->host;
  Down m = {HELLO, 0, 0, 0, 0, 0, 0, 0};
  if (!h->token)
    h->token = (Byte)(h->run * 4 + h->phase + 1);
  m.value = (Byte)new_session;
  m.token = h->token;
  send_down(w, m);
}

static void send_settle(World* w) {
  const Down m = {SETTLE, 0, 0, 0, 0, w->host.run, 0, 0};
  send_down(w, m);
}

static void send_ticket(World* w, const Ticket* t) {
  const Down m = {t->kind, 0, t->sequence, t->epoch, 0, 0, t->command, t->era};
  send_down(w, m);
}

static void send_stop(World* w) {
  const Host* h = &w->host;
  const Down m = {STOP, 0, 0, 0, h->stop_number, 0, h->stop_user, 0};
  send_down(w, m);
}

static void next_host(World* w) {
  ++w->hosts;
  host_start(&w->host, w->hosts, w->hosts);
  memset(w->told, 0, sizeof w->told);
  send_hello(w, 0);
}

static void host_on_hello(World* w, const Up* f) {
  Host* h = &w->host;
  if (in_session(h) && f->session == h->session)
    return;
  if (f->token != h->token || !h->token)
    return;
  if (h->phase == ASKING) {
    h->session = h->wanted;
    h->phase = OPENING;
    h->token = 0;
    send_hello(w, h->session);
  } else if (h->phase == OPENING && f->session == h->session) {
    h->phase = SETTLING;
    h->token = 0;
    h->epoch = f->epoch;
    h->era = f->era;
    h->credit = f->credit;
    send_settle(w);
  } else if (in_session(h)) {
    h->phase = FAILED;
  }
}

static void host_tells(World* w, const Up* f) {
  const Down ack = {ACKNOWLEDGE, 0, 0, 0, f->which, f->id, 0, 0};
  const Ticket* t;
  send_down(w, ack);
  if (host_knows(&w->host, f))
    return;
  if (w->told[f->which] >> f->id & 1)
    blame(w, RECORD_TWICE);
  w->told[f->which] |= (Byte)(1 << f->id);
  if (w->heard[f->which] < f->id)
    w->heard[f->which] = f->id;
  t = host_on_record(&w->host, f);
  if (f->which != REFUSAL || host_takes_as_earlier(&w->host, f))
    return;
  if (t ? t->command != f->command : f->refused_kind != GUARD)
    blame(w, WRONG_VERDICT);
}

static void judge_verdicts(World* w, const Host* before) {
  int i;
  for (i = 0; i < REMEMBERED; ++i) {
    const Ticket* t = &w->host.recent[i];
    const int fate = w->fate[t->command];
    const int dropped = t->done == DISCARDED && fate == EXECUTED && has_epoch(t->kind);
    // A tare may end a guard as refused after it was taken.
    if (t->done && t->done != before->recent[i].done && t->done != fate && !dropped &&
        t->kind != GUARD)
      blame(w, WRONG_VERDICT);
  }
  if (before->stop_under_way && !w->host.stop_under_way && w->host.phase != FAILED &&
      w->stop_acted < w->host.stop_user)
    blame(w, STOP_CONFIRMED_TOO_EARLY);
}

static void host_takes(World* w, const Up* f, int fresh) {
  Host* h = &w->host;
  const Host before = *h;
  if (h->phase == FAILED)
    return;
  if (f->kind == HELLO_REPLY) {
    host_on_hello(w, f);
  } else if (!in_session(h)) {
    if (f->kind == RECEIPT && f->stopped)
      h->stop_under_way = 0;
  } else if (f->session != h->session) {
    send_hello(w, 0);
  } else {
    if (fresh)
      host_on_header(h, f);
    if (f->kind == TELEMETRY && fresh)
      host_on_telemetry(h, f);
    if (f->kind == RECORD)
      host_tells(w, f);
    if (f->kind == PONG && f->token == h->run)
      h->settled = 1;
    if (h->phase == SETTLING && h->settled && h->heard_telemetry)
      h->phase = OPEN;
  }
  judge_verdicts(w, &before);
}

static int host_commands(World* w, int kind) {
  Host* h = &w->host;
  Ticket t = {0};
  int i;
  if (w->commands == COMMANDS_MAX || !host_has_room(h))
    return 0;
  if (has_epoch(kind) && h->stop_under_way)
    return 0;  // discarded at once
  if ((kind == SEGMENTS || kind == SEGMENTS_BAD) && h->credit <= segments_in_flight(h))
    return 0;  // waits for room
  t.kind = (Byte)kind;
  t.sequence = h->next_sequence;
  t.epoch = has_epoch(kind) || kind == RESUME ? h->epoch : 0;
  t.era = has_epoch(kind) || kind == RESUME ? h->era : 0;
  t.command = ++w->commands;
  if (!w->first[h->session])
    w->first[h->session] = t.command;
  h->next_sequence = (Byte)((h->next_sequence + 1) % SEQUENCES);
  for (i = 0; i + 1 < REMEMBERED; ++i)
    h->recent[i] = h->recent[i + 1];
  h->recent[REMEMBERED - 1] = t;
  send_ticket(w, &t);
  return 1;
}

static int host_stops(World* w) {
  Host* h = &w->host;
  if (w->stops == limits.stops || h->phase == FAILED)
    return 0;
  h->stop_user = ++w->stops;
  h->stop_under_way = 1;
  new_stop_number(h);
  send_stop(w);
  return 1;
}

static int host_sends_again(World* w) {
  int i;
  if (plant == PLANT_NEVER_SENT_AGAIN || w->host.phase != OPEN || !in_flight(&w->host))
    return 0;
  for (i = 0; i < REMEMBERED; ++i)
    if (w->host.recent[i].kind && !w->host.recent[i].acked)
      send_ticket(w, &w->host.recent[i]);
  return 1;
}

static int host_stops_again(World* w) {
  Host* h = &w->host;
  if (!h->stop_under_way || h->phase == FAILED)
    return 0;
  if (!h->stop_shown_known)
    new_stop_number(h);
  send_stop(w);
  return 1;
}

static int host_asks_again(World* w) {
  const Host* h = &w->host;
  if (h->phase == ASKING || h->phase == OPENING) {
    send_hello(w, h->phase == ASKING ? 0 : h->session);
    return 1;
  }
  if (h->phase == SETTLING)
    send_settle(w);
  // Silence; where the session lives, the answer changes nothing.
  if (in_session(h) && w->board.session != h->session)
    send_hello(w, 0);
  else
    return h->phase == SETTLING;
  return 1;
}
