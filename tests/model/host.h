// The host's rules without time: what setae.link.engine and its parts do. Where they wait, here
// anything may happen first.
#pragma once

#include "board.h"

enum { ASKING, OPENING, SETTLING, OPEN, FAILED };  // phases
enum { REMEMBERED = 3 };                           // tickets that a refusal may still name

// From the board. `waits`: a refusal waits to be acknowledged.
typedef struct {
  Byte kind, session, expected, credit, epoch, stopped, waits;
  Byte token;  // or stop number
  Byte which, id, record_session, sequence, refused_kind;
  Byte command, era;  // the judge's
} Up;

typedef struct {
  Byte kind, sequence, epoch, command, era;
  Byte acked;  // the board has taken it
  Byte end;    // what it will count as
  Byte done;
} Ticket;

typedef struct {
  Byte phase, run, session, wanted;
  Byte epoch, era, credit;
  Byte token;  // of the hello under way; 0: none
  Byte settled, heard_telemetry;
  Byte next_sequence;
  Byte stop_under_way, stop_number, stop_shown_known, stop_shown, stop_user;
  Byte seen[LATCHES];         // ids that were told, a bit each
  Ticket recent[REMEMBERED];  // oldest first; kind 0: none
} Host;

static int is_command(int kind) {
  return kind >= ENABLE && kind < COMMANDS_END;
}

static int in_session(const Host* h) {
  return h->phase == SETTLING || h->phase == OPEN;
}

static int in_flight(const Host* h) {
  int count = 0, i;
  for (i = 0; i < REMEMBERED; ++i)
    count += h->recent[i].kind && !h->recent[i].acked;
  return count;
}

static int segments_in_flight(const Host* h) {
  int count = 0, i;
  for (i = 0; i < REMEMBERED; ++i) {
    const Ticket* t = &h->recent[i];
    count += (t->kind == SEGMENTS || t->kind == SEGMENTS_BAD) && !t->acked;
  }
  return count;
}

static int has_epoch(int kind) {
  return kind == SEGMENTS || kind == SEGMENTS_BAD || kind == GUARD;
}

// The session's number may be the board's: then another is taken.
static void host_start(Host* h, int run, int session) {
  static const Host kNew;
  *h = kNew;
  h->phase = ASKING;
  h->run = (Byte)run;
  h->wanted = (Byte)session;
}

static void new_stop_number(Host* h) {
  if (plant == PLANT_SAME_STOP && h->stop_number)
    return;
  h->stop_number = (Byte)((h->stop_number + 1) % STOP_NUMBERS);
  if (h->stop_shown_known && h->stop_number == h->stop_shown)
    h->stop_number = (Byte)((h->stop_number + 1) % STOP_NUMBERS);
}

// The oldest ticket makes room. False while it is not settled.
static int host_has_room(const Host* h) {
  return h->phase == OPEN && in_flight(h) < WINDOW && (!h->recent[0].kind || h->recent[0].done);
}

static void host_on_acknowledgement(Host* h, const Up* f) {
  int i, confirmed, first = 0;
  while (first < REMEMBERED && (!h->recent[first].kind || h->recent[first].acked))
    ++first;
  if (first == REMEMBERED)
    return;
  confirmed = (f->expected - h->recent[first].sequence + SEQUENCES) % SEQUENCES;
  if (confirmed > in_flight(h))
    return;
  for (i = first; i < first + confirmed; ++i) {
    Ticket* t = &h->recent[i];
    t->acked = 1;
    t->end = has_epoch(t->kind) && t->epoch != f->epoch ? DISCARDED : EXECUTED;
  }
}

static void host_on_header(Host* h, const Up* f) {
  int i;
  h->epoch = f->epoch;
  h->era = f->era;
  h->credit = f->credit;
  host_on_acknowledgement(h, f);
  // Where no refusal waits, none names what was acknowledged.
  for (i = 0; i < REMEMBERED; ++i) {
    Ticket* t = &h->recent[i];
    if (t->acked && !t->done && (!f->waits || plant == PLANT_RECEIPT_TRUSTED))
      t->done = t->end;
  }
}

static void host_on_telemetry(Host* h, const Up* f) {
  h->heard_telemetry = 1;
  if (h->stop_under_way && (f->token == h->stop_number || plant == PLANT_STOP_TRUSTED)) {
    if (!h->stop_shown_known)
      new_stop_number(h);
    else
      h->stop_under_way = 0;
  }
  h->stop_shown_known = 1;
  h->stop_shown = f->token;
}

static int host_knows(const Host* h, const Up* f) {
  return plant != PLANT_TOLD_TWICE && h->seen[f->which] >> f->id & 1;
}

static int host_takes_as_earlier(const Host* h, const Up* f) {
  return h->phase == SETTLING || f->record_session != h->session;
}

// A record that was not known. Returns the ticket that a refusal names, or null.
static Ticket* host_on_record(Host* h, const Up* f) {
  int i;
  h->seen[f->which] |= (Byte)(1 << f->id);
  if (f->which != REFUSAL || host_takes_as_earlier(h, f))
    return 0;
  for (i = REMEMBERED - 1; i >= 0; --i) {
    Ticket* t = &h->recent[i];
    if (t->kind == f->refused_kind && t->sequence == f->sequence) {
      t->done = REFUSED;
      return t;
    }
  }
  return 0;
}
