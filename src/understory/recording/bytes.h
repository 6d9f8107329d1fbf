#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace understory {

using ByteSpan = std::span<const std::uint8_t>;

static_assert(std::endian::native == std::endian::little,
              "the readers copy little-endian numbers as they are");

// Reads little-endian numbers from bytes that may be damaged. A read past the end returns zero and
// makes `ok()` false for good. A record is therefore decoded first and judged once at its end.
class ByteReader {
 public:
  explicit ByteReader(ByteSpan bytes) : bytes_(bytes) {}

  template <typename T>
  [[nodiscard]] T get() {
    T value{};
    const ByteSpan raw = take(sizeof(T));
    if (raw.size() == sizeof(T)) std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  // The next `count` bytes; empty (and not ok) if there are fewer.
  [[nodiscard]] ByteSpan take(std::uint64_t count) {
    if (count > remaining()) {
      ok_ = false;
      position_ = bytes_.size();
      return {};
    }
    const ByteSpan part = bytes_.subspan(position_, static_cast<std::size_t>(count));
    position_ += static_cast<std::size_t>(count);
    return part;
  }
  // Text with a 32-bit length before it.
  [[nodiscard]] std::string_view text() {
    const ByteSpan raw = take(get<std::uint32_t>());
    return {reinterpret_cast<const char*>(raw.data()), raw.size()};
  }
  [[nodiscard]] std::size_t position() const { return position_; }
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - position_; }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  ByteSpan bytes_;
  std::size_t position_ = 0;
  bool ok_ = true;
};

// Appends little-endian numbers to a growing buffer.
class ByteBuffer {
 public:
  template <typename T>
  void put(T value) {
    const std::size_t begin = bytes_.size();
    bytes_.resize(begin + sizeof(T));
    std::memcpy(bytes_.data() + begin, &value, sizeof(T));
  }
  void put_bytes(ByteSpan raw) { bytes_.insert(bytes_.end(), raw.begin(), raw.end()); }
  // Text with a 32-bit length before it.
  void put_text(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size()));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
  }
  // Overwrites a number written before, e.g. a length that is known only now.
  template <typename T>
  void overwrite(std::size_t position, T value) {
    std::memcpy(bytes_.data() + position, &value, sizeof(T));
  }
  void resize(std::size_t size) { bytes_.resize(size); }
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  [[nodiscard]] std::uint8_t* data() { return bytes_.data(); }
  [[nodiscard]] ByteSpan span() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

}  // namespace understory
