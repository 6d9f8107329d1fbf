#include "understory/recording/bags/mcap_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "understory/recording/bags/compression.h"
#include "understory/recording/bags/mcap_format.h"
#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/message_schemas.h"
#include "understory/util/error.h"
#include "understory/util/files/output_file.h"
#include "understory/util/stable_sort.h"
#include "understory/util/version.h"

namespace understory {
namespace {

using TextMap = std::vector<std::pair<std::string, std::string>>;
using NumberMap = std::map<std::uint16_t, std::uint64_t>;

// A late subscriber of a replay must still get the one message on /tf_static.
constexpr const char* kLatchedQos =
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n"
    "  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false";

struct Topic {
  const char* name;
  const char* type;
};

enum TopicId : std::uint16_t {
  kLidar,
  kImu,
  kMag,
  kGnss,
  kGnssQuality,
  kTfStatic,
  kGnssNmea,
  kGnssSecond,
  kLivox,
  kSecondLidar,
  kTopicCount
};

constexpr std::array<Topic, kTopicCount> kTopics = {{
    {"/lidar", "sensor_msgs/msg/PointCloud2"},
    {"/imu", "sensor_msgs/msg/Imu"},
    {"/mag", "sensor_msgs/msg/MagneticField"},
    {"/gnss", "sensor_msgs/msg/NavSatFix"},
    {"/gnss/quality", "gps_msgs/msg/GPSFix"},
    {"/tf_static", "tf2_msgs/msg/TFMessage"},
    {"/gnss/nmea", "nmea_msgs/msg/Sentence"},
    {"/gnss/second", "sensor_msgs/msg/NavSatFix"},
    {"/livox/lidar", "livox_ros_driver2/msg/CustomMsg"},
    {"/lidar_2", "sensor_msgs/msg/PointCloud2"},
}};

// One record: content is added between construction and `close`.
class RecordWriter {
 public:
  RecordWriter(ByteBuffer& out, mcap::Opcode opcode) : out_(out) {
    out_.put(static_cast<std::uint8_t>(opcode));
    begin_ = out_.size();
    out_.put(std::uint64_t{0});
  }
  void put_map(const TextMap& map) {
    const std::size_t length_at = out_.size();
    out_.put(std::uint32_t{0});
    for (const auto& [key, value] : map) {
      out_.put_text(key);
      out_.put_text(value);
    }
    out_.overwrite(length_at, static_cast<std::uint32_t>(out_.size() - length_at - 4));
  }
  void put_map(const NumberMap& map) {
    out_.put(static_cast<std::uint32_t>(map.size() * 10));
    for (const auto& [key, value] : map) {
      out_.put(key);
      out_.put(value);
    }
  }
  void close() { out_.overwrite(begin_, std::uint64_t{out_.size() - begin_ - 8}); }

 private:
  ByteBuffer& out_;
  std::size_t begin_;
};

const char* name_of(McapCompression compression) {
  switch (compression) {
    case McapCompression::kLz4:
      return "lz4";
    case McapCompression::kZstd:
      return "zstd";
    default:
      return "";
  }
}

void put_schema(ByteBuffer& out, std::uint16_t topic) {
  RecordWriter record(out, mcap::kSchema);
  out.put(static_cast<std::uint16_t>(topic + 1));  // 0 means "no schema"
  out.put_text(kTopics[topic].type);
  out.put_text("ros2msg");
  out.put_text(ros2_schema(kTopics[topic].type));
  record.close();
}

void put_channel(ByteBuffer& out, std::uint16_t topic) {
  RecordWriter record(out, mcap::kChannel);
  out.put(topic);
  out.put(static_cast<std::uint16_t>(topic + 1));
  out.put_text(kTopics[topic].name);
  out.put_text("cdr");
  record.put_map(TextMap{{"offered_qos_profiles", topic == kTfStatic ? kLatchedQos : ""}});
  record.close();
}

struct ChunkEntry {
  std::uint64_t start = 0;
  std::uint64_t end = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  NumberMap message_indexes;
  std::uint64_t message_index_length = 0;
  std::uint64_t packed_size = 0;
  std::uint64_t size = 0;
};

struct MetadataEntry {
  std::string name;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
};

std::vector<NamedTransform> transforms_of(const Rig& rig) {
  std::vector<NamedTransform> transforms;
  const auto add = [&](const char* frame, const Pose& body_from_sensor) {
    if (rig.body_frame != frame) transforms.push_back({rig.body_frame, frame, body_from_sensor});
  };
  add("lidar", rig.body_from_lidar);
  for (std::size_t i = 0; i < rig.further_lidars.size(); ++i)
    add(further_lidar_frame(i).c_str(),
        rig.body_from_lidar * rig.further_lidars[i].lidar_from_further);
  if (rig.body_from_imu) add("imu", *rig.body_from_imu);
  if (rig.body_from_gnss) add("gnss", *rig.body_from_gnss);
  if (rig.body_from_second_gnss) add(kSecondAntennaFrame, *rig.body_from_second_gnss);
  return transforms;
}

}  // namespace

class McapWriter::Impl {
 public:
  Impl(const std::string& path, const McapWriterOptions& options) : options_(options), file_(path) {
    ByteBuffer head;
    head.put_bytes(mcap::kMagic);
    RecordWriter record(head, mcap::kHeader);
    head.put_text("ros2");
    head.put_text(std::string("understory ") + kVersion);
    record.close();
    file_.write(head.span());
  }

  void set_rig(const Rig& rig) {
    rig_ = rig;
    rig_pending_ = true;
  }

  void add(TopicId topic, TimeNs time, const ByteBuffer& message) {
    UNDERSTORY_CHECK(!finished_);
    const auto log_time = static_cast<std::uint64_t>(std::max<TimeNs>(time, 0));
    put_rig(log_time);
    put_message(topic, log_time, message);
  }

  // The number of beams and the model have no place in the messages.
  void note_ring_count(int ring_count) {
    if (sensor_noted_) return;
    sensor_noted_ = true;
    close_chunk();
    ByteBuffer out;
    RecordWriter record(out, mcap::kMetadata);
    out.put_text(mcap::kSensorMetadata);
    TextMap known{{"lidar_model", rig_.lidar_model},
                  {"ring_count", std::to_string(ring_count)},
                  {"body_frame", rig_.body_frame}};
    const auto merged = std::count_if(rig_.further_lidars.begin(), rig_.further_lidars.end(),
                                      [](const FurtherLidar& each) { return each.first_ring > 0; });
    if (merged > 0) known.emplace_back("merged_lidars", std::to_string(merged));
    record.put_map(known);
    record.close();
    metadata_.push_back({mcap::kSensorMetadata, file_.size(), out.size()});
    file_.write(out.span());
  }

  void add_scan(TimeNs time, const Scan& scan) {
    note_ring_count(scan.ring_count);
    if (options_.livox) return add(kLivox, time, encode_livox(scan));
    add(kLidar, time, encode_point_cloud2(scan));
  }

  void finish() {
    if (finished_) return;
    put_rig(0);
    close_chunk();
    finished_ = true;
    ByteBuffer out;
    put_data_end(out);
    const std::uint64_t summary_start = file_.size() + out.size();
    const std::size_t summary_in_buffer = out.size();
    put_summary(out, summary_start - summary_in_buffer);
    put_footer(out, summary_start, summary_in_buffer);
    out.put_bytes(mcap::kMagic);
    file_.write(out.span());
    file_.close();
  }

 private:
  void put_rig(std::uint64_t log_time) {
    if (!rig_pending_) return;
    rig_pending_ = false;
    const std::vector<NamedTransform> transforms = transforms_of(rig_);
    if (transforms.empty()) return;
    put_message(kTfStatic, log_time, encode_transforms(transforms, static_cast<TimeNs>(log_time)));
  }

  void put_message(TopicId topic, std::uint64_t log_time, const ByteBuffer& message) {
    if (index_[topic].empty()) {  // every chunk can be read without the others
      put_schema(chunk_, topic);
      put_channel(chunk_, topic);
    }
    index_[topic].emplace_back(log_time, chunk_.size());
    RecordWriter record(chunk_, mcap::kMessage);
    chunk_.put(static_cast<std::uint16_t>(topic));
    chunk_.put(static_cast<std::uint32_t>(counts_[topic]));  // sequence
    chunk_.put(log_time);
    chunk_.put(log_time);  // publish time
    chunk_.put_bytes(message.span());
    record.close();
    ++counts_[topic];
    chunk_start_ = std::min(chunk_start_, log_time);
    chunk_end_ = std::max(chunk_end_, log_time);
    if (chunk_.size() >= options_.chunk_size_bytes) close_chunk();
  }

  void close_chunk() {
    if (chunk_.empty()) return;
    const std::string method = name_of(options_.compression);
    std::vector<std::uint8_t> packed;
    ByteSpan stored = chunk_.span();
    if (!method.empty()) {
      packed = compress(stored, method, options_.zstd_level);
      stored = packed;
    }
    ChunkEntry entry;
    entry.start = chunk_start_;
    entry.end = chunk_end_;
    entry.offset = file_.size();
    entry.size = chunk_.size();
    entry.packed_size = stored.size();

    ByteBuffer out;
    RecordWriter record(out, mcap::kChunk);
    out.put(entry.start);
    out.put(entry.end);
    out.put(entry.size);
    out.put(crc32_of(chunk_.span()));
    out.put_text(method);
    out.put(entry.packed_size);
    out.put_bytes(stored);
    record.close();
    entry.length = out.size();
    put_message_indexes(out, entry);
    file_.write(out.span());
    chunks_.push_back(entry);
    chunk_.clear();
    chunk_start_ = std::numeric_limits<std::uint64_t>::max();
    chunk_end_ = 0;
  }

  void put_message_indexes(ByteBuffer& out, ChunkEntry& entry) {
    for (std::uint16_t topic = 0; topic < kTopicCount; ++topic) {
      if (index_[topic].empty()) continue;
      entry.message_indexes[topic] = entry.offset + out.size();
      sort_stably(index_[topic], std::less<>());
      RecordWriter record(out, mcap::kMessageIndex);
      out.put(topic);
      out.put(static_cast<std::uint32_t>(index_[topic].size() * 16));
      for (const auto& [time, offset] : index_[topic]) {
        out.put(time);
        out.put(offset);
      }
      record.close();
      index_[topic].clear();
    }
    entry.message_index_length = out.size() - entry.length;
  }

  void put_data_end(ByteBuffer& out) const {
    RecordWriter record(out, mcap::kDataEnd);
    out.put(file_.crc());
    record.close();
  }

  // `base` + position in `out` is the position in the file.
  void put_summary(ByteBuffer& out, std::uint64_t base) {
    struct Group {
      mcap::Opcode opcode;
      std::uint64_t start;
      std::uint64_t length;
    };
    std::vector<Group> groups;
    const auto group = [&](mcap::Opcode opcode, auto&& fill) {
      const std::uint64_t start = out.size();
      fill();
      if (out.size() > start) groups.push_back({opcode, base + start, out.size() - start});
    };
    group(mcap::kSchema, [&] {
      for (std::uint16_t topic = 0; topic < kTopicCount; ++topic)
        if (counts_[topic] > 0) put_schema(out, topic);
    });
    group(mcap::kChannel, [&] {
      for (std::uint16_t topic = 0; topic < kTopicCount; ++topic)
        if (counts_[topic] > 0) put_channel(out, topic);
    });
    group(mcap::kStatistics, [&] { put_statistics(out); });
    group(mcap::kChunkIndex, [&] { put_chunk_indexes(out); });
    group(mcap::kMetadataIndex, [&] { put_metadata_indexes(out); });
    summary_offset_start_ = base + out.size();
    for (const Group& each : groups) {
      RecordWriter record(out, mcap::kSummaryOffset);
      out.put(static_cast<std::uint8_t>(each.opcode));
      out.put(each.start);
      out.put(each.length);
      record.close();
    }
  }

  void put_statistics(ByteBuffer& out) const {
    NumberMap counts;
    std::uint64_t total = 0;
    for (std::uint16_t topic = 0; topic < kTopicCount; ++topic) {
      if (counts_[topic] > 0) counts[topic] = counts_[topic];
      total += counts_[topic];
    }
    std::uint64_t start = chunks_.empty() ? 0 : std::numeric_limits<std::uint64_t>::max();
    std::uint64_t end = 0;
    for (const ChunkEntry& chunk : chunks_) {
      start = std::min(start, chunk.start);
      end = std::max(end, chunk.end);
    }
    RecordWriter record(out, mcap::kStatistics);
    out.put(total);
    out.put(static_cast<std::uint16_t>(counts.size()));  // schemas
    out.put(static_cast<std::uint32_t>(counts.size()));  // channels
    out.put(std::uint32_t{0});                           // attachments
    out.put(static_cast<std::uint32_t>(metadata_.size()));
    out.put(static_cast<std::uint32_t>(chunks_.size()));
    out.put(start);
    out.put(end);
    record.put_map(counts);
    record.close();
  }

  void put_chunk_indexes(ByteBuffer& out) const {
    for (const ChunkEntry& chunk : chunks_) {
      RecordWriter record(out, mcap::kChunkIndex);
      out.put(chunk.start);
      out.put(chunk.end);
      out.put(chunk.offset);
      out.put(chunk.length);
      record.put_map(chunk.message_indexes);
      out.put(chunk.message_index_length);
      out.put_text(name_of(options_.compression));
      out.put(chunk.packed_size);
      out.put(chunk.size);
      record.close();
    }
  }

  void put_metadata_indexes(ByteBuffer& out) const {
    for (const MetadataEntry& entry : metadata_) {
      RecordWriter record(out, mcap::kMetadataIndex);
      out.put(entry.offset);
      out.put(entry.length);
      out.put_text(entry.name);
      record.close();
    }
  }

  void put_footer(ByteBuffer& out, std::uint64_t summary_start, std::size_t summary_in_buffer) {
    RecordWriter record(out, mcap::kFooter);
    out.put(summary_start);
    out.put(summary_offset_start_);
    const std::size_t crc_at = out.size();
    out.put(std::uint32_t{0});
    record.close();
    const ByteSpan covered = out.span().subspan(summary_in_buffer, crc_at - summary_in_buffer);
    out.overwrite(crc_at, crc32_of(covered));
  }

  McapWriterOptions options_;
  OutputFile file_;
  ByteBuffer chunk_;
  std::uint64_t chunk_start_ = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t chunk_end_ = 0;
  std::array<std::vector<std::pair<std::uint64_t, std::uint64_t>>, kTopicCount> index_;
  std::array<std::uint64_t, kTopicCount> counts_{};
  std::vector<ChunkEntry> chunks_;
  std::vector<MetadataEntry> metadata_;
  std::uint64_t summary_offset_start_ = 0;
  Rig rig_;
  bool rig_pending_ = false;
  bool sensor_noted_ = false;
  bool finished_ = false;
};

McapWriter::McapWriter(const std::string& path, const McapWriterOptions& options)
    : impl_(std::make_unique<Impl>(path, options)) {}

McapWriter::~McapWriter() {
  try {
    impl_->finish();
  } catch (const Error&) {
    // A caller who wants to know calls `finish`.
  }
}

void McapWriter::set_rig(const Rig& rig) {
  impl_->set_rig(rig);
}

void McapWriter::write(const Event& event) {
  write(event, event_time(event));
}

void McapWriter::write(const Event& event, TimeNs log_time) {
  if (const auto* scan = std::get_if<ScanPtr>(&event)) {
    impl_->add_scan(log_time, **scan);
  } else if (const auto* sample = std::get_if<ImuSample>(&event)) {
    impl_->add(kImu, log_time, encode_imu(*sample));
  } else if (const auto* fix = std::get_if<GnssFix>(&event)) {
    // Quality and heading first: a reader that has them completes the fix as soon as that comes.
    impl_->add(kGnssQuality, log_time, encode_gps_fix(*fix));
    if (std::isfinite(fix->heading_deg)) impl_->add(kGnssNmea, log_time, encode_heading(*fix));
    impl_->add(kGnss, log_time, encode_nav_sat_fix(*fix));
  } else {
    impl_->add(kMag, log_time, encode_magnetic_field(std::get<MagSample>(event)));
  }
}

void McapWriter::write_second_scan(const Scan& scan, TimeNs log_time) {
  impl_->add(kSecondLidar, log_time, encode_point_cloud2(scan, further_lidar_frame(0)));
}

void McapWriter::write_second_position(const GnssFix& fix, TimeNs log_time) {
  impl_->add(kGnssSecond, log_time, encode_nav_sat_fix(fix, kSecondAntennaFrame));
}

void McapWriter::finish() {
  impl_->finish();
}

}  // namespace understory
