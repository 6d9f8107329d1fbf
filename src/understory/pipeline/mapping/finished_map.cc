#include "understory/pipeline/mapping/finished_map.h"

#include <cstddef>
#include <optional>

#include "understory/map/clouds/near_columns.h"
#include "understory/util/error.h"

namespace understory {
namespace {

Pose pose_of(const KeyframeCloud& cloud, const std::vector<Keyframe>& keyframes) {
  const auto keyframe = static_cast<std::size_t>(cloud.id);
  UNDERSTORY_CHECK(keyframe < keyframes.size());
  return keyframes[keyframe].world_from_body * cloud.keyframe_from_body;
}

// Adds clouds to tiles.
class Gathering {
 public:
  Gathering(const std::vector<Keyframe>& keyframes, MapTiles& tiles, LeftOutCarrier& carrier,
            std::size_t clouds, const ProgressSink& progress)
      : keyframes_(keyframes),
        tiles_(tiles),
        carrier_(carrier),
        clouds_(static_cast<double>(clouds)),
        progress_(progress) {}

  // `near`: gets what the cloud shows from near; null: nobody asks.
  void add_whole(const KeyframeCloud& cloud, NearColumns* near) {
    const Pose world_from_body = pose_of(cloud, keyframes_);
    if (near != nullptr) near->add(cloud, world_from_body);
    add(cloud, world_from_body, nullptr);
  }
  // What lies in columns of `near` stays away.
  void add_far(const KeyframeCloud& cloud, const NearColumns& near) {
    add(cloud, pose_of(cloud, keyframes_), &near);
  }

 private:
  void add(const KeyframeCloud& cloud, const Pose& world_from_body, const NearColumns* known) {
    std::optional<PlacesAsMeasured> as_measured;
    if (!carrier_.region.empty()) as_measured.emplace(cloud, carrier_.path);
    for (const KeyframePoint& p : cloud.points) {
      const Eigen::Vector3d world =
          world_from_body * Eigen::Vector3d(static_cast<double>(p.x), static_cast<double>(p.y),
                                            static_cast<double>(p.z));
      if (known != nullptr && known->hold(world)) continue;
      ++carrier_.of;
      if (as_measured && carrier_.region.holds((*as_measured)(p))) {
        ++carrier_.points;
        continue;
      }
      tiles_.add({world.x(), world.y(), world.z(),
                  cloud.stamp + TimeNs{10'000} * static_cast<TimeNs>(p.t_10us), p.intensity});
    }
    done_ += 1.0;
    progress_({"gathering the map", done_, clouds_, "clouds", ""});
  }

  const std::vector<Keyframe>& keyframes_;
  MapTiles& tiles_;
  LeftOutCarrier& carrier_;
  double clouds_;
  const ProgressSink& progress_;
  double done_ = 0.0;
};

}  // namespace

std::unique_ptr<MapTiles> make_finished_map(const MapClouds& clouds,
                                            const std::vector<Keyframe>& keyframes,
                                            MapTiles::Config config,
                                            const std::filesystem::path& folder,
                                            LeftOutCarrier& carrier, const ProgressSink& progress) {
  config.on_grid = true;
  auto tiles = std::make_unique<MapTiles>(folder, config);
  const std::size_t far = clouds.far != nullptr ? clouds.far->size() : 0;
  Gathering gathering(keyframes, *tiles, carrier, clouds.whole.size() + far, progress);
  NearColumns near(clouds.far_m);
  for (std::size_t i = 0; i < clouds.whole.size(); ++i)
    gathering.add_whole(clouds.whole.read(i), far > 0 ? &near : nullptr);
  for (std::size_t i = 0; i < far; ++i)
    gathering.add_far(clouds.far->read(i), near);
  return tiles;
}

}  // namespace understory
