#include "understory/cli/evaluate/evaluate_crispness.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/evaluation/map_entropy.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/cloud_file.h"
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

// Into metres: the layers of a run may be in degrees or feet, another cloud may not.
PlaceChange into_metres(const std::string& run_or_cloud, const LasHeader& header) {
  if (!std::filesystem::is_directory(run_or_cloud)) {
    require_metres(header.coordinate_system, run_or_cloud);
    return {};
  }
  const auto layers = std::make_shared<LayerFrame>(read_layer_frame(run_or_cloud));
  if (layers->is_world()) return {};
  return [layers](const Eigen::Vector3d& place) { return layers->to_world(place); };
}

MapEntropy entropy_of(const std::string& run_or_cloud, const MapEntropyConfig& config, Log& log) {
  const std::unique_ptr<ByteSource> file =
      open_file(file_in_folder(run_or_cloud, "map.laz").string());
  const LasHeader header = read_las_header(*file);
  const PlaceChange change = into_metres(run_or_cloud, header);
  MapEntropyMeter meter(new_folder(), config);
  std::optional<Eigen::Vector3d> near;  // coordinates of millions of metres need doubles
  read_las_points(*file, header, log, [&](const LasPoint& point) {
    const Eigen::Vector3d place = change ? change(point.position) : point.position;
    if (!near) near = place.array().round();
    meter.add(place - *near);
  });
  return meter.measure();
}

}  // namespace

int evaluate_crispness(const std::string& run_or_cloud, const MapEntropyConfig& config, bool json,
                       CommandContext& context) {
  const MapEntropy map = entropy_of(run_or_cloud, config, context.log);
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
