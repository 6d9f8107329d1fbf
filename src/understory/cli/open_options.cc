#include "understory/cli/open_options.h"

#include "understory/pipeline/source.h"
#include "understory/util/files/output_guard.h"

namespace understory {

void add_open_options(CLI::App& command, OpenOptions& options) {
  command.add_option("--rate-hz", options.rate_hz, "Scans per second of a folder of clouds")
      ->check(CLI::Range(0.01, 1000.0));
  command.add_option("--metadata", options.metadata_file,
                     "Metadata JSON of an Ouster, or angle correction CSV of a Hesai");
  command.add_option("--lidar-topic", options.lidar_topic,
                     "Topic of the lidar, if there are more; A,B: several in one scan");
  command.add_option("--imu-topic", options.imu_topic, "Topic of the IMU, if there are more");
  command.add_option("--gnss-topic", options.gnss_topic, "Topic of the GNSS, if there are more");
  command.add_option("--extrinsics", options.extrinsics_file,
                     "YAML with body_from_lidar (or a list lidars), body_from_imu, body_from_gnss, "
                     "body_from_second_gnss");
}

void refuse_run_over_inputs(const std::filesystem::path& run_folder, const std::string& recording,
                            const OpenOptions& options, const std::vector<std::string>& more) {
  std::vector<std::filesystem::path> inputs = files_of(recording, options);
  inputs.insert(inputs.end(), more.begin(), more.end());
  refuse_input_as_output(run_folder, inputs);
}

}  // namespace understory
