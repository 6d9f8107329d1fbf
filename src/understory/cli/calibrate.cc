#include "understory/cli/calibrate.h"

namespace understory {

void add_calibrate_command(CLI::App& app, Command& chosen) {
  CLI::App* command = app.add_subcommand(
      "calibrate",
      "Noise of an IMU, its place on a lidar, or the clocks of lidars, from a recording");
  command->require_subcommand(1);
  add_calibrate_imu_command(*command, chosen);
  add_calibrate_lidar_imu_command(*command, chosen);
  add_calibrate_lidars_command(*command, chosen);
}

}  // namespace understory
