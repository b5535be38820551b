// Everything that may happen to a host, a board and the line between them, in every order.
//
// The rules are C (board.h, host.h, world.h, actions.h), so that the very same ones can be held
// against the real board. Spin explores: in each state that it reaches it takes each action.
// The blank before a parenthesis tells it that the function changes nothing.
#include "actions.def"

c_decl { \#include "actions.h" }
c_state "World world" "Global"

#define MAY(action)                                                       \
  :: d_step {                                                             \
    c_expr { may (&now.world, DO_##action) } ->                           \
    c_code { now.world = following; if (readtrail) printf(#action "\n"); };         \
    assert(c_expr { all_right (&now.world) })                             \
  }

active proctype everything() {
  c_code { start(&now.world); };
  do
  :: !c_expr { settles (&now.world) } -> assert(false)
  ACTIONS(MAY)
  od
}
