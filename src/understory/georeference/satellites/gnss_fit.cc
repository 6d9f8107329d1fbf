#include "understory/georeference/satellites/gnss_fit.h"

#include <algorithm>
#include <cmath>

#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::gnss_fit;

using Eigen::Vector3d;

// Where the antenna was at the time of each fix, world frame.
std::vector<std::optional<Vector3d>> places_in_time(const std::vector<StampedPose>& trajectory,
                                                    const Vector3d& arm,
                                                    const std::vector<GnssFix>& fixes) {
  std::vector<std::optional<Vector3d>> places;
  for (const GnssFix& fix : fixes)
    places.push_back(antenna_place(trajectory, arm, fix.stamp));
  return places;
}

double time_rms_m(const std::vector<std::optional<Vector3d>>& places,
                  const std::vector<Vector3d>& fixes, const Pose& motion) {
  std::vector<double> squared;
  for (std::size_t k = 0; k < fixes.size(); ++k) {
    if (places[k]) squared.push_back((motion * *places[k] - fixes[k]).head<2>().squaredNorm());
  }
  return std::sqrt(upper_median(std::move(squared)));
}

// Fix minus antenna along and across the way, where the carrier moved within some seconds.
void tell_along_and_across(const std::vector<std::optional<Vector3d>>& places,
                           const std::vector<Vector3d>& fixes, GnssFit& fit) {
  double along = 0.0;
  double across = 0.0;
  double count = 0.0;
  for (std::size_t k = 0; k < fixes.size(); ++k) {
    if (!places[k]) continue;
    ++fit.fixes_in_time;
    const auto& from = places[k < kReach ? 0 : k - kReach];
    const auto& to = places[std::min(k + kReach, fixes.size() - 1)];
    if (!from || !to) continue;
    const Eigen::Vector2d way = (fit.enu_from_world.rotation() * (*to - *from)).head<2>();
    if (way.norm() < kLeastM) continue;
    const Eigen::Vector2d e = (fixes[k] - fit.enu_from_world * *places[k]).head<2>();
    const Eigen::Vector2d ahead = way.normalized();
    along += std::pow(e.dot(ahead), 2.0);
    across += std::pow(ahead.x() * e.y() - ahead.y() * e.x(), 2.0);
    count += 1.0;
  }
  fit.along_rms_m = std::sqrt(along / count);
  fit.across_rms_m = std::sqrt(across / count);
}

std::vector<FittedFix> fixes_on_path(const std::vector<GnssFix>& fixes,
                                     const std::vector<Vector3d>& enu,
                                     const std::vector<std::optional<Vector3d>>& places,
                                     const GnssFit& fit) {
  std::vector<FittedFix> fitted;
  for (std::size_t k = 0; k < fixes.size(); ++k) {
    FittedFix one;
    one.fix = fixes[k];
    one.position_in_enu = enu[k];
    if (!std::isfinite(fixes[k].height_m)) one.position_in_enu.z() = std::nan("");
    if (places[k]) one.residual = one.position_in_enu - fit.enu_from_world * *places[k];
    one.used = fit.path.fix_used[k] != 0;
    fitted.push_back(one);
  }
  return fitted;
}

// Which of two motions that fit alike, from the clocks.
void decide_by_time(const std::vector<Vector3d>& path,
                    const std::vector<std::optional<Vector3d>>& places,
                    const std::vector<Vector3d>& fixes, PathFitConfig config, GnssFit& fit) {
  if (fit.path.turned_rms_m > kAlike * fit.path.symmetric_rms_m) return;
  const auto in_time = static_cast<std::size_t>(
      std::count_if(places.begin(), places.end(), [](const auto& p) { return p.has_value(); }));
  const double here = time_rms_m(places, fixes, fit.path.target_from_source);
  const double turned = time_rms_m(places, fixes, fit.path.turned_target_from_source);
  if (2 * in_time < fixes.size() || std::min(here, turned) > kClearly * std::max(here, turned)) {
    fit.ambiguous = true;
  } else if (turned < here) {
    config.about_yaw_rad = yaw_of(fit.path.turned_target_from_source);
    PathFit other = fit_path(path, fixes, config);
    other.turned_rms_m = fit.path.symmetric_rms_m;
    other.turned_target_from_source = fit.path.target_from_source;
    fit.path = std::move(other);
    fit.turned_by_time = true;
  }
}

}  // namespace

double yaw_of(const Pose& pose) {
  const Vector3d heading = pose.rotation() * Vector3d::UnitX();
  return std::atan2(heading.y(), heading.x());
}

GnssFit fit_to_gnss(const std::vector<StampedPose>& trajectory, const Vector3d& antenna_in_body,
                    const std::vector<GnssFix>& fixes, const PathFitConfig& config) {
  GnssFit fit;
  if (fixes.empty()) return fit;
  const auto height = [](const GnssFix& fix) {
    return std::isfinite(fix.height_m) ? fix.height_m : 0.0;
  };
  fit.origin = {fixes.front().latitude_deg, fixes.front().longitude_deg, height(fixes.front())};
  const EastNorthUp frame(*fit.origin);
  std::vector<Vector3d> enu;
  std::vector<double> up;
  for (const GnssFix& fix : fixes) {
    enu.push_back(frame.from_place({fix.latitude_deg, fix.longitude_deg, height(fix)}));
    if (std::isfinite(fix.height_m)) up.push_back(enu.back().z());
  }
  std::vector<Vector3d> path;
  std::vector<double> path_up;
  for (const StampedPose& pose : trajectory) {
    path.push_back(pose.world_from_body * antenna_in_body);
    path_up.push_back(path.back().z());
  }
  fit.path = fit_path(path, enu, config);
  if (!fit.path.found) return fit;
  const auto places = places_in_time(trajectory, antenna_in_body, fixes);
  decide_by_time(path, places, enu, config, fit);
  Vector3d shift = fit.path.target_from_source.translation();
  if (!up.empty()) shift.z() = upper_median(std::move(up)) - upper_median(std::move(path_up));
  fit.enu_from_world = Pose(fit.path.target_from_source.rotation(), shift);
  tell_along_and_across(places, enu, fit);
  fit.fixes = fixes_on_path(fixes, enu, places, fit);
  return fit;
}

}  // namespace understory
