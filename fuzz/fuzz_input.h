#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "understory/recording/bags/byte_source.h"

namespace understory {

inline std::unique_ptr<ByteSource> fuzz_source(const std::uint8_t* data, std::size_t size) {
  return bytes_in_memory(std::vector<std::uint8_t>(data, data + size), "fuzz");
}

}  // namespace understory
