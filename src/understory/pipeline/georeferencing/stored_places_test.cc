#include "understory/pipeline/georeferencing/stored_places.h"

#include <gtest/gtest.h>

#include <string>

#include "understory/map/map_tiles.h"
#include "understory/output/layer_files.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr const char* kInFeet = "EPSG:2225";

LayerFrame frame_of(const std::string& system) {
  const Pose enu_from_world(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ())),
                            {3.0, -2.0, 0.5});
  const GeodeticPlace in_finland{61.2, 25.1, 140.0};
  const GeodeticPlace in_california{40.5, -122.1, 140.0};
  return system.empty()
             ? LayerFrame()
             : LayerFrame(enu_from_world, system == kInFeet ? in_california : in_finland, system);
}

class StoredPlaces : public testing::TestWithParam<std::string> {};

TEST_P(StoredPlaces, TheReaderOfTheFileGetsThePlacesThatTheWriterWorkedWith) {
  const LayerFrame layers = frame_of(GetParam());
  const LasOptions options = las_options(layers);
  const understory::StoredPlaces stored(layers);
  Random random(5);
  for (int i = 0; i < 20'000; ++i) {
    const Eigen::Vector3d measured(random.uniform(-900.0, 900.0), random.uniform(-900.0, 900.0),
                                   random.uniform(-20.0, 60.0));
    const Eigen::Vector3d mine = stored.from_world(measured);
    ASSERT_LT((mine - measured).norm(), 0.0015);
    // Written, read, and moved to the world.
    const Eigen::Vector3d at = layers.from_world(mine);
    const Eigen::Vector3d steps =
        (at - options.offset).cwiseQuotient(options.scale).array().round();
    const Eigen::Vector3d read = options.offset + options.scale.cwiseProduct(steps);
    ASSERT_EQ(mine, stored.from_layers(read)) << measured.transpose();
    ASSERT_EQ(mine, on_map_grid(mine));
    ASSERT_EQ(mine, stored.from_world(mine));
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, StoredPlaces,
                         testing::Values("", "EPSG:3067", "EPSG:4979", kInFeet));

}  // namespace
}  // namespace understory
