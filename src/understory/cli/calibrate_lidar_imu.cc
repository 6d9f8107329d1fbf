#include <memory>

#include "understory/cli/calibrate.h"
#include "understory/cli/open_options.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/calibration/lidar_imu_run.h"

namespace understory {

void add_calibrate_lidar_imu_command(CLI::App& calibrate, Command& chosen) {
  CLI::App* command = calibrate.add_subcommand(
      "lidar-imu",
      "Place of an IMU on a lidar, and offset of their clocks, from a recording with "
      "motion");
  const auto request = std::make_shared<LidarImuRequest>();
  command
      ->add_option("RECORDING", request->recording,
                   "Recording of lidar and IMU with quick turns and tilting (file, folder or "
                   "sim:SITE?seed=N)")
      ->required();
  command
      ->add_option("-o,--output", request->folder,
                   "Folder for extrinsics.yaml, calibration.json and path.tum")
      ->required();
  command
      ->add_option("--path", request->path_file,
                   "Path of the lidar (TUM) by another method without this IMU, instead of mapping")
      ->check(CLI::ExistingFile);
  command->add_flag("--overwrite", request->overwrite, kOverwriteMeaning);
  add_open_options(*command, request->open);
  command->footer(
      "Walk for a minute, turn quickly, and tilt the sensor to all sides.\n\n"
      "Example:\n  understory calibrate lidar-imu walk.mcap -o rig\n"
      "  understory map plot.mcap -o plot7 --extrinsics rig/extrinsics.yaml");
  command->callback([request, &chosen] {
    chosen = [request](CommandContext& context) {
      refuse_run_over_inputs(request->folder, request->recording, request->open,
                             {request->path_file});
      return report_outcome(
          run_lidar_imu_calibration(*request, context.log, context.until_stopped()));
    };
  });
}

}  // namespace understory
