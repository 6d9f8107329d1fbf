#include "understory/graph/loops/place_again.h"

#include <utility>

#include "understory/geometry/pose.h"
#include "understory/geometry/rotation_between.h"
#include "understory/registration/global/match_verdict.h"

namespace understory {
namespace {

Pose level_from_body(const UnplacedCloud& cloud) {
  return {rotation_between(cloud.up.normalized(), Eigen::Vector3d::UnitZ()),
          Eigen::Vector3d::Zero()};
}

}  // namespace

UnplacedCloud make_unplaced(Points points, const Eigen::Vector3d& up) {
  UnplacedCloud cloud{std::move(points), up, {}};
  const Eigen::Matrix3f turn = level_from_body(cloud).rotation_matrix().cast<float>();
  Points level;
  level.reserve(cloud.points.size());
  for (const Eigen::Vector3f& point : cloud.points)
    level.push_back(turn * point);
  cloud.ready = prepare_search(level);
  return cloud;
}

LoopVerification verify_place_again(const UnplacedCloud& target, const UnplacedCloud& source,
                                    const LoopClosureConfig& config) {
  const GlobalRegistration found = register_globally(target.ready, source.ready);
  LoopInput input;
  input.target_from_source =
      level_from_body(target).inverse() * found.result.target_from_source * level_from_body(source);
  if (!found.verdict.trusted) {
    LoopVerification report;
    report.reason = "without a guess: " + found.verdict.reason;
    report.target_from_source = input.target_from_source;
    return report;
  }
  input.target_points = target.points;
  input.source_points = source.points;
  input.up_in_target = target.up;
  input.up_in_source = source.up;
  return verify_loop(input, config);
}

}  // namespace understory
