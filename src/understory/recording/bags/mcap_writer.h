#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// How the chunks of an MCAP file are compressed.
enum class McapCompression { kNone, kLz4, kZstd };

// How an MCAP file is written.
struct McapWriterOptions {
  McapCompression compression = McapCompression::kZstd;
  int zstd_level = 1;  // 1..19
  // A chunk is closed once it holds that much; a damaged chunk is lost as a whole.
  std::size_t chunk_size_bytes = 1U << 20;
  bool livox = false;  // scans as livox_ros_driver2/CustomMsg on /livox/lidar
};

// Writes the project's native recording: MCAP with ROS 2 messages (CDR), chunks with CRC, message
// and chunk indexes, statistics and a summary. The topics are /lidar, /imu, /mag, /gnss,
// /gnss/quality, /gnss/nmea, /gnss/second and /tf_static. A message's log time is its event_time (a
// scan's is its end) unless another is given. Readers sort by it.
//
// Events are to be written in the order of their log times; other orders are kept as they come.
// Every method throws OutputError if the file cannot be written (disk full, no permission). What
// was written before stays readable: an unfinished file is read up to its last whole chunk. Not
// thread-safe.
class McapWriter {
 public:
  explicit McapWriter(const std::string& path, const McapWriterOptions& options = {});
  // Finishes the file if `finish` was not called; errors are swallowed then.
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Goes out as /tf_static (body frame to each sensor whose place is known) before the next event.
  // Again where a place becomes known later.
  void set_rig(const Rig& rig);

  void write(const Event& event);  // a fix goes to /gnss/quality and /gnss
  // `log_time`: when the event was recorded, where a recording is copied. The order of arrival
  // tells how the clocks of the sensors run (preprocess/streams/stream_offset.h).
  void write(const Event& event, TimeNs log_time);

  // A scan of a second lidar, on /lidar_2 in the frame lidar_2; the rig has its place.
  void write_second_scan(const Scan& scan, TimeNs log_time);

  // A position of the second antenna, on /gnss/second in the frame gnss_second. The fix of the
  // first one, without a heading, is to be written before it.
  void write_second_position(const GnssFix& fix, TimeNs log_time);

  // Closes the last chunk, writes index and summary, and syncs the file to the disk.
  void finish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
