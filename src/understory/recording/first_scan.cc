#include "understory/recording/first_scan.h"

#include <cmath>
#include <utility>

#include "understory/recording/messages/event_bytes.h"
#include "understory/util/time.h"

namespace understory {
namespace {

// Less does no harm: the next scan comes nearly when it should.
constexpr double kMostMissing = 0.1;

}  // namespace

void FinishedScans::add(ScanPtr scan, double missing) {
  if (scan == nullptr) return;
  if (!any_ && missing > kMostMissing) {
    part_ = std::move(scan);
    missing_ = missing;
  } else {
    settle_part(*scan);
    scans_.push_back(std::move(scan));
  }
  any_ = true;
}

// A first scan that lasts as long as the next one is whole. The lidar's view is limited then, and
// the turn began where it sees nothing.
void FinishedScans::settle_part(const Scan& next) {
  if (part_ == nullptr) return;
  const double usual = to_seconds(next.end() - next.stamp);
  if (to_seconds(part_->end() - part_->stamp) >= (1.0 - kMostMissing) * usual)
    scans_.push_back(std::move(part_));
  else
    drop_part();
  part_ = nullptr;
}

void FinishedScans::drop_part() {
  log_.warn("scan.part", source_ + ": begins within a turn of the lidar: its first scan, of " +
                             std::to_string(part_->points.size()) + " points, lacks " +
                             std::to_string(std::lround(100.0 * missing_)) +
                             " % of the turn and is left out");
}

ScanPtr FinishedScans::take() {
  if (scans_.empty()) return nullptr;
  ScanPtr scan = std::move(scans_.front());
  scans_.pop_front();
  return scan;
}

void FinishedScans::finish() {
  if (part_ != nullptr) scans_.push_back(std::move(part_));
  part_ = nullptr;
}

void FinishedScans::save(BinaryWriter& writer) const {
  writer.put(any_);
  put_scan(writer, part_);
  writer.put(missing_);
  writer.put(static_cast<std::uint64_t>(scans_.size()));
  for (const ScanPtr& scan : scans_)
    put_scan(writer, scan);
}

void FinishedScans::load(BinaryReader& reader) {
  any_ = reader.get<bool>();
  part_ = get_scan(reader);
  missing_ = reader.get<double>();
  scans_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    scans_.push_back(get_scan(reader));
}

}  // namespace understory
