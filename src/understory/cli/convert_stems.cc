#include "understory/cli/convert_stems.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "understory/features/lidar_stems.h"
#include "understory/forest/inventory.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/inventory/stand_cloud.h"
#include "understory/pipeline/source.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/files/staged_output.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

bool is_cloud(const std::string& input) {
  return has_map_name(input) && fs::is_regular_file(input);
}

std::vector<Stem> stems_in_body(const std::vector<LidarStems>& lidars) {
  std::vector<Stem> stems;
  std::vector<std::size_t> first_of_lidar;
  for (const LidarStems& lidar : lidars) {
    first_of_lidar.push_back(stems.size());
    for (const StemSegment& segment : lidar.found.stems)
      stems.push_back(stem_of(segment, lidar.body_from_lidar, lidar.found.up));
  }
  drop_double_stems(first_of_lidar, stems);
  return stems;
}

int convert_cloud_to_stems(const std::string& input, const std::string& output, StagedFile& staged,
                           CommandContext& context) {
  const StandCloud stand = read_stand(input, {}, context.log, context.until_stopped());
  if (!stand.doubt.empty()) throw InputError(input, "", "expected metres and z up: " + stand.doubt);
  if (!stand.suspicion.empty()) context.log.info(stand.suspicion);
  InventoryConfig config = basic_inventory();
  config.segments = 0;
  const InventoryResult found =
      take_inventory(blocks_of(stand.cloud), config, context.until_stopped());
  if (found.stems.empty())
    throw InputError(input, "", fmt::format("no upright stems among its {} points", found.points));
  // Positions of a table of stems lie within 10 km of its zero.
  constexpr double kNear = 9000.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  if (stand.cloud.origin.cwiseAbs().maxCoeff() > kNear) {
    origin = stand.cloud.origin;
    context.log.info(fmt::format("positions are relative to {} {} {}", fixed_text(origin.x(), 3),
                                 fixed_text(origin.y(), 3), fixed_text(origin.z(), 3)));
  }
  StemsWriter writer(staged.part());
  for (const Stem& stem : stems_of(found, origin))
    writer.add(0, 0, stem);
  writer.commit();
  return commit_conversion(staged, false, output, context);
}

}  // namespace

bool is_stems_file(const std::string& output) {
  constexpr std::string_view kEnding = ".csv.gz";
  return output.size() > kEnding.size() &&
         output.compare(output.size() - kEnding.size(), kEnding.size(), kEnding) == 0;
}

int convert_to_stems(const std::string& input, const std::string& output, const OpenOptions& open,
                     bool overwrite, CommandContext& context) {
  StagedFile staged(output, overwrite);
  if (is_cloud(input)) return convert_cloud_to_stems(input, output, staged, context);
  const std::unique_ptr<Recording> recording = open_source(input, open, context.log);
  StemsWriter writer(staged.part());
  std::optional<Eigen::Vector3d> up;
  int frame = 0;
  std::size_t stems = 0;
  bool stopped = false;
  TimeNs last = 0;
  while (!stopped) {
    const std::optional<Event> event = recording->next();
    if (!event) break;
    const auto* scan = std::get_if<ScanPtr>(&*event);
    if (scan == nullptr) continue;
    stopped = context.stop_requested();
    if (frame > 0 && (*scan)->stamp <= last) continue;  // a table's times ascend
    last = (*scan)->stamp;
    const Pose& body_from_lidar = recording->rig().body_from_lidar;
    StemSegmentConfig config;
    config.up =
        up ? *up : Eigen::Vector3d(body_from_lidar.rotation().inverse() * Eigen::Vector3d::UnitZ());
    const std::vector<LidarStems> lidars = find_stems_of_lidars(**scan, recording->rig(), config);
    const std::vector<Stem> in_scan = stems_in_body(lidars);
    for (const Stem& stem : in_scan)
      writer.add(frame, last, stem);
    ++frame;
    if (!in_scan.empty()) up = up_by_stems(lidars, config.up);
    stems += in_scan.size();
    context.progress({"stems", 100.0 * recording->progress(), 100.0, "%",
                      std::to_string(in_scan.size()) + " stems"});
  }
  if (stems == 0)
    throw InputError(input, "", fmt::format("no upright stems in any of its {} scans", frame));
  writer.commit();
  return commit_conversion(staged, stopped, output, context);
}

}  // namespace understory
