#pragma once

#include "understory/cli/command.h"

namespace understory {

// `understory calibrate` has one subcommand for each thing that it finds out.
void add_calibrate_imu_command(CLI::App& calibrate, Command& chosen);
void add_calibrate_lidar_imu_command(CLI::App& calibrate, Command& chosen);
void add_calibrate_lidars_command(CLI::App& calibrate, Command& chosen);

}  // namespace understory
