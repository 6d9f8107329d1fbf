#pragma once

#include <optional>

#include "understory/util/time.h"

namespace understory {

// A recording that tells when its events were recorded, by the recorder's clock.
class ArrivalTimes {
 public:
  virtual ~ArrivalTimes() = default;
  // Of the event that `next` gave last; nothing before the first.
  [[nodiscard]] virtual std::optional<TimeNs> arrival() const = 0;
};

}  // namespace understory
