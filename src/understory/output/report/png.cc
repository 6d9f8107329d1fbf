#include "understory/output/report/png.h"

#include <zlib.h>

#include "understory/util/error.h"

namespace understory {
namespace {

void append_be32(std::string& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out += static_cast<char>(value >> shift & 0xffU);
}

void append_chunk(std::string& out, const std::string& kind, const std::string& data) {
  append_be32(out, static_cast<std::uint32_t>(data.size()));
  const std::string body = kind + data;
  out += body;
  append_be32(out, static_cast<std::uint32_t>(
                       crc32_z(0, reinterpret_cast<const Bytef*>(body.data()), body.size())));
}

std::string deflated(const std::string& raw) {
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::string packed(size, '\0');
  UNDERSTORY_CHECK(compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                             reinterpret_cast<const Bytef*>(raw.data()),
                             static_cast<uLong>(raw.size()), Z_DEFAULT_COMPRESSION) == Z_OK);
  packed.resize(size);
  return packed;
}

}  // namespace

std::string encode_png(const PalettePicture& picture) {
  std::string out = "\x89PNG\r\n\x1a\n";
  std::string head;
  append_be32(head, static_cast<std::uint32_t>(picture.width));
  append_be32(head, static_cast<std::uint32_t>(picture.height));
  head += std::string("\x08\x03\x00\x00\x00", 5);  // 8 bits, palette
  append_chunk(out, "IHDR", head);
  std::string palette;
  for (const auto& colour : picture.palette) {
    for (const std::uint8_t part : colour)
      palette += static_cast<char>(part);
  }
  append_chunk(out, "PLTE", palette);
  append_chunk(out, "tRNS", std::string(1, '\0'));
  std::string raw;
  raw.reserve(picture.pixels.size() + static_cast<std::size_t>(picture.height));
  for (int row = 0; row < picture.height; ++row) {
    raw += '\0';  // no filter
    raw.append(reinterpret_cast<const char*>(picture.pixels.data()) +
                   static_cast<std::size_t>(row) * static_cast<std::size_t>(picture.width),
               static_cast<std::size_t>(picture.width));
  }
  append_chunk(out, "IDAT", deflated(raw));
  append_chunk(out, "IEND", "");
  return out;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve(4 * (bytes.size() + 2) / 3);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      three = three << 8U;
      if (i + j < bytes.size()) three |= static_cast<std::uint8_t>(bytes[i + j]);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      const std::uint32_t part = three >> (18U - 6U * j) & 63U;
      out += i + j <= bytes.size() ? kLetters[part] : '=';
    }
  }
  return out;
}

}  // namespace understory
