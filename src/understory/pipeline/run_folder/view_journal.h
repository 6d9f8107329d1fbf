#pragma once

#include <cstdint>
#include <filesystem>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/record_file.h"

namespace understory {

// Takes what a run by stems has come to, in the order in which it came to it.
class ViewSink {
 public:
  virtual ~ViewSink() = default;
  virtual void on_pose(const StampedPose& pose, bool positioned) = 0;
  virtual void on_view(const StemView& view, const SparseStep& step) = 0;  // one that is kept
  virtual void on_fix(const GnssFix& fix) = 0;
};

// The same on disk, appended as the run goes, so that a killed run need not find it again. Throws
// OutputError where the disk is full. Not thread-safe.
class ViewJournal : public ViewSink {
 public:
  // Begins anew.
  explicit ViewJournal(std::filesystem::path path);
  // Goes on behind what is `known`, which is handed to `sink` once more; what follows it is cut
  // off. Throws InputError where there is less or it is damaged.
  ViewJournal(std::filesystem::path path, const RecordCount& known, ViewSink& sink);

  void on_pose(const StampedPose& pose, bool positioned) override;
  void on_view(const StemView& view, const SparseStep& step) override;
  void on_fix(const GnssFix& fix) override;
  // Hands over all of it, from the beginning. Throws InputError where it is damaged.
  void replay(ViewSink& sink) const;
  // Waits until everything is on the disk.
  void sync() { file_.sync(); }
  [[nodiscard]] const RecordCount& count() const { return file_.count(); }

 private:
  void append(const BinaryWriter& record);

  RecordFile file_;
};

}  // namespace understory
