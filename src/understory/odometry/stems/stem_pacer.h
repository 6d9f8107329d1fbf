#pragma once

#include <vector>

#include "understory/odometry/stems/stem_front_end.h"

namespace understory {

// How often a scan is positioned by its stems; those between are interpolated.
struct StemPaceConfig {
  double longest_gap_s = 1.0;  // between positioned scans; 0: every scan is positioned
  // How far a scan between two others may err, in standard deviations of a match. A match knows
  // its noise alone; with what it does not know a scan lies off by some times as much.
  double tolerance = 12.0;
};
void describe(ConfigTable& table, StemPaceConfig& config);

// The rate of positioning, by what the scans at hand allow (P0, contribution iii): while a body
// stands or moves evenly, ever more scans wait (1, 3, 7 ...) until one is positioned, and those
// between get their poses by powers of the motion. If that one does not lie where even motion would
// have led it, within the error of its own match, nothing is made of it. Those that waited are then
// positioned one after another, as if there had been no pause. Holds the scans of one gap, no more.
//
// Scans of a lidar whose lines sweep over its field of view (Livox) show no stem each. Half a
// second of them is gathered to one (gathered_scan.h), which is positioned at the last of its
// scans. The motion within that time is guessed from before, and then taken from its own match. Not
// thread-safe; deterministic.
class StemPacer {
 public:
  StemPacer(const StemPaceConfig& config, const StemFrontEndConfig& front_end, Log* log = nullptr)
      : config_(config), front_end_(front_end), samples_({}, log), log_(log) {}

  // Of the recording's IMU, in order, up to the end of the scan that is added next.
  void add(const ImuSample& sample) { samples_.add(sample); }

  // What became of the scans up to this one that are settled by now, in order; empty while they
  // wait. `positioned` of a scan between others is false: it has a pose and nothing else.
  [[nodiscard]] std::vector<StemScan> add(ScanPtr scan, const Rig& rig);
  // The rest, at the recording's end.
  [[nodiscard]] std::vector<StemScan> finish(const Rig& rig);
  [[nodiscard]] std::size_t scans_in_memory() const { return waiting_.size(); }
  [[nodiscard]] ImuTrust imu_trust() const { return front_end_.imu_trust(); }
  void refuse_imu() { front_end_.refuse_imu(); }

  // The whole state, bit for bit, between gaps only: no scan may wait. `load` in place of what was
  // added so far, same configuration.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  [[nodiscard]] std::vector<StemScan> settle(const Rig& rig);
  [[nodiscard]] std::vector<StemScan> settle_gathered(const Rig& rig);
  [[nodiscard]] bool even(const StemScan& last) const;
  [[nodiscard]] bool due(TimeNs stamp) const;

  StemPaceConfig config_;
  StemFrontEnd front_end_;
  ImuBuffer samples_;
  Log* log_;
  std::vector<ScanPtr> waiting_;
  int first_frame_ = 0;  // of those that wait
  int wait_ = 1;         // scans from one that is positioned to the next
  std::optional<StampedPose> last_;
  double period_s_ = 0.0;
  bool gathers_ = false;  // what waits; told by the first scan that does
};

}  // namespace understory
