#pragma once

#include <cstdint>

#include "understory/recording/recording.h"

namespace understory {

// A number that is the same for two messages of a stream with the same content, whatever their
// stamps. But for chance, no others have it. Of a scan see scan_content.h; of other sensors what
// they measured counts, not how certain they say it is.
[[nodiscard]] std::uint64_t content_of(const Event& event);

}  // namespace understory
