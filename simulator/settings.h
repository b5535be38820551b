// What each part of a world needs, from the parameters by name.
#pragma once

#include <vector>

#include "bristle.h"
#include "line.h"
#include "parameters.h"
#include "plant.h"
#include "servo.h"

namespace setae {
namespace sim {

constexpr int kTendons = 4;  // of the robot: as many as its board has servos

PlantSettings plant_settings(const Parameters& p);
// The same spring between other tendons, without friction, in holes without errors; at most
// kTendonsMost.
PlantSettings with_tendons(const Parameters& p, const std::vector<double>& angles_rad);
ServoSettings servo_settings(const Parameters& p, int i);
BristleSettings bristle_settings(const Parameters& p);
LineSettings line_settings(const Parameters& p);

}  // namespace sim
}  // namespace setae
