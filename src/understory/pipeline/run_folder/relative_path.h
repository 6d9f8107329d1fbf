#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/geometry/pose.h"
#include "understory/util/files/record_file.h"
#include "understory/util/time.h"

namespace understory {

// One pose between scans, relative to a positioned scan before it: it moves with that scan.
struct RelativePose {
  TimeNs stamp = 0;
  std::uint64_t scan = 0;  // number of the scan, in the order of the journal
  Pose scan_from_body;     // body at `stamp`, in the body frame at the stamp of the scan
};

// Append-only file of poses between scans, so that memory does not grow with the length of a run.
// Not thread-safe.
class RelativePath {
 public:
  // Begins anew.
  explicit RelativePath(const std::filesystem::path& path);
  // Goes on behind the records that are `known`. Throws InputError where they are not there.
  RelativePath(const std::filesystem::path& path, const RecordCount& known);
  // In order of time.
  void add(const RelativePose& pose);
  // Waits until all poses are on the disk.
  void sync();
  // Of what was synced.
  [[nodiscard]] const RecordCount& count() const { return file_.count(); }
  // Hands over all poses in order. Throws InputError at the first record that is damaged.
  void for_each(const std::function<void(const RelativePose&)>& visit);

 private:
  void append_waiting();

  RecordFile file_;
  std::vector<RelativePose> waiting_;  // for their record
};

// Writes the poses as a TUM file: the pose of its scan in `scans`, times the motion since. Returns
// how many. Throws OutputError, and InputError where a record is damaged.
std::uint64_t write_relative_path(const std::filesystem::path& file, RelativePath& path,
                                  const Trajectory& scans);

}  // namespace understory
