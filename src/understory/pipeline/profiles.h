#pragma once

#include <span>
#include <string_view>

namespace understory {

// A file of configs/ that the program carries with it.
struct ShippedProfile {
  std::string_view name;
  std::string_view yaml;
};

// The files of configs/profiles, built into the program (cmake/Embed.cmake).
[[nodiscard]] std::span<const ShippedProfile> shipped_profiles();

}  // namespace understory
