#include "understory/map/upright_views.h"

#include <Eigen/Geometry>

#include "understory/geometry/rotation_between.h"
#include "understory/map/map_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace map_constants::upright_views;

// Of the body, in the mean over all poses; z where they cancel out.
Eigen::Vector3d mean_up_in_body(const std::vector<Pose>& world_from_body) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Pose& pose : world_from_body)
    sum += pose.rotation().inverse() * Eigen::Vector3d::UnitZ();
  return sum.norm() > 0.0 ? Eigen::Vector3d(sum.normalized())
                          : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
}

Eigen::Quaterniond upright_from_body(const Eigen::Vector3d& up_in_body) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  if (up_in_body.z() > kFarOver) return rotation_between(up_in_body, z);
  const Eigen::Quaterniond over(0.0, 1.0, 0.0, 0.0);  // half a turn about x
  return rotation_between(over * up_in_body, z) * over;
}

}  // namespace

UprightViews upright_views(const std::vector<StemView>& views,
                           const std::vector<Pose>& world_from_body) {
  UNDERSTORY_CHECK(views.size() == world_from_body.size());
  UprightViews result{{}, world_from_body};
  const Eigen::Vector3d up = mean_up_in_body(world_from_body);
  const bool turned = up.z() < kUpright;
  const Eigen::Quaterniond turn =
      turned ? upright_from_body(up) : Eigen::Quaterniond(Eigen::Quaterniond::Identity());
  for (const StemView& view : views) {
    SparsePoints& points = result.points.emplace_back();
    for (const Stem& stem : view.stems) {
      const Eigen::Vector3d point = stem.point.cast<double>();
      points.push_back(turned ? Eigen::Vector3d(turn * point) : point);
    }
  }
  if (!turned) return result;
  const Pose body_from_view(turn.inverse(), Eigen::Vector3d::Zero());
  for (Pose& pose : result.world_from_view)
    pose = pose * body_from_view;
  return result;
}

}  // namespace understory
