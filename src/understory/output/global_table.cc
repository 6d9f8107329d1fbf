#include "understory/output/global_table.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "understory/util/files/csv.h"

namespace understory {
namespace {

// Of the body's x axis clockwise from north; then its roll and pitch (docs/reference/outputs.md).
Eigen::Vector3d heading_roll_pitch_deg(const Eigen::Quaterniond& enu_from_body) {
  const Eigen::Matrix3d r = enu_from_body.toRotationMatrix();
  const double heading = std::atan2(r(0, 0), r(1, 0));
  const Eigen::Vector3d angles(heading < 0.0 ? heading + 2.0 * M_PI : heading,
                               std::atan2(r(2, 1), r(2, 2)),
                               std::asin(std::clamp(-r(2, 0), -1.0, 1.0)));
  return angles * 180.0 / M_PI;
}

}  // namespace

GlobalWriter::GlobalWriter(const std::filesystem::path& path) : file_(path) {
  file_.write(
      "timestamp,latitude_deg,longitude_deg,height_m,easting,northing,heading_deg,roll_deg,"
      "pitch_deg,east_sd_m,north_sd_m,height_sd_m,heading_sd_deg,turn_east_sd_deg,"
      "turn_north_sd_deg\n");
}

void GlobalWriter::add(const GlobalRow& row) {
  const GlobalPose& pose = row.pose;
  std::string line = format_seconds(pose.stamp);
  const auto put = [&](double value, int decimals) { line += "," + csv_cell(value, decimals); };
  put(pose.place.latitude_deg, 9);
  put(pose.place.longitude_deg, 9);
  put(pose.place.height_m, 3);
  put(row.grid.x(), 3);
  put(row.grid.y(), 3);
  Eigen::Vector3d attitude = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (pose.heading_known) attitude = heading_roll_pitch_deg(pose.enu_from_body);
  for (const double angle : attitude)
    put(angle, 4);
  for (const double sd_m : pose.place_sd_m)
    put(sd_m, 3);
  for (const int axis : {2, 0, 1})
    put(pose.turn_sd_deg(axis), 4);
  file_.write(line + "\n");
}

}  // namespace understory
