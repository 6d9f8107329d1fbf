#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/recording.h"

namespace understory {

// A lidar of several, and how it is read.
struct LidarReader {
  std::string topic;
  std::unique_ptr<Recording> recording;  // the same one, with this lidar as its only one
  std::unique_ptr<Log> log;              // of that, which must not speak twice; null: of the first
};

// The recording of a machine with several lidars as one of a single lidar: the first one's with
// the points of all of them (ScanMerger). All other events are those of the first reader. The rig
// says where the others sit, from which their rays begin. A lidar that is silent for a second or
// dies leaves the others; it is named with the times ("recording.silent_lidar"). One that begins
// late joins ("recording.late_lidar"). Memory does not grow with the recording: each lidar is read
// by a reader of its own. `next` throws InputError where the place of a lidar is not known; if that
// begins late it is left out instead ("recording.late_sensor").
//   file: names the recording in messages
[[nodiscard]] std::unique_ptr<Recording> merge_lidars(const std::string& file,
                                                      std::vector<LidarReader> lidars, Log& log);

// A lidar that the options name, and its entry in the list of the extrinsics file.
struct NamedLidar {
  std::string topic;
  double late_s = 0.0;  // its stamps less those of the other sensors, as the file says it
  int entry = 0;
};
// Those of --lidar-topic A,B, else all that the extrinsics file lists; none where the options name
// none. Throws ConfigError where options and file contradict each other.
[[nodiscard]] std::vector<NamedLidar> named_lidars(const OpenOptions& options);
// How late the stamps of the first lidar are by the extrinsics file; seconds, 0 where it says
// nothing. Throws as `named_lidars`.
[[nodiscard]] double lateness_of(const OpenOptions& options);
// To open that one alone.
[[nodiscard]] OpenOptions options_for(const NamedLidar& lidar, const OpenOptions& options);

// How one lidar of a recording is opened, named by the options.
using OpenOneLidar = std::function<std::unique_ptr<Recording>(const OpenOptions&, Log&)>;

// Opens the lidar or the lidars that the options name: --lidar-topic A,B, else all that the
// extrinsics file lists, else the usual one. Each has the place and the lateness that the file
// says. Throws ConfigError where options and file contradict each other.
[[nodiscard]] std::unique_ptr<Recording> open_lidars(const std::string& file,
                                                     const OpenOptions& options,
                                                     const OpenOneLidar& open, Log& log);

}  // namespace understory
