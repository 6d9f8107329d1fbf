#include <memory>

#include "understory/cli/calibrate.h"
#include "understory/cli/open_options.h"
#include "understory/cli/outcome.h"
#include "understory/pipeline/calibration/lidar_clocks_run.h"

namespace understory {

void add_calibrate_lidars_command(CLI::App& calibrate, Command& chosen) {
  CLI::App* command = calibrate.add_subcommand(
      "lidars", "How late the clock of each of several lidars is, from a recording with an IMU");
  const auto request = std::make_shared<LidarClocksRequest>();
  command
      ->add_option("RECORDING", request->recording,
                   "Recording of the lidars and an IMU, with turns or tilting (file, folder or "
                   "sim:SITE?seed=N)")
      ->required();
  command
      ->add_option("-o,--output", request->folder, "Folder for extrinsics.yaml, calibration.json")
      ->required();
  command->add_flag("--overwrite", request->overwrite, kOverwriteMeaning);
  add_open_options(*command, request->open);
  command->footer(
      "Drive for a minute over rough ground, with turns.\n\n"
      "Example:\n  understory calibrate lidars drive.mcap --lidar-topic /front,/rear -o rig\n"
      "  understory map drive.mcap -o stand4 --extrinsics rig/extrinsics.yaml");
  command->callback([request, &chosen] {
    chosen = [request](CommandContext& context) {
      refuse_run_over_inputs(request->folder, request->recording, request->open, {});
      return report_outcome(run_lidar_clocks(*request, context.log, context.until_stopped()));
    };
  });
}

}  // namespace understory
