#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// Cuts the points of several lidars into common scans. Each lidar turns at its own rate. A common
// scan begins where a scan of the first lidar does. While that is silent, scans follow each other
// after the same time as before. A common scan holds all points of its time in the frame of the
// first lidar. They are in order of time where each lidar gives them so. Rings of lidar i count
// from i times kRingsALidar. Not thread-safe.
class ScanMerger {
 public:
  explicit ScanMerger(std::size_t lidars) : lidars_(lidars) {}

  // From the frame of a lidar into that of the first one; before its first scan is cut.
  void place(std::size_t lidar, const Pose& first_from_lidar);
  // A scan of a lidar, on the common clock.
  void add(std::size_t lidar, ScanPtr scan);
  // All points of the lidar before `until` have been added.
  void set_complete_until(std::size_t lidar, TimeNs until);

  // What comes next: a scan, or the lidar of which more has to be known first, or the end.
  struct Step {
    enum class Kind { kScan, kNeeds, kFinished };
    Kind kind = Kind::kFinished;
    std::size_t lidar = 0;
    ScanPtr scan;
  };
  [[nodiscard]] Step next();

  // When the next common scan begins; that of the earliest scan so far before the first one.
  [[nodiscard]] TimeNs begin() const;
  // Whether a common scan has been cut.
  [[nodiscard]] bool begun() const { return begun_; }
  // Points that came after the scan of their time had been cut, and were dropped.
  [[nodiscard]] std::uint64_t late_points() const { return late_points_; }

  // `load` in place of what was added so far, with the same number of lidars and their places.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

  static constexpr TimeNs kForever = INT64_MAX / 4;

 private:
  struct Lidar {
    Pose first_from_lidar;
    std::deque<ScanPtr> scans;
    TimeNs heard = -kForever;
    int ring_count = 0;  // of its last scan
  };

  [[nodiscard]] bool known(const Lidar& lidar, TimeNs until) const;
  // The first lidar that is not known so far, the last number first; lidars_.size() for none.
  [[nodiscard]] std::size_t unknown(TimeNs until) const;
  [[nodiscard]] TimeNs earliest() const;
  // Finds when scans begin and how long they last. The lidar that it needs more of, or none.
  [[nodiscard]] std::size_t start();
  [[nodiscard]] TimeNs end_of_scan() const;
  [[nodiscard]] ScanPtr cut(TimeNs end);
  void take_points(std::size_t number, TimeNs end, std::vector<ScanPoint>& points) const;

  std::vector<Lidar> lidars_;
  bool begun_ = false;
  TimeNs begin_ = 0;
  TimeNs period_ = 0;
  std::uint64_t late_points_ = 0;
};

}  // namespace understory
