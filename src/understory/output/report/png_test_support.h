#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace understory::test {

// A PNG with a palette, read back by the specification (PNG, second edition): every checksum is
// tested, no filter is expected.
struct DecodedPng {
  int width = 0;
  int height = 0;
  std::string palette;            // three bytes a colour
  std::string opacity;            // of the first colours
  std::vector<std::string> rows;  // from the top; a byte a pixel
};

inline std::uint32_t big_endian(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8U | static_cast<std::uint8_t>(bytes.at(at + i));
  return value;
}

inline DecodedPng decode_png(std::string_view bytes) {
  DecodedPng png;
  EXPECT_EQ(bytes.substr(0, 8), "\x89PNG\r\n\x1a\n");
  std::string packed;
  std::string last;
  for (std::size_t at = 8; at < bytes.size();) {
    const std::size_t size = big_endian(bytes, at);
    const std::string_view body = bytes.substr(at + 4, size + 4);
    const std::string_view data = body.substr(4);
    last = body.substr(0, 4);
    EXPECT_EQ(big_endian(bytes, at + 8 + size),
              crc32_z(0, reinterpret_cast<const Bytef*>(body.data()), body.size()))
        << last;
    if (last == "IHDR") {
      png.width = static_cast<int>(big_endian(data, 0));
      png.height = static_cast<int>(big_endian(data, 4));
      EXPECT_EQ(data.substr(8), std::string_view("\x08\x03\x00\x00\x00", 5));
    }
    if (last == "PLTE") png.palette = data;
    if (last == "tRNS") png.opacity = data;
    if (last == "IDAT") packed += data;
    at += size + 12;
  }
  EXPECT_EQ(last, "IEND");
  const auto line = static_cast<std::size_t>(png.width) + 1;
  std::string raw(line * static_cast<std::size_t>(png.height), '\1');
  uLongf length = raw.size();
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(raw.data()), &length,
                       reinterpret_cast<const Bytef*>(packed.data()), packed.size()),
            Z_OK);
  EXPECT_EQ(length, raw.size());
  for (std::size_t at = 0; at < raw.size(); at += line) {
    EXPECT_EQ(raw[at], '\0') << "no filter";
    png.rows.push_back(raw.substr(at + 1, line - 1));
  }
  return png;
}

}  // namespace understory::test
