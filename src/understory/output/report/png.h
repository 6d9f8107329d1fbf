#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace understory {

// A picture of at most 256 colours; rows from the top. Colour 0 is transparent.
struct PalettePicture {
  int width = 0;
  int height = 0;
  std::vector<std::array<std::uint8_t, 3>> palette;
  std::vector<std::uint8_t> pixels;

  std::uint8_t& at(int column, int row) {
    return pixels[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(column)];
  }
};

// PNG file bytes; the same picture gives the same bytes.
[[nodiscard]] std::string encode_png(const PalettePicture& picture);
[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace understory
