// What survives a reset, and why the board started.
#pragma once

#include "hal/hal.h"

namespace setae {
namespace retained_memory {

// Looks at what the last run left.
void begin();
protocol::ResetCause reset_cause();
Retained& content();
// For the watchdog's handler.
void mark_stall_from_interrupt();
void clear_stall();
bool stall_marked();

}  // namespace retained_memory
}  // namespace setae
