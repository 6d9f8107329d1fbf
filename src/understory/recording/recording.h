#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/imu_sample.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// One thing that a recording holds. A scan's event time is the end of the scan (a scan is complete
// only then), any other event's its stamp.
using Event = std::variant<ScanPtr, ImuSample, GnssFix, MagSample>;
[[nodiscard]] TimeNs event_time(const Event& event);

// What was found out about one topic or stream while it was read, and by which convention.
struct TopicReport {
  std::string name;         // "/lidar", "udp 2368", "imu.csv"
  std::string type;         // "sensor_msgs/msg/PointCloud2", "velodyne packets"
  std::string frame;        // frame_id, empty if none
  std::string role;         // "lidar", "imu", "gnss", "mag", "tf", "ignored"
  std::string conventions;  // "t: uint32 ns since header stamp; stamp = first point"
  bool beside = false;      // from a log beside the recording, which may end at another time
  std::uint64_t messages = 0;
  TimeNs first_stamp = 0;
  TimeNs last_stamp = 0;
  TimeNs longest_gap = 0;
  std::uint64_t backward_steps = 0;  // stamps that go back in time
  std::uint64_t duplicates = 0;      // stamps equal to the one before
  std::uint64_t unreadable = 0;      // messages that could not be decoded
  std::uint64_t not_numbers = 0;     // messages that measure NaN or infinity, dropped
  std::uint64_t left_out = 0;        // messages of another sensor on the same topic
  std::uint64_t points = 0;          // lidar only
  std::uint64_t empty_points = 0;    // lidar only: NaN or zero range, dropped
};

// A recording opened for reading: a stream of events, in the order of the file. The stream may
// contain out-of-order and duplicate stamps: mending them is preprocess/'s work. One pass, memory
// independent of length. Not thread-safe.
class Recording {
 public:
  virtual ~Recording() = default;

  // The next event, or nothing at the end. Damage inside the file is passed over with a warning in
  // the Log given at opening (key "recording.damaged", with file and position). What follows it is
  // read as far as the format allows.
  [[nodiscard]] virtual std::optional<Event> next() = 0;

  // Reads past `count` events as `next` would; formats that can do it cheaper override it.
  virtual void skip(std::uint64_t count);

  // Writes where the reading stands, between two calls of `next`: all that decides what `next`,
  // `rig` and `topics` give from there on. False, with nothing written, where a recording cannot
  // tell; `skip` leads there then.
  [[nodiscard]] virtual bool save(BinaryWriter& writer) const;
  // Goes to where `save` stood, in a recording that was opened in the same way just now. Reads no
  // more than what the reading was at work on there (a chunk, a file). Throws InputError where the
  // recording does not hold what it held then.
  virtual void load(BinaryReader& reader);

  // What is known so far of the sensors and the streams. The rig is complete once the first scan
  // has been returned; reports grow with the reading.
  [[nodiscard]] virtual const Rig& rig() const = 0;
  [[nodiscard]] virtual std::vector<TopicReport> topics() const = 0;
  // "MCAP (ros2, zstd)", "ROS 1 bag (lz4)", "PCAP (Ouster OS-1-128)", "folder of .bin clouds".
  [[nodiscard]] virtual std::string format() const = 0;
  // How much has been read, 0 to 1; 0 where not known.
  [[nodiscard]] virtual double progress() const = 0;
};

// How many messages of sensors with this role ("imu") were dropped so far because they are not
// whole or measure no numbers.
[[nodiscard]] std::uint64_t unusable_messages(const Recording& recording, const std::string& role);

// What the user tells of a recording that it does not tell itself.
struct OpenOptions {
  double rate_hz = 0.0;       // scans per second of a folder of clouds; 0 = not given
  std::string metadata_file;  // Ouster metadata JSON; empty = look beside the capture
  // Empty = the first (only) one, or all that the extrinsics file lists. Several, separated by
  // commas, are merged into one scan.
  std::string lidar_topic;
  std::string imu_topic;
  std::string gnss_topic;
  std::string extrinsics_file;  // YAML with body_from_lidar etc.; overrides the recording
  int lidar_entry = 0;          // of the file's list of lidars: that of the lidar that is read
};

// Opens a recording by what is in it, not by its name. Kinds are MCAP, ROS 1 bag, ROS 2 .db3 (file
// or bag folder), PCAP/PCAPNG, a folder of clouds, and one cloud. Several lidars are merged
// (lidars/ merged_lidars.h). Throws InputError (exit code 3) if the file is missing, empty or of no
// known kind.
[[nodiscard]] std::unique_ptr<Recording> open_recording(const std::string& path,
                                                        const OpenOptions& options, Log& log);

}  // namespace understory
