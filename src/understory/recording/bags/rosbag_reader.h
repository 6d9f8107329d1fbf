#pragma once

#include <memory>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/messages/message_source.h"

namespace understory {

inline constexpr const char* kRosbagMagic = "#ROSBAG V2.0\n";

// Reads the messages of a ROS 1 bag, version 2.0: chunks without compression, bz2 or lz4, with or
// without index. Bags may be truncated or damaged: the next chunk that makes sense is looked for,
// as the format has no checksums. Throws InputError if the magic is missing. The log must outlive
// it.
[[nodiscard]] std::unique_ptr<MessageSource> read_rosbag(std::unique_ptr<ByteSource> file,
                                                         Log& log);

}  // namespace understory
