#include "understory/pipeline/inventory/lidar_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/evaluation/trajectory.h"
#include "understory/map/carrier_region.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/pipeline/run_folder/run_json.h"

namespace understory {
namespace {

using namespace pipeline_constants::lidar_view;

std::size_t sector_of(const Eigen::Vector3d& point) {
  const double turn = std::atan2(point.y(), point.x()) / (2.0 * M_PI) + 0.5;
  return static_cast<std::size_t>(
      std::clamp(static_cast<int>(turn * LidarView::kSectors), 0, LidarView::kSectors - 1));
}

double elevation_deg(const Eigen::Vector3d& point) {
  return std::atan2(point.z(), point.head<2>().norm()) * 180.0 / M_PI;
}

}  // namespace

std::array<double, LidarView::kSectors> LidarView::no_returns() {
  std::array<double, kSectors> none{};
  none.fill(std::numeric_limits<double>::quiet_NaN());
  return none;
}

void LidarView::add(const std::vector<Eigen::Vector3d>& places) {
  const Pose lidar_from_body = body_from_lidar.inverse();
  // Points that are surely lower than another of their sector are left out by their slope. Most are
  // lower than what every sector has, so their sector is not looked up.
  std::array<double, kSectors> steepest{};
  steepest.fill(-std::numeric_limits<double>::infinity());
  double everywhere = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i % kPointsPerLook == 0) everywhere = *std::min_element(steepest.begin(), steepest.end());
    const Eigen::Vector3d point = lidar_from_body * places[i];
    const double flat = point.head<2>().norm();
    if (point.z() < (everywhere - kSureSlope) * flat) continue;
    const std::size_t sector = sector_of(point);
    if (point.z() < (steepest[sector] - kSureSlope) * flat) continue;
    steepest[sector] = std::max(steepest[sector], point.z() / flat);
    highest_deg[sector] = std::fmax(highest_deg[sector], elevation_deg(point));
  }
}

bool LidarView::covers(const Eigen::Vector3d& point_in_lidar) const {
  return elevation_deg(point_in_lidar) <= highest_deg[sector_of(point_in_lidar)];  // not for NaN
}

LidarView learn_view(const KeyframeClouds& clouds, const Pose& body_from_lidar,
                     std::span<const StampedPose> path) {
  LidarView view;
  view.body_from_lidar = body_from_lidar;
  const std::size_t count = std::min(kClouds, clouds.size());
  std::vector<Eigen::Vector3d> places;
  for (std::size_t i = 0; i < count; ++i) {
    const KeyframeCloud cloud = clouds.read(i * clouds.size() / count);
    places.clear();
    if (path.empty()) {
      for (const KeyframePoint& p : cloud.points)
        places.push_back(Eigen::Vector3f(p.x, p.y, p.z).cast<double>());
    } else {
      const PlacesAsMeasured as_measured(cloud, path);
      for (const KeyframePoint& p : cloud.points)
        places.push_back(as_measured(p));
    }
    view.add(places);
  }
  return view;
}

Lookouts seen_from(const LidarView& view, const std::vector<Pose>& world_from_body) {
  std::vector<Pose> lidar_from_world;
  std::vector<Eigen::Vector3d> places;
  for (const Pose& pose : world_from_body) {
    const Pose world_from_lidar = pose * view.body_from_lidar;
    const Eigen::Vector3d& here = world_from_lidar.translation();
    if (!places.empty() && (here - places.back()).norm() < kStep) continue;
    places.push_back(here);
    lidar_from_world.push_back(world_from_lidar.inverse());
  }
  return [view, places = std::move(places),
          poses = std::move(lidar_from_world)](const Eigen::Vector3d& place) {
    std::vector<Eigen::Vector3d> from;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Vector3d point = poses[i] * place;
      if (point.squaredNorm() < kReach * kReach && view.covers(point)) from.push_back(places[i]);
    }
    return from;
  };
}

LidarViewFigures figures_of(const LidarView& view) {
  LidarViewFigures figures;
  const Eigen::Matrix4d matrix = view.body_from_lidar.matrix();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column)
      figures.body_from_lidar.push_back(matrix(row, column));
  }
  figures.highest_deg.assign(view.highest_deg.begin(), view.highest_deg.end());
  return figures;
}

Lookouts seen_in_run(const std::filesystem::path& run) {
  const RunJson json(run);
  if (!json.has("/lidar_view") || !std::filesystem::exists(run / "keyframes.tum")) return {};
  LidarView view;
  const std::vector<double> matrix = json.get_numbers("/lidar_view/body_from_lidar", 16);
  view.body_from_lidar = Pose::from_matrix(
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(matrix.data()));
  const std::vector<double> highest =
      json.get_numbers("/lidar_view/highest_deg", LidarView::kSectors);
  for (std::size_t i = 0; i < highest.size(); ++i) {
    if (!std::isnan(highest[i])) view.highest_deg[i] = highest[i];
  }
  std::vector<Pose> poses;
  for (const auto& pose : read_trajectory(run / "keyframes.tum"))
    poses.push_back(pose.world_from_body);
  return seen_from(view, poses);
}

std::vector<Eigen::Vector3d> places_of(const std::vector<Pose>& world_from_body) {
  std::vector<Eigen::Vector3d> places;
  for (const Pose& pose : world_from_body)
    places.push_back(pose.translation());
  return places;
}

std::vector<Eigen::Vector3d> places_in_run(const std::filesystem::path& run) {
  if (!std::filesystem::exists(run / "keyframes.tum")) return {};
  std::vector<Eigen::Vector3d> places;
  for (const auto& pose : read_trajectory(run / "keyframes.tum"))
    places.push_back(pose.world_from_body.translation());
  return places;
}

std::string single_lidar_model(const Rig& rig) {
  return rig.further_lidars.empty() ? rig.lidar_model : std::string();
}

BeamConfig beams_in(const BeamConfig& config, const Rig& rig) {
  BeamConfig known = config;
  if (known.sensor == LidarSensor::kRecording)
    known.sensor = sensor_of_model(single_lidar_model(rig));
  return known;
}

BeamConfig beams_in_run(const BeamConfig& config, const std::filesystem::path& run) {
  Rig rig;
  rig.lidar_model = RunJson(run).find_text("/lidar_model");
  return beams_in(config, rig);
}

}  // namespace understory
