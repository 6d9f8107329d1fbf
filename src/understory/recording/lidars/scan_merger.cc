#include "understory/recording/lidars/scan_merger.h"

#include <Eigen/Core>
#include <algorithm>
#include <memory>
#include <utility>

#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/recording_constants.h"
#include "understory/sensor/rig.h"
#include "understory/util/error.h"

namespace understory {

using namespace recording_constants::scan_merger;

namespace {

bool before(const ScanPoint& a, const ScanPoint& b) {
  return a.t_ns < b.t_ns;
}

}  // namespace

void ScanMerger::place(std::size_t lidar, const Pose& first_from_lidar) {
  lidars_[lidar].first_from_lidar = first_from_lidar;
}

void ScanMerger::add(std::size_t number, ScanPtr scan) {
  Lidar& lidar = lidars_[number];
  lidar.heard = std::max(lidar.heard, scan->end());
  lidar.ring_count = scan->ring_count;
  if (begun_) {
    for (const ScanPoint& point : scan->points)
      late_points_ += scan->stamp + static_cast<TimeNs>(point.t_ns) < begin_ ? 1 : 0;
  }
  lidar.scans.push_back(std::move(scan));
}

void ScanMerger::set_complete_until(std::size_t lidar, TimeNs until) {
  lidars_[lidar].heard = std::max(lidars_[lidar].heard, until);
}

bool ScanMerger::known(const Lidar& lidar, TimeNs until) const {
  return lidar.heard >= until || (!lidar.scans.empty() && lidar.scans.back()->stamp >= until);
}

std::size_t ScanMerger::unknown(TimeNs until) const {
  for (std::size_t i = lidars_.size(); i-- > 0;) {
    if (!known(lidars_[i], until)) return i;
  }
  return lidars_.size();
}

TimeNs ScanMerger::earliest() const {
  TimeNs first = kForever;
  for (const Lidar& lidar : lidars_) {
    if (!lidar.scans.empty()) first = std::min(first, lidar.scans.front()->stamp);
  }
  return first;
}

TimeNs ScanMerger::begin() const {
  return begun_ ? begin_ : earliest();
}

std::size_t ScanMerger::start() {
  for (std::size_t i = lidars_.size(); i-- > 0;) {
    if (lidars_[i].scans.empty() && lidars_[i].heard == -kForever) return i;
  }
  const TimeNs first = earliest();
  if (const std::size_t i = unknown(first); i < lidars_.size()) return i;
  if (first == kForever) return lidars_.size();
  // The first lidar leads, or one that begins long before it.
  std::size_t leader = 0;
  for (std::size_t i = lidars_.size(); i-- > 0;) {
    const std::deque<ScanPtr>& scans = lidars_[i].scans;
    if (!scans.empty() && scans.front()->stamp < first + kLongestPeriod) leader = i;
  }
  const std::deque<ScanPtr>& scans = lidars_[leader].scans;
  if (scans.size() < kScansForPeriod && !known(lidars_[leader], first + 4 * kLongestPeriod))
    return leader;
  // The first of its scans may be a part of a turn.
  period_ = 0;
  for (std::size_t i = 1; i < scans.size(); ++i)
    period_ = std::max(period_, scans[i]->stamp - scans[i - 1]->stamp);
  if (period_ <= 0) period_ = kUsualPeriodNs;
  period_ = std::clamp(period_, kShortestPeriod, kLongestPeriod);
  begin_ = first;
  begun_ = true;
  return lidars_.size();
}

TimeNs ScanMerger::end_of_scan() const {
  for (const ScanPtr& scan : lidars_.front().scans) {
    const TimeNs after = scan->stamp - begin_;
    if (2 * after >= period_ && 2 * after <= 3 * period_) return scan->stamp;
  }
  return begin_ + period_;
}

void ScanMerger::take_points(std::size_t number, TimeNs end, std::vector<ScanPoint>& points) const {
  const Lidar& lidar = lidars_[number];
  const Eigen::Matrix3f rotation = lidar.first_from_lidar.rotation_matrix().cast<float>();
  const Eigen::Vector3f place = lidar.first_from_lidar.translation().cast<float>();
  const auto first_ring = static_cast<std::uint16_t>(number * kRingsALidar);
  for (const ScanPtr& scan : lidar.scans) {
    for (const ScanPoint& point : scan->points) {
      const TimeNs time = scan->stamp + static_cast<TimeNs>(point.t_ns);
      if (time < begin_ || time >= end) continue;
      ScanPoint& moved = points.emplace_back(point);
      moved.t_ns = static_cast<std::uint32_t>(time - begin_);
      if (number == 0) continue;  // bit for bit as it was
      const Eigen::Vector3f at = rotation * Eigen::Vector3f(point.x, point.y, point.z) + place;
      moved.x = at.x();
      moved.y = at.y();
      moved.z = at.z();
      moved.ring = static_cast<std::uint16_t>(
          first_ring + std::min<std::uint16_t>(point.ring, kRingsALidar - 1));
    }
  }
}

ScanPtr ScanMerger::cut(TimeNs end) {
  auto merged = std::make_shared<Scan>();
  merged->stamp = begin_;
  bool in_order = true;
  for (std::size_t i = 0; i < lidars_.size(); ++i) {
    Lidar& lidar = lidars_[i];
    const auto middle = static_cast<std::ptrdiff_t>(merged->points.size());
    take_points(i, end, merged->points);
    const auto begin = merged->points.begin();
    in_order = in_order && std::is_sorted(begin + middle, merged->points.end(), before);
    if (in_order) std::inplace_merge(begin, begin + middle, merged->points.end(), before);
    merged->ring_count += lidar.ring_count;
    // A lidar that is covered sends scans without points, which tell no times.
    for (const ScanPtr& scan : lidar.scans)
      merged->has_point_times =
          merged->has_point_times && (scan->has_point_times || scan->points.empty());
    std::erase_if(lidar.scans, [&](const ScanPtr& scan) { return scan->end() < end; });
  }
  begin_ = end;
  return merged->points.empty() ? nullptr : ScanPtr(std::move(merged));
}

ScanMerger::Step ScanMerger::next() {
  if (!begun_) {
    if (const std::size_t i = start(); i < lidars_.size()) return {Step::Kind::kNeeds, i, nullptr};
    if (!begun_) return {};  // none gives anything
  }
  for (;;) {
    if (!known(lidars_.front(), begin_ + 3 * period_ / 2)) return {Step::Kind::kNeeds, 0, nullptr};
    const TimeNs end = end_of_scan();
    if (const std::size_t i = unknown(end); i < lidars_.size())
      return {Step::Kind::kNeeds, i, nullptr};
    if (ScanPtr scan = cut(end)) return {Step::Kind::kScan, 0, std::move(scan)};
    // Nothing was measured then: on to what is known next.
    TimeNs next = kForever;
    for (const Lidar& lidar : lidars_)
      next = std::min(next, lidar.scans.empty() ? lidar.heard : lidar.scans.front()->stamp);
    if (next == kForever) return {};
    begin_ = std::max(begin_, next);
  }
}

void ScanMerger::save(BinaryWriter& writer) const {
  writer.put(begun_);
  writer.put(begin_);
  writer.put(period_);
  writer.put(late_points_);
  for (const Lidar& lidar : lidars_) {
    writer.put(lidar.heard);
    writer.put(lidar.ring_count);
    writer.put(static_cast<std::uint64_t>(lidar.scans.size()));
    for (const ScanPtr& scan : lidar.scans)
      put_scan(writer, scan);
  }
}

void ScanMerger::load(BinaryReader& reader) {
  begun_ = reader.get<bool>();
  begin_ = reader.get<TimeNs>();
  period_ = reader.get<TimeNs>();
  late_points_ = reader.get<std::uint64_t>();
  for (Lidar& lidar : lidars_) {
    lidar.heard = reader.get<TimeNs>();
    lidar.ring_count = reader.get<int>();
    lidar.scans.clear();
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
      ScanPtr scan = get_scan(reader);
      if (scan == nullptr) throw InputError("checkpoint", "scans of lidars", "expected a scan");
      lidar.scans.push_back(std::move(scan));
    }
  }
}

}  // namespace understory
