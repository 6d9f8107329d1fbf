#include "understory/pipeline/mapping/sensor_traits.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "understory/pipeline/mapping/read_ahead.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace pipeline_constants::sensor_traits;

struct ScansSeen {
  std::vector<std::size_t> points;  // of each
  std::vector<TimeNs> stamps;
  std::size_t empty = 0;
  int rings = 0;

  void add(const Scan& scan) {
    points.push_back(scan.points.size());
    stamps.push_back(scan.stamp);
    empty += scan.points.size() < kEmptyScan ? 1 : 0;
    rings = std::max(rings, scan.ring_count);
  }
  [[nodiscard]] bool enough() const {
    return points.size() >= empty + kScans || points.size() >= kMostScans;
  }
};

std::size_t full_scan(const ScansSeen& seen) {
  std::vector<std::size_t> points = seen.points;
  if (points.empty()) return 0;
  std::sort(points.begin(), points.end(), std::greater<>());
  const std::size_t telling =
      points.size() > seen.empty ? points.size() - seen.empty : points.size();
  // Of two, none is more of an exception than the other.
  return points[telling > 2 ? 1 : 0];
}

double median_period_s(const std::vector<TimeNs>& stamps) {
  std::vector<TimeNs> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i)
    steps.push_back(stamps[i] - stamps[i - 1]);
  return steps.empty() ? 0.0 : to_seconds(upper_median(std::move(steps)));
}

}  // namespace

std::unique_ptr<Recording> learn_traits(std::unique_ptr<Recording> source, SensorTraits& traits) {
  std::deque<Event> events;
  ScansSeen seen;
  std::size_t samples = 0;
  while (!seen.enough() && events.size() < kMostEvents) {
    std::optional<Event> event = source->next();
    if (!event) break;
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) seen.add(**scan);
    samples += std::holds_alternative<ImuSample>(*event) ? 1 : 0;
    events.push_back(std::move(*event));
  }
  const Rig& rig = source->rig();
  traits = SensorTraits();
  traits.scan_points = full_scan(seen);
  traits.rings = seen.rings;
  traits.period_s = median_period_s(seen.stamps);
  if (!seen.stamps.empty()) traits.first_scan = seen.stamps.front();
  traits.imu_is_numb = samples == 0 && unusable_messages(*source, "imu") > 0;
  traits.has_imu = rig.body_from_imu.has_value() && !traits.imu_is_numb;
  traits.lidar_in_body = rig.body_from_lidar.translation();
  for (const FurtherLidar& further : rig.further_lidars) {
    traits.further_lidars_in_body.emplace_back(
        (rig.body_from_lidar * further.lidar_from_further).translation());
  }
  return std::make_unique<ReadAhead>(std::move(source), std::move(events));
}

std::string to_string(const SensorTraits& traits) {
  std::string text = "lidar: ";
  if (traits.scan_points == 0) return text + "unknown, as no scan came";
  text += fmt::format("{} points a scan", traits.scan_points);
  if (traits.rings > 0) text += fmt::format(", {} rings", traits.rings);
  if (traits.period_s > 0.0) text += fmt::format(", {:.1f} scans a second", 1.0 / traits.period_s);
  if (traits.imu_is_numb) return text + "; an IMU whose samples are not numbers";
  return text + (traits.has_imu ? "; with an IMU" : "; no IMU whose place is known");
}

void put_traits(BinaryWriter& writer, const SensorTraits& traits) {
  writer.put(traits.scan_points);
  writer.put(traits.rings);
  writer.put(traits.period_s);
  writer.put(traits.first_scan);
  writer.put(traits.has_imu);
  writer.put(traits.imu_is_numb);
  writer.put_doubles(traits.lidar_in_body.data(), 3);
  writer.put(static_cast<std::uint64_t>(traits.further_lidars_in_body.size()));
  for (const Eigen::Vector3d& place : traits.further_lidars_in_body)
    writer.put_doubles(place.data(), 3);
}

SensorTraits get_traits(BinaryReader& reader) {
  SensorTraits traits;
  traits.scan_points = reader.get<std::uint64_t>();
  traits.rings = reader.get<int>();
  traits.period_s = reader.get<double>();
  traits.first_scan = reader.get<TimeNs>();
  traits.has_imu = reader.get<bool>();
  traits.imu_is_numb = reader.get<bool>();
  reader.get_doubles(traits.lidar_in_body.data(), 3);
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    reader.get_doubles(traits.further_lidars_in_body.emplace_back().data(), 3);
  return traits;
}

}  // namespace understory
