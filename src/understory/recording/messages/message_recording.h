#pragma once

#include <memory>
#include <string>

#include "understory/recording/messages/message_source.h"
#include "understory/recording/recording.h"

namespace understory {

// A recording made of ROS messages in any container. It looks at the first seconds to find the
// topics, the conventions of the points' times, the accelerometer's unit and the extrinsics. Then
// it reads from the start. `file` is for messages; the log must outlive the recording. Throws as
// open_recording does.
[[nodiscard]] std::unique_ptr<Recording> open_messages(const std::string& file,
                                                       const MessageSourceFactory& open,
                                                       const OpenOptions& options, Log& log);

}  // namespace understory
