#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/sparse_odometry.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/binary_io.h"

namespace understory {

// Takes what a run by stems has come to, in the order in which it came to it.
class ViewSink {
 public:
  virtual ~ViewSink() = default;
  virtual void on_pose(const StampedPose& pose, bool positioned) = 0;
  virtual void on_view(const StemView& view, const SparseStep& step) = 0;  // one that is kept
  virtual void on_fix(const GnssFix& fix) = 0;
};

// The same on disk, appended as the run goes, so that a killed run need not find it again. Bytes
// before the last `flush` survive a crash of the program. Throws OutputError where the disk is
// full. Not thread-safe.
class ViewJournal : public ViewSink {
 public:
  // Begins anew.
  explicit ViewJournal(std::filesystem::path path);
  // Goes on behind the first `bytes`, which are handed to `sink` once more; what follows them is
  // cut off. Throws InputError where there are fewer or they are damaged.
  ViewJournal(std::filesystem::path path, std::uint64_t bytes, ViewSink& sink);

  void on_pose(const StampedPose& pose, bool positioned) override;
  void on_view(const StemView& view, const SparseStep& step) override;
  void on_fix(const GnssFix& fix) override;
  void flush();
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  void append(const BinaryWriter& record);

  std::filesystem::path path_;
  std::ofstream file_;
  std::uint64_t bytes_ = 0;
};

}  // namespace understory
