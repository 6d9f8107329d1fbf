#pragma once

#include <cmath>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory::test {

// For tests: a road of 60 m through a stand on level ground, views of 210 degrees to 35 m from a
// cabin that swings. Where nothing shows the ground, feet are guessed too high: by a centimetre a
// metre of range from 12 m on, and roughly. Trees lean by 2 degrees, each its own way.
struct Road {
  std::vector<StemView> views;
  std::vector<Pose> truth;
};

struct Trunk {
  Eigen::Vector3d foot;
  Eigen::Vector3d axis;
};

inline std::vector<Trunk> stand(Random& random) {
  std::vector<Trunk> trees;
  while (trees.size() < 500) {
    Trunk tree;
    tree.foot = {random.uniform(-40.0, 100.0), random.uniform(-40.0, 40.0), 0.0};
    tree.axis =
        Eigen::Vector3d(2.0 * kDegree * random.normal(), 2.0 * kDegree * random.normal(), 1.0)
            .normalized();
    bool free = std::abs(tree.foot.y()) > 2.0;
    for (const Trunk& other : trees)
      free = free && (tree.foot - other.foot).norm() > 1.8;
    if (free) trees.push_back(tree);
  }
  return trees;
}

inline Road drive(std::uint64_t seed) {
  Random random(seed);
  const std::vector<Trunk> trees = stand(random);
  Road road;
  for (int k = 0; k < 150; ++k) {
    const double yaw = 0.9 * std::sin(0.3 * k);
    const Eigen::Vector3d tilt(2.0 * kDegree * random.normal(), 2.0 * kDegree * random.normal(),
                               0.0);
    road.truth.emplace_back(so3_exp(Eigen::Vector3d(0.0, 0.0, yaw)) * so3_exp(tilt),
                            Eigen::Vector3d(0.4 * k, 0.0, 2.5));
    const Pose body_from_world = road.truth.back().inverse();
    StemView view;
    view.frame = k;
    view.stamp = TimeNs{1'000'000'000} * k;
    for (const Trunk& tree : trees) {
      Eigen::Vector3d foot = tree.foot;
      const double range = (foot - road.truth.back().translation()).head<2>().norm();
      foot +=
          Eigen::Vector3d(0.02 * random.normal(), 0.02 * random.normal(), 0.05 * random.normal());
      if (range > 12.0) foot.z() += (range - 12.0) * std::abs(0.01 + 0.006 * random.normal());
      const Eigen::Vector3d seen = body_from_world * foot;
      if (range > 35.0 || std::abs(std::atan2(seen.y(), seen.x())) > 1.83) continue;
      if (random.uniform(0.0, 1.0) < 0.25) continue;
      Stem stem;
      stem.point = seen.cast<float>();
      stem.axis =
          (body_from_world.rotation() *
           (tree.axis + 0.5 * kDegree * Eigen::Vector3d(random.normal(), random.normal(), 0.0)))
              .normalized()
              .cast<float>();
      stem.score = 0.9F;
      view.stems.push_back(stem);
    }
    road.views.push_back(view);
  }
  return road;
}

}  // namespace understory::test
