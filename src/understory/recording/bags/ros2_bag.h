#pragma once

#include <memory>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/unpacked_file.h"
#include "understory/recording/messages/message_source.h"

namespace understory {

// Reads the messages of one ROS 2 bag file in SQLite (.db3), by time. Messages compressed with zstd
// one by one are unpacked. A damaged file is read row by row as far as its pages allow. Throws
// InputError if the file is no SQLite database with the tables of a bag.
[[nodiscard]] std::unique_ptr<MessageSource> read_db3(const std::string& path, Log& log);
// The same of a file alone, without what a journal beside it may hold.
[[nodiscard]] std::unique_ptr<MessageSource> read_db3(std::unique_ptr<ByteSource> bytes, Log& log);
// The same from memory.
[[nodiscard]] std::unique_ptr<MessageSource> read_db3(std::vector<std::uint8_t> bytes,
                                                      const std::string& name, Log& log);

// Whether the folder holds the files of a ROS 2 bag (.db3, .mcap, both also with .zstd).
[[nodiscard]] bool is_ros2_bag_folder(const std::string& path);
// The files that a bag's metadata.yaml names. Throws ConfigError if it cannot be understood.
[[nodiscard]] std::vector<std::string> bag_file_names(const std::string& metadata,
                                                      const std::string& origin);
// The files of a bag that its metadata.yaml names, that are there and that lie outside its folder.
// None of what is no folder of a bag. Paths are absolute where the folder's is, or the name.
[[nodiscard]] std::vector<std::string> bag_parts_outside(const std::string& path);
// The files of the bag's folder one after the other, .db3 or .mcap; or one such file. Those with
// .zstd behind the name are unpacked while they are read. A part that is damaged is read as far as
// it goes, one that cannot be opened is left out with a warning.
[[nodiscard]] std::unique_ptr<MessageSource> read_ros2_bag(const std::string& path,
                                                           std::shared_ptr<UnpackedParts> unpacked,
                                                           Log& log);

}  // namespace understory
