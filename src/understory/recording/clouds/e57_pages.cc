#include "understory/recording/clouds/e57_pages.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace understory {
namespace {

constexpr std::size_t kPage = 1024;
constexpr std::size_t kPayload = kPage - 4;

// CRC-32C (Castagnoli, reflected), eight bytes at a time.
using CrcTables = std::array<std::array<std::uint32_t, 256>, 8>;

constexpr CrcTables make_crc_tables() {
  constexpr std::uint32_t kPolynomial = 0x82F63B78U;
  CrcTables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? kPolynomial : 0U);
    tables[0][byte] = crc;
  }
  for (std::size_t k = 1; k < 8; ++k) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t before = tables[k - 1][byte];
      tables[k][byte] = (before >> 8U) ^ tables[0][before & 0xFFU];
    }
  }
  return tables;
}

std::uint32_t crc32c(const std::uint8_t* bytes, std::size_t count) {
  static constexpr CrcTables kTables = make_crc_tables();
  std::uint32_t crc = ~0U;
  for (; count >= 8; count -= 8, bytes += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, sizeof(word));
    word ^= crc;
    crc = 0;
    for (std::size_t k = 0; k < 8; ++k)
      crc ^= kTables[7 - k][(word >> (8 * k)) & 0xFFU];
  }
  for (; count > 0; --count, ++bytes)
    crc = (crc >> 8U) ^ kTables[0][(crc ^ *bytes) & 0xFFU];
  return ~crc;
}

// The checksum is stored with its first byte highest, unlike all other numbers of the file.
std::uint32_t stored_checksum(const std::uint8_t* bytes) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k)
    value = (value << 8U) | bytes[k];
  return value;
}

}  // namespace

bool E57Pages::load(std::uint64_t page) {
  if (page == loaded_) return true;
  loaded_ = ~std::uint64_t{0};
  page_.resize(kPage);
  if (file_.read(page * kPage, page_.data(), kPage) < kPage) return false;
  if (crc32c(page_.data(), kPayload) != stored_checksum(page_.data() + kPayload)) {
    damaged_at_ = static_cast<std::int64_t>(page * kPage);
    return false;
  }
  loaded_ = page;
  return true;
}

std::size_t E57Pages::read(std::uint64_t physical, std::uint8_t* into, std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    const std::size_t within = physical % kPage;
    if (within >= kPayload || !load(physical / kPage)) break;
    const std::size_t part = std::min(count - done, kPayload - within);
    std::memcpy(into + done, page_.data() + within, part);
    done += part;
    physical = behind(physical, part);
  }
  return done;
}

std::uint64_t E57Pages::behind(std::uint64_t physical, std::uint64_t count) {
  const std::uint64_t logical = physical / kPage * kPayload + physical % kPage + count;
  return logical / kPayload * kPage + logical % kPayload;
}

std::vector<std::uint8_t> e57_pages_of(ByteSpan logical) {
  std::vector<std::uint8_t> pages((logical.size() + kPayload - 1) / kPayload * kPage, 0);
  for (std::size_t page = 0; page * kPayload < logical.size(); ++page) {
    std::uint8_t* into = pages.data() + page * kPage;
    const ByteSpan part = logical.subspan(page * kPayload);
    std::memcpy(into, part.data(), std::min(part.size(), kPayload));
    const std::uint32_t crc = crc32c(into, kPayload);
    for (std::size_t k = 0; k < 4; ++k)
      into[kPayload + k] = static_cast<std::uint8_t>(crc >> (24 - 8 * k));
  }
  return pages;
}

}  // namespace understory
