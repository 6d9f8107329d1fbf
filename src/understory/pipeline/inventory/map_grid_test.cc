#include <gtest/gtest.h>

#include <string>

#include "understory/georeference/systems/layer_frame.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/output/layers/layer_files.h"
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

class MapGrid : public ::testing::TestWithParam<std::string> {};

TEST_P(MapGrid, AFileInAnyFrameGivesItsPlacesBack) {
  const LayerFrame layers = frame_of(GetParam());
  const LasOptions options = las_options(layers);
  Random random(5);
  for (int i = 0; i < 50'000; ++i) {
    const Eigen::Vector3d measured(random.uniform(-900.0, 900.0), random.uniform(-900.0, 900.0),
                                   random.uniform(-20.0, 60.0));
    const Eigen::Vector3d place = on_map_grid(measured);
    ASSERT_LT((place - measured).cwiseAbs().maxCoeff(), 0.001);
    const Eigen::Vector3d steps =
        (layers.from_world(place) - options.offset).cwiseQuotient(options.scale).array().round();
    const Eigen::Vector3d read = options.offset + options.scale.cwiseProduct(steps);
    ASSERT_EQ(place, on_map_grid(layers.to_world(read))) << measured.transpose();
    ASSERT_EQ(place, on_map_grid(place));
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, MapGrid, ::testing::Values("", "EPSG:3067", "EPSG:4979", kInFeet));

}  // namespace
}  // namespace understory
