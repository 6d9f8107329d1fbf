#include "understory/cli/calibrate.h"

namespace understory {

void add_calibrate_command(CLI::App& app, Command& chosen) {
  CLI::App* command = app.add_subcommand("calibrate", "Noise of an IMU from a recording of it");
  command->require_subcommand(1);
  add_calibrate_imu_command(*command, chosen);
}

}  // namespace understory
