#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"

namespace understory {

// What the variable length records behind the header of a LAS file tell.
struct LasVlrs {
  std::string coordinate_system;  // "EPSG:25832", WKT, or empty
  // The first extra bytes of a point are tree_id and HeightAboveGround, as LasWriter writes them.
  bool trees = false;
};

// `count` records from byte `at` on; what is damaged or cut off is left out.
[[nodiscard]] LasVlrs read_las_vlrs(ByteSource& file, std::uint64_t at, std::uint32_t count);

namespace las_bytes {

inline constexpr std::size_t kVlrHeader = 54;
inline constexpr std::uint32_t kMostVlrs = 4096;

// The number at byte `at`; 0 where the bytes end before.
template <typename T>
[[nodiscard]] T get(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  T value{};
  if (at + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// Text that ends with a zero, or after `size` bytes.
[[nodiscard]] inline std::string text_of(const std::vector<std::uint8_t>& bytes, std::size_t at,
                                         std::size_t size) {
  std::string text;
  for (std::size_t i = at; i < std::min(at + size, bytes.size()) && bytes[i] != 0; ++i)
    text.push_back(static_cast<char>(bytes[i]));
  return text;
}

}  // namespace las_bytes
}  // namespace understory
