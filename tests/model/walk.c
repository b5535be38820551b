// Writes down what the model's host does, for the real one to do the same (test_host.py).
//
// Breadth first through a scope, over all that may happen to a host, a board and the line. What the
// host does or hears in a state in which it did so before says nothing new; every other event is a
// line, numbered from 0:
//
//   the event before it, what happened ; the frame that was heard ; the frames that were sent ;
//   how the host is now ; its commands
//
// Run as `walk COUNT`, with SETAE_MODEL as in actions.h; COUNT is of the states of all three.
static void note_sent(const void* frame);
#define NOTE_SENT(frame) note_sent(frame)
#include "actions.h"

enum { SENT_MAX = 4 };
static Down sent[SENT_MAX];
static int sent_count;

static void note_sent(const void* frame) {
  sent[sent_count++] = *(const Down*)frame;
}

// ---- a set of things, by their bytes ----

typedef struct {
  unsigned char* bytes;
  int* slots;
  int size, count, capacity;  // of a thing, then of things
} Set;

static void make_set(Set* s, int size, int capacity) {
  s->bytes = malloc((size_t)size * (size_t)capacity);
  s->slots = calloc(2 * (size_t)capacity, sizeof(int));
  s->size = size;
  s->count = 0;
  s->capacity = capacity;
  if (!s->bytes || !s->slots)
    exit(3);
}

// Its place; one that is new has the last. -1 where the set is full.
static int place_of(Set* s, const void* thing) {
  const unsigned char* bytes = thing;
  const unsigned slots = 2u * (unsigned)s->capacity;
  unsigned hash = 2166136261u, at;
  int i;
  for (i = 0; i < s->size; ++i)
    hash = (hash ^ bytes[i]) * 16777619u;
  for (at = hash % slots; s->slots[at]; at = (at + 1) % slots) {
    if (!memcmp(s->bytes + (size_t)(s->slots[at] - 1) * s->size, thing, s->size))
      return s->slots[at] - 1;
  }
  if (s->count == s->capacity)
    return -1;
  memcpy(s->bytes + (size_t)s->count * s->size, thing, s->size);
  s->slots[at] = ++s->count;
  return s->count - 1;
}

// ---- what the host does and hears ----

typedef struct {
  Host host;
  Byte action;
  Up heard;
} Event;

static Set states, events;
static int* last;  // for each state: the event with which the host got to where it is

static int of_host(int action) {
  return action <= DO_host_is_replaced || action == DO_line_delivers_up ||
         action == DO_line_delivers_late;
}

#define NAME(action) #action,
static const char* const kNames[] = {ACTIONS(NAME)};
#undef NAME

static void print_numbers(const void* bytes, int count) {
  int i;
  for (i = 0; i < count; ++i)
    printf("%d ", ((const Byte*)bytes)[i]);
}

static void print_event(int before, const Event* event, const World* to) {
  const Host* h = &to->host;
  const Up* f = &event->heard;
  int i;
  printf("%d %s ; ", before, kNames[event->action]);
  print_numbers(&event->heard, sizeof event->heard);
  printf("%d %d ; ", host_takes_as_earlier(&event->host, f),
         f->kind == RECORD && in_session(&event->host) && f->session == event->host.session &&
             !host_knows(&event->host, f));
  for (i = 0; i < sent_count; ++i)
    print_numbers(&sent[i], sizeof sent[i]);
  printf("; %d %d %d %d %d %d %d %d ; ", h->phase, h->session, h->epoch,
         h->credit - segments_in_flight(h), h->stop_under_way, h->stop_number, h->stop_shown_known,
         h->stop_shown);
  for (i = 0; i < REMEMBERED; ++i)
    printf("%d %d %d ", h->recent[i].kind, h->recent[i].command, h->recent[i].done);
  printf("\n");
}

// What `action` makes of the state at `from` is now `following`; `from` may move meanwhile.
static int note(int from, const World* before, int action) {
  Event event;
  int event_place = last[from], known = events.count, place;
  if (of_host(action)) {
    memset(&event, 0, sizeof event);
    event.host = before->host;
    event.action = (Byte)action;
    if (action == DO_line_delivers_up)
      event.heard = before->up[0];
    if (action == DO_line_delivers_late)
      event.heard = before->late;
    event_place = place_of(&events, &event);
    if (event_place == known)
      print_event(last[from], &event, &following);
  }
  known = states.count;
  place = place_of(&states, &following);
  if (place == known)
    last[place] = event_place;
  return place;
}

// From `from` on nothing is lost: the next state, or the same where `action` can't happen now.
static int go(int from, int action) {
  const World before = ((const World*)states.bytes)[from];
  following = before;
  sent_count = 0;
  if (!act(&following, action))
    return from;
  forget(&following);
  return note(from, &before, action);
}

static const World* state(int place) {
  return (const World*)states.bytes + place;
}

// A round trip.
static int go_round(int at) {
  int action;
  at = go(at, DO_host_asks_again);
  while (state(at)->down[0].kind) {
    at = go(at, DO_line_delivers_0);
    at = go(at, DO_line_loses_0);
    while (state(at)->up_count)
      at = go(at, DO_line_delivers_up);
  }
  for (action = DO_board_attached; action <= DO_board_unwound; ++action)
    at = go(at, action);
  at = go(at, DO_board_begins_frame);
  while (state(at)->up_count)
    at = go(at, DO_line_delivers_up);
  return at;
}

int main(int count, char** words) {
  const int most = count > 1 ? atoi(words[1]) : 1000;
  World first;
  int at, from, action;
  make_set(&states, sizeof(World), most);
  make_set(&events, sizeof(Event), most * ACTION_COUNT);
  last = calloc((size_t)most, sizeof(int));
  read_scope();
  memset(&first, 0, sizeof first);
  last[place_of(&states, &first)] = -1;
  at = go(0, DO_host_is_replaced);
  while (!limits.handshake && !settled(state(at)))
    at = go_round(at);
  if (limits.holding)
    at = go(at, DO_user_enables);
  while (limits.holding && !(settled(state(at)) && state(at)->board.mode == MODE_HOLDING))
    at = go_round(at);
  for (from = limits.handshake ? 1 : at; from < states.count; ++from) {
    for (action = 0; action < ACTION_COUNT; ++action) {
      const World before = *state(from);
      sent_count = 0;
      if (may(&before, action))
        note(from, &before, action);
    }
  }
  return 0;
}
