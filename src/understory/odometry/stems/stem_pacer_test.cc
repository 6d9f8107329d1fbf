#include "understory/odometry/stems/stem_pacer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/geometry/pose.h"
#include "understory/sensor/rig.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kFramePeriodS = 0.2;

struct Trunk {
  Eigen::Vector2d foot;
  double radius = 0.15;
};

std::vector<Trunk> spaced_trunks(double min_spacing_m) {
  Random random(7);
  std::vector<Trunk> trunks;
  for (int tried = 0; tried < 4000; ++tried) {
    const Trunk trunk{{random.uniform(-30.0, 60.0), random.uniform(-30.0, 30.0)},
                      random.uniform(0.08, 0.2)};
    const bool free = std::abs(trunk.foot.y()) > 2.0 &&
                      std::none_of(trunks.begin(), trunks.end(), [&](const Trunk& other) {
                        return (other.foot - trunk.foot).norm() < min_spacing_m;
                      });
    if (free) trunks.push_back(trunk);
  }
  return trunks;
}

// An upright sensor 2 m above level ground, heading `yaw` at (x, 0): one frame of 16 rings, with
// noise, taken at one moment.
ScanPtr frame_of_trunks(const std::vector<Trunk>& trunks, double x, double yaw, int frame) {
  Random random(11, static_cast<std::uint64_t>(frame));
  auto scan = std::make_shared<Scan>();
  scan->stamp = static_cast<TimeNs>(frame * kFramePeriodS * 1e9);
  scan->has_point_times = false;
  scan->ring_count = 16;
  for (int k = 0; k < 900; ++k) {
    const double azimuth = (0.4 * k - 180.0 + 0.2) * kDegree;
    const Eigen::Vector2d ray(std::cos(azimuth + yaw), std::sin(azimuth + yaw));
    double nearest = 60.0;
    for (const Trunk& trunk : trunks) {
      const Eigen::Vector2d to = trunk.foot - Eigen::Vector2d(x, 0.0);
      const double along = to.dot(ray);
      const double aside = std::abs(to.x() * ray.y() - to.y() * ray.x());
      if (along <= 0.0 || aside >= trunk.radius) continue;
      nearest = std::min(nearest, along - std::sqrt(trunk.radius * trunk.radius - aside * aside));
    }
    for (int ring = 0; ring < 16; ++ring) {
      const double slope = std::tan((-15.0 + 2.0 * ring) * kDegree);
      double range = nearest;
      if (slope < 0.0) range = std::min(range, -2.0 / slope);
      if (range >= 50.0 || (range == nearest && range * slope > 10.0)) continue;
      range += 0.015 * random.normal();
      ScanPoint point;
      point.x = static_cast<float>(range * std::cos(azimuth));
      point.y = static_cast<float>(range * std::sin(azimuth));
      point.z = static_cast<float>(range * slope);
      point.ring = static_cast<std::uint16_t>(ring);
      scan->points.push_back(point);
    }
  }
  return scan;
}

// Stands for 40 scans, then drives: off at once, as fast as it will be.
double place_at(int frame) {
  return frame < 42 ? 0.0 : 0.15 * (frame - 42 + 1);
}

struct PacedScans {
  std::vector<StemScan> scans;
  std::size_t max_in_memory = 0;
  std::size_t max_stems = 0;
};

PacedScans run(const StemPaceConfig& pace, const StemFrontEndConfig& config, int frames,
               const Rig& rig = {}) {
  const std::vector<Trunk> trunks = spaced_trunks(2.5);
  StemPacer pacer(pace, config);
  PacedScans outcome;
  const auto take = [&](std::vector<StemScan> scans) {
    std::move(scans.begin(), scans.end(), std::back_inserter(outcome.scans));
  };
  for (int frame = 0; frame < frames; ++frame) {
    take(pacer.add(frame_of_trunks(trunks, place_at(frame), 0.0, frame), rig));
    outcome.max_in_memory = std::max(outcome.max_in_memory, pacer.scans_in_memory());
  }
  take(pacer.finish(rig));
  return outcome;
}

TEST(StemPacer, PositionsFewScansOfAStandingMachineAndAllOfAStart) {
  constexpr int kFrames = 80;
  StemPaceConfig pace;
  pace.longest_gap_s = 1.0;
  const PacedScans outcome = run(pace, {}, kFrames);
  ASSERT_EQ(outcome.scans.size(), static_cast<std::size_t>(kFrames));
  int positioned_standing = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    const StemScan& scan = outcome.scans[static_cast<std::size_t>(frame)];
    EXPECT_EQ(scan.view.frame, frame);
    EXPECT_EQ(scan.view.stamp, static_cast<TimeNs>(frame * kFramePeriodS * 1e9));
    positioned_standing += frame < 36 && scan.positioned ? 1 : 0;
    // Up comes from the stems alone: a hundredth of a degree of lean is a matter of noise.
    const Eigen::Vector3d at = scan.step.world_from_body.translation();
    EXPECT_NEAR(at.x(), place_at(frame), 0.06) << frame;
    EXPECT_NEAR(at.y(), 0.0, 0.06) << frame;
    EXPECT_FALSE(scan.keep && !scan.positioned);
  }
  EXPECT_LE(positioned_standing, 18);
  // The start fell into a gap: on the straight line over it, scans would lie 10 to 40 cm off.
  for (int frame = 41; frame <= 43; ++frame)
    EXPECT_TRUE(outcome.scans[static_cast<std::size_t>(frame)].positioned) << frame;
  EXPECT_LE(outcome.max_in_memory, 5U);
}

// A body whose z axis points down or sideways: the same scans are positioned, at the same places,
// and the world stands upright. Up was once taken from the z axis of the body.
TEST(StemPacer, AxesOfTheBodyMayPointAnywhere) {
  constexpr int kFrames = 50;
  const PacedScans upright = run({}, {}, kFrames);
  for (const Eigen::Vector3d& about :
       {Eigen::Vector3d(M_PI, 0.0, 0.0), Eigen::Vector3d(0.0, 0.5 * M_PI, 0.0),
        Eigen::Vector3d(-0.5 * M_PI, 0.0, 0.0)}) {
    Rig rig;
    rig.body_from_lidar = Pose(so3_exp(about), Eigen::Vector3d::Zero());
    const PacedScans turned = run({}, {}, kFrames, rig);
    ASSERT_EQ(turned.scans.size(), upright.scans.size());
    for (std::size_t i = 0; i < turned.scans.size(); ++i) {
      const StemScan& scan = turned.scans[i];
      const StemScan& other = upright.scans[i];
      EXPECT_EQ(scan.positioned, other.positioned) << i;
      EXPECT_NEAR(scan.step.world_from_body.translation().norm(),
                  other.step.world_from_body.translation().norm(), 0.01)
          << i;
      const Pose world_from_lidar = scan.step.world_from_body * rig.body_from_lidar;
      EXPECT_GT((world_from_lidar.rotation() * Eigen::Vector3d::UnitZ()).z(), std::cos(0.02)) << i;
    }
  }
}

TEST(StemPacer, WithoutAGapItIsTheFrontEnd) {
  StemPaceConfig pace;
  pace.longest_gap_s = 0.0;
  const PacedScans outcome = run(pace, {}, 12);
  ASSERT_EQ(outcome.scans.size(), 12U);
  EXPECT_EQ(outcome.max_in_memory, 0U);
  StemFrontEnd front_end({});
  const std::vector<Trunk> trunks = spaced_trunks(2.5);
  for (int frame = 0; frame < 12; ++frame) {
    const StemScan alone =
        front_end.add(*frame_of_trunks(trunks, place_at(frame), 0.0, frame), frame, Rig());
    const StemScan& paced = outcome.scans[static_cast<std::size_t>(frame)];
    EXPECT_TRUE(paced.positioned);
    EXPECT_EQ(paced.step.world_from_body.translation(), alone.step.world_from_body.translation());
  }
}

// Views of a drive of 12 m.
int views_kept(const ViewChoiceConfig& keep, double spacing_m, double step_m, double turn) {
  const std::vector<Trunk> trunks = spaced_trunks(spacing_m);
  StemFrontEndConfig config;
  config.keep = keep;
  StemFrontEnd front_end(config);
  int kept = 0;
  std::size_t max_stems = 0;
  for (int frame = 0; frame * step_m < 12.0 && frame < 60; ++frame) {
    kept +=
        front_end.add(*frame_of_trunks(trunks, frame * step_m, turn * frame, frame), frame, Rig())
            .keep;
    max_stems = std::max(max_stems, front_end.odometry().stems_in_memory());
  }
  EXPECT_LT(max_stems, 2 * trunks.size());
  return kept;
}

TEST(ViewChoice, FollowsWhatTheStandAllows) {
  ViewChoiceConfig fixed;
  ViewChoiceConfig region;
  region.rule = ViewChoiceConfig::Rule::kRegion;
  ViewChoiceConfig overlap;
  overlap.rule = ViewChoiceConfig::Rule::kOverlap;
  EXPECT_NEAR(views_kept(fixed, 2.0, 0.2, 0.0), 20, 2);
  EXPECT_NEAR(views_kept(fixed, 6.0, 0.2, 0.0), 20, 2);
  // Where stems stand farther apart, matching converges from farther away.
  const int dense = views_kept(region, 2.0, 0.2, 0.0);
  const int open = views_kept(region, 6.0, 0.2, 0.0);
  EXPECT_GT(dense, 4);
  EXPECT_GT(open, 1);
  EXPECT_LE(3 * open, 2 * dense);
  // While nothing new comes into view nothing is kept, at however many places; a way does bring
  // something new.
  EXPECT_LE(views_kept(overlap, 2.0, 0.0, 0.0), 2);
  EXPECT_GT(views_kept(overlap, 2.0, 0.2, 0.0), 3);
}

}  // namespace
}  // namespace understory
