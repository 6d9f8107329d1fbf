#include "understory/evaluation/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "understory/evaluation/world_frame.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

// Decimal seconds exactly; with an exponent (as numpy writes) to the precision of a long double,
// which holds today's epoch to a nanosecond.
bool parse_stamp(std::string_view text, TimeNs& stamp) {
  const std::string copy(text);
  if (parse_seconds(copy, stamp)) return true;
  char* end = nullptr;
  const long double seconds = std::strtold(copy.c_str(), &end);
  if (end == copy.c_str() || *end != '\0' || !(std::fabs(seconds) < 9.0e9L)) return false;
  stamp = static_cast<TimeNs>(std::llround(seconds * 1e9L));
  return true;
}

StampedPose parse_pose(const std::vector<std::string_view>& cells, const LineReader& lines) {
  constexpr std::size_t kColumns = 8;
  const auto fail = [&](const std::string& what) {
    lines.fail("expected 'timestamp_s x y z qx qy qz qw', " + what);
  };
  if (cells.size() != kColumns) fail("found " + std::to_string(cells.size()) + " columns");
  StampedPose pose;
  if (!parse_stamp(cells[0], pose.stamp)) {
    fail("found '" + std::string(cells[0]) + "' for a time");
  }
  std::array<double, kColumns> v{};
  for (std::size_t i = 1; i < kColumns; ++i) {
    const std::optional<double> value = to_number(cells[i]);
    if (!value || !std::isfinite(*value))
      fail("found '" + std::string(cells[i]) + "' for a finite number");
    v[i] = *value;
  }
  const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
  if (rotation.norm() < 1e-6) fail("found a quaternion of length zero");
  pose.world_from_body = Pose(rotation, {v[1], v[2], v[3]});
  return pose;
}

template <typename Stamped>
void sort_by_time(std::vector<Stamped>& items) {
  sort_stably(items, [](const Stamped& a, const Stamped& b) { return a.stamp < b.stamp; });
}

}  // namespace

Trajectory read_trajectory(const std::filesystem::path& path) {
  LineReader lines(path, turned_back(path));
  Trajectory poses;
  std::string line;
  while (lines.next(line)) {
    const std::vector<std::string_view> cells = split(line, " \t\r,;", true);
    if (cells.empty() || cells[0].front() == '#' || cells[0].front() == '%') continue;
    poses.push_back(parse_pose(cells, lines));
  }
  if (poses.empty()) {
    throw InputError(path.string(), "", "expected at least one pose, found none");
  }
  sort_by_time(poses);
  return poses;
}

std::vector<StampedVelocity> read_velocities(const std::filesystem::path& path) {
  CsvReader table(path, {"timestamp", "vx", "vy", "vz"}, {.edit = turned_back(path)});
  std::vector<StampedVelocity> rows;
  while (table.next()) {
    StampedVelocity row;
    if (!parse_stamp(table.text("timestamp"), row.stamp)) {
      table.fail("expected seconds in column 'timestamp'");
    }
    row.velocity_in_world = {table.number("vx"), table.number("vy"), table.number("vz")};
    if (row.velocity_in_world.allFinite()) rows.push_back(row);
  }
  sort_by_time(rows);
  return rows;
}

std::vector<StampedPoint> read_points(const std::filesystem::path& path) {
  CsvReader table(path, {"timestamp", "x", "y", "z"});
  std::vector<StampedPoint> rows;
  while (table.next()) {
    StampedPoint row;
    if (!parse_stamp(table.text("timestamp"), row.stamp)) {
      table.fail("expected seconds in column 'timestamp'");
    }
    row.point = {table.finite("x"), table.finite("y"), table.finite("z")};
    rows.push_back(row);
  }
  if (rows.empty()) {
    throw InputError(path.string(), "", "expected at least one place, found none");
  }
  sort_by_time(rows);
  return rows;
}

double path_length(const Trajectory& poses, std::size_t first, std::size_t last) {
  double length = 0.0;
  for (std::size_t i = first + 1; i <= last && i < poses.size(); ++i) {
    length += (poses[i].world_from_body.translation() - poses[i - 1].world_from_body.translation())
                  .norm();
  }
  return length;
}

}  // namespace understory
