#include "understory/recording/captures/scan_assembly.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>

#include "understory/util/error.h"

namespace understory {

void GrowingScan::add(const ScanPoint& point, TimeNs time) {
  points_.push_back(point);
  times_.push_back(time);
}

ScanPtr GrowingScan::take(int ring_count) {
  ScanPtr result;
  if (!points_.empty()) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = *std::min_element(times_.begin(), times_.end());
    scan->ring_count = ring_count;
    scan->points.reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const TimeNs t = times_[i] - scan->stamp;
      if (t > std::numeric_limits<std::uint32_t>::max()) continue;
      scan->points.push_back(points_[i]);
      scan->points.back().t_ns = static_cast<std::uint32_t>(t);
    }
    result = std::move(scan);
  }
  points_.clear();
  times_.clear();
  return result;
}

void GrowingScan::save(BinaryWriter& writer) const {
  writer.put(points_);
  writer.put(times_);
}

void GrowingScan::load(BinaryReader& reader, const std::string& source) {
  points_ = reader.get_vector<ScanPoint>();
  times_ = reader.get_vector<TimeNs>();
  if (points_.size() != times_.size())
    throw InputError(source, "", "expected as many times as points of the scan in progress");
}

}  // namespace understory
