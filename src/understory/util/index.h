#pragma once

#include <cstddef>

namespace understory {

// A number of views or frames, which is never negative, as an index into a container.
[[nodiscard]] constexpr std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

}  // namespace understory
