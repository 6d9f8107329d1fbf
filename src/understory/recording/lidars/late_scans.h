#pragma once

#include <memory>

#include "understory/recording/recording.h"

namespace understory {

// The recording with the stamps of its scans set back by so much: the clock of the lidar is late.
// All else is as it was.
[[nodiscard]] std::unique_ptr<Recording> without_lateness(std::unique_ptr<Recording> recording,
                                                          double late_s);

}  // namespace understory
