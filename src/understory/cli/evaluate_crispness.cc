#include "understory/cli/evaluate_crispness.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/evaluation/map_entropy.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/las.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"

namespace understory {
namespace {

// A folder of its own for the tiles, where the system keeps temporary files.
std::filesystem::path new_folder() {
  std::error_code error;
  std::string name = (std::filesystem::temp_directory_path(error) / "understory-XXXXXX").string();
  if (error || mkdtemp(name.data()) == nullptr)
    throw OutputError(name, "no folder for temporary files (TMPDIR)");
  return name;
}

MapEntropy entropy_of(const std::filesystem::path& cloud, const MapEntropyConfig& config,
                      Log& log) {
  const std::unique_ptr<ByteSource> file = open_file(cloud.string());
  MapEntropyMeter meter(new_folder(), config);
  std::optional<Eigen::Vector3d> near;  // coordinates of millions of metres need doubles
  read_las_points(*file, read_las_header(*file), log, [&](const LasPoint& point) {
    if (!near) near = point.position.array().round();
    meter.add(point.position - *near);
  });
  return meter.measure();
}

}  // namespace

int evaluate_crispness(const std::string& run_or_cloud, const MapEntropyConfig& config, bool json,
                       CommandContext& context) {
  const MapEntropy map = entropy_of(file_in_folder(run_or_cloud, "map.laz"), config, context.log);
  if (map.points_used == 0)
    throw InputError(run_or_cloud, "",
                     fmt::format("expected points with {} neighbours within {} m",
                                 config.fewest_neighbours, config.radius_m));
  const double thickness_m = std::sqrt(map.mean_plane_variance_m2);
  const nlohmann::ordered_json object = {{"points", map.points},
                                         {"points_used", map.points_used},
                                         {"radius_m", config.radius_m},
                                         {"thin_m", config.thin_m},
                                         {"mean_entropy_nats", map.mean_entropy_nats},
                                         {"thickness_rms_m", thickness_m}};
  const std::string text =
      json ? object.dump(2) + "\n"
           : fmt::format(
                 "points              {}, {} with neighbours enough within {} m\n"
                 "mean map entropy    {:.4f} nats\n"
                 "thickness           {:.4f} m, root mean square over the points\n",
                 map.points, map.points_used, config.radius_m, map.mean_entropy_nats, thickness_m);
  std::fputs(text.c_str(), stdout);
  return kExitDone;
}

}  // namespace understory
