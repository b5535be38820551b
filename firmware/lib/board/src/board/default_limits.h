// The limits of the robot in robots/paper.toml, in force until the host sets others.
#pragma once

#include "protocol/messages.h"

namespace setae {

constexpr protocol::SetLimits kDefaultLimits = {
    {1660, 1660, 1660, 1660},  // pulse_min_ticks
    {4029, 4029, 4029, 4029},  // pulse_max_ticks
    116,                       // slew_ticks
    {3319, 3319},              // pair_sum_min_ticks
    {7220, 7220},              // pair_sum_max_ticks
    {-985, -985},              // pair_difference_min_ticks
    {985, 985},                // pair_difference_max_ticks
    245760,                    // coarse_threshold_raw
    0,                         // hold_timeout_s
};

}  // namespace setae
