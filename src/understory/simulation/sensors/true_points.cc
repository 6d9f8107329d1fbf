#include <limits>

#include "understory/simulation/sensors/scanner.h"

namespace understory {

std::vector<TruePoint> Scanner::true_points(const Scan& scan, const ScanReadings& readings) const {
  const TimeNs late = from_seconds(config_.time_offset_s);
  std::vector<TruePoint> points;
  points.reserve(scan.points.size());
  Pose world_from_lidar;
  TimeNs posed_at = std::numeric_limits<TimeNs>::min();
  const auto add = [&](const BeamReading& reading, const EchoSource& source) {
    if (!(reading.range_m > 0.0F)) return;
    const ScanPoint& point = scan.points[points.size()];
    const TimeNs stamp = scan.stamp + static_cast<TimeNs>(point.t_ns);
    if (stamp != posed_at) {
      world_from_lidar = path_.pose(to_seconds(stamp - late - start_)) * body_from_lidar_;
      posed_at = stamp;
    }
    const Eigen::Vector3d place(point.x, point.y, point.z);
    points.push_back({world_from_lidar * place, stamp, point.intensity, source});
  };
  for (std::size_t i = 0; i < readings.beams.size(); ++i) {
    add(readings.beams[i], readings.sources[i]);
    if (!readings.seconds.empty()) add(readings.seconds[i], readings.second_sources[i]);
  }
  return points;
}

}  // namespace understory
