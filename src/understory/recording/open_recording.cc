#include <filesystem>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/mcap_format.h"
#include "understory/recording/bags/mcap_reader.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/bags/rosbag_reader.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/recording/clouds/cloud_folder.h"
#include "understory/recording/lidars/merged_lidars.h"
#include "understory/recording/messages/message_recording.h"
#include "understory/recording/recording.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr const char* kKnownKinds =
    "expected MCAP, a ROS 1 bag, a ROS 2 bag (.db3 or folder), PCAP, a cloud (.pcd, .ply, .las, "
    ".laz, .bin) or a folder of clouds";

constexpr std::string_view kSqliteMagic = "SQLite format 3";
constexpr std::string_view kZstdMagic = "\x28\xB5\x2F\xFD";

bool starts_with(ByteSpan head, std::string_view magic) {
  return head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0;
}

std::unique_ptr<Recording> open_bag(const std::string& path, const OpenOptions& options, Log& log) {
  const auto unpacked = std::make_shared<UnpackedParts>();
  return open_messages(
      path, [path, unpacked](Log& sink) { return read_ros2_bag(path, unpacked, sink); }, options,
      log);
}

std::unique_ptr<Recording> open_file_recording(const std::string& path, const OpenOptions& options,
                                               Log& log) {
  const auto file = open_file(path);
  if (file->size() == 0) throw InputError(path, "", "the file is empty");
  std::vector<std::uint8_t> head;
  file->read(0, 32, head);
  const std::string_view mcap_magic(reinterpret_cast<const char*>(mcap::kMagic),
                                    sizeof(mcap::kMagic));
  if (starts_with(head, mcap_magic))
    return open_messages(
        path, [path](Log& sink) { return read_mcap(open_file(path), sink); }, options, log);
  if (starts_with(head, kRosbagMagic))
    return open_messages(
        path, [path](Log& sink) { return read_rosbag(open_file(path), sink); }, options, log);
  if (starts_with(head, kSqliteMagic))
    return open_messages(
        path, [path](Log& sink) { return read_db3(path, sink); }, options, log);
  if (starts_with(head, kZstdMagic) && fs::path(path).extension() == ".zstd")
    return open_bag(path, options, log);
  if (is_pcap(path)) return open_pcap(path, options, log);
  if (is_cloud_file(path)) return open_cloud_folder(path, options, log);
  throw InputError(path, "at byte 0", kKnownKinds);
}

std::unique_ptr<Recording> open_folder_recording(const std::string& path,
                                                 const OpenOptions& options, Log& log) {
  if (is_ros2_bag_folder(path)) return open_bag(path, options, log);
  if (is_cloud_folder(path)) return open_cloud_folder(path, options, log);
  throw InputError(path, "", kKnownKinds);
}

std::unique_ptr<Recording> open_as_found(const std::string& path, const OpenOptions& options,
                                         Log& log) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found)
    throw InputError(path, "", "no such file or folder");
  if (error) throw InputError(path, "", error.message());
  if (fs::is_directory(status)) return open_folder_recording(path, options, log);
  return open_file_recording(path, options, log);
}

}  // namespace

std::unique_ptr<Recording> open_recording(const std::string& path, const OpenOptions& options,
                                          Log& log) {
  const auto open = [&](const OpenOptions& of_lidar, Log& own) {
    return open_as_found(path, of_lidar, own);
  };
  return open_lidars(path, options, open, log);
}

}  // namespace understory
