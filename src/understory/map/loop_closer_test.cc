#include "understory/map/loop_closer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

constexpr int kRound = 200;

// A round of 16 m radius that comes back to where it began.
std::vector<Keyframe> round_walk(KeyframePoints& points) {
  std::vector<Keyframe> keyframes;
  for (int i = 0; i < kRound; ++i) {
    const double angle = 2.0 * M_PI * i / kRound;
    Keyframe keyframe;
    keyframe.stamp = (i + 1) * kNsPerSecond;
    keyframe.world_from_body =
        Pose(so3_exp({0.0, 0.0, angle}), {16.0 * std::cos(angle), 16.0 * std::sin(angle), 0.0});
    if (i > 0) {
      keyframe.previous_from_this =
          keyframes.back().world_from_body.inverse() * keyframe.world_from_body;
    }
    keyframe.covariance = 1e-6 * Matrix6d::Identity();
    keyframes.push_back(keyframe);
    FeaturePoints cloud;
    for (int k = 0; k < 500; ++k) {
      const auto turn = static_cast<float>(k);
      cloud.points.emplace_back(10.0F * std::sin(1.3F * turn), 10.0F * std::cos(0.7F * turn),
                                0.01F * turn);
    }
    points.append(keyframe.stamp, cloud);
  }
  return keyframes;
}

// A search runs beside the scan loop. What it throws is thrown where its outcome is taken, and the
// program goes on to tell of it.
TEST(LoopCloser, ASearchThatFailsIsAnErrorWhereItsOutcomeIsTaken) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "points.bin";
  KeyframePoints points(file, 5);
  const std::vector<Keyframe> keyframes = round_walk(points);
  points.sync();
  std::filesystem::resize_file(file, 1000);  // a damaged disk
  LoopCloser closer({}, {});
  closer.consider(keyframes, {0}, points);
  EXPECT_THROW(static_cast<void>(closer.take(keyframes.size(), true, true)), InputError);
  EXPECT_FALSE(closer.take(keyframes.size(), true, true));
}

}  // namespace
}  // namespace understory
