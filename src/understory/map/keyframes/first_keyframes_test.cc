#include "understory/map/keyframes/first_keyframes.h"

#include <gtest/gtest.h>

#include "understory/registration/test_stand.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr int kKeyframes = 12;

// A straight path through a stand, each keyframe one scan of 16 rings.
struct Path {
  std::vector<Keyframe> truth;
  std::vector<std::shared_ptr<const FeaturePoints>> points;

  Path() {
    testing::Stand stand = testing::make_stand({.half_width_m = 30.0}, 2);
    stand.bump_m = 0.3;
    for (int i = 0; i < kKeyframes; ++i) {
      Keyframe keyframe;
      keyframe.world_from_body =
          Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.5 * i - 3.0, 0.0, 1.6));
      keyframe.covariance = 1e-3 * Matrix6d::Identity();
      truth.push_back(keyframe);
      points.push_back(std::make_shared<FeaturePoints>(FeaturePoints{
          testing::scan_stand(stand, keyframe.world_from_body, testing::vlp16(), 100 + i), {}}));
    }
  }

  // With the first `wrong` keyframes moved off together.
  [[nodiscard]] std::vector<Keyframe> tilted(int wrong) const {
    std::vector<Keyframe> keyframes = truth;
    const Pose off(Eigen::Quaterniond(Eigen::AngleAxisd(0.004, Eigen::Vector3d::UnitY())),
                   Eigen::Vector3d(0.0, 0.0, 0.04));
    for (int i = 0; i < wrong; ++i) {
      Pose& pose = keyframes[static_cast<std::size_t>(i)].world_from_body;
      pose = pose * off;
    }
    return keyframes;
  }

  [[nodiscard]] std::vector<Pose> refine(const std::vector<Keyframe>& keyframes,
                                         const FirstKeyframesConfig& config) const {
    LocalMapConfig map;  // as for a lidar with few rings
    auto& ndt = map.matcher.get<NdtMatcherConfig>();
    ndt.cell_sizes_m = {1.0};
    ndt.cells.volume_weight = 1.0;
    ndt.cells.few_rings = true;
    map.viewpoint.lidar_in_source = Eigen::Vector3d::Zero();
    return refine_first_keyframes(
        keyframes, [&](std::size_t i) { return points[i]; }, map, config);
  }
};

double worst_angle_deg(const std::vector<Pose>& poses, const std::vector<Keyframe>& truth) {
  double worst = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    worst = std::max(worst, (poses[i].inverse() * truth[i].world_from_body).angle() * 57.2958);
  return worst;
}

TEST(Beginning, IsPutRightByTheMapThatFollows) {
  const Path path;
  const std::vector<Keyframe> tilted = path.tilted(4);
  std::vector<Pose> refined;
  with_threads(2, [&] { refined = path.refine(tilted, {.keyframes = 5, .map_keyframes = 7}); });
  ASSERT_EQ(refined.size(), 5U);
  std::vector<Pose> before;
  for (std::size_t i = 0; i < 5; ++i)
    before.push_back(tilted[i].world_from_body);
  EXPECT_GT(worst_angle_deg(before, path.truth), 0.2);
  EXPECT_LT(worst_angle_deg(refined, path.truth), 0.12);
  for (std::size_t i = 0; i < refined.size(); ++i) {
    const Eigen::Vector3d error =
        refined[i].translation() - path.truth[i].world_from_body.translation();
    EXPECT_LT(error.norm(), 0.02) << i;
  }
  std::vector<Pose> again;
  with_threads(1, [&] { again = path.refine(tilted, {.keyframes = 5, .map_keyframes = 7}); });
  for (std::size_t i = 0; i < refined.size(); ++i)
    EXPECT_EQ(refined[i].translation(), again[i].translation());
}

TEST(FirstKeyframes, StayWhatTheyWereWhereTheCorrectionIsRejected) {
  const Path path;
  const std::vector<Keyframe> tilted = path.tilted(4);
  const std::vector<Pose> refined =
      path.refine(tilted, {.keyframes = 5, .map_keyframes = 7, .max_m = 0.001});
  ASSERT_EQ(refined.size(), 5U);
  EXPECT_GT(worst_angle_deg({refined[0]}, path.truth), 0.15);
}

TEST(Beginning, NeedsASegmentThatIsLongEnough) {
  const Path path;
  EXPECT_TRUE(path.refine(path.truth, {.keyframes = 6, .map_keyframes = 7}).empty());
}

}  // namespace
}  // namespace understory
