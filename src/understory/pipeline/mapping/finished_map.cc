#include "understory/pipeline/mapping/finished_map.h"

#include <optional>

#include "understory/util/error.h"

namespace understory {

std::unique_ptr<MapTiles> make_finished_map(const KeyframeClouds& clouds,
                                            const std::vector<Keyframe>& keyframes,
                                            MapTiles::Config config,
                                            const std::filesystem::path& folder,
                                            LeftOutCarrier& carrier, const ProgressSink& progress) {
  config.on_grid = true;
  auto tiles = std::make_unique<MapTiles>(folder, config);
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    const KeyframeCloud cloud = clouds.read(i);
    const auto keyframe = static_cast<std::size_t>(cloud.id);
    UNDERSTORY_CHECK(keyframe < keyframes.size());
    const Pose world_from_body = keyframes[keyframe].world_from_body * cloud.keyframe_from_body;
    std::optional<PlacesAsMeasured> as_measured;
    if (!carrier.region.empty()) as_measured.emplace(cloud, carrier.path);
    carrier.of += cloud.points.size();
    for (const KeyframePoint& p : cloud.points) {
      if (as_measured && carrier.region.holds((*as_measured)(p))) {
        ++carrier.points;
        continue;
      }
      const Eigen::Vector3d world =
          world_from_body * Eigen::Vector3d(static_cast<double>(p.x), static_cast<double>(p.y),
                                            static_cast<double>(p.z));
      tiles->add({world.x(), world.y(), world.z(),
                  cloud.stamp + TimeNs{10'000} * static_cast<TimeNs>(p.t_10us), p.intensity});
    }
    progress({"gathering the map", static_cast<double>(i + 1), static_cast<double>(clouds.size()),
              "clouds", ""});
  }
  return tiles;
}

}  // namespace understory
