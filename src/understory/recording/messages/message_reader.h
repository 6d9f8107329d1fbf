#pragma once

#include <bit>
#include <string_view>

#include "understory/recording/bytes.h"

namespace understory {

// How a message's bytes are laid out: ROS 2 CDR (aligned, 4 bytes of encapsulation before it) or
// ROS 1 (packed, little-endian).
enum class Serialization { kCdr, kRos1 };

// Reads the primitive values of one serialised message. Like ByteReader it survives any bytes: what
// is missing reads as zero and `ok()` turns false.
class MessageReader {
 public:
  MessageReader(ByteSpan message, Serialization serialization)
      : serialization_(serialization), body_(message) {
    if (serialization_ == Serialization::kRos1) return;
    ByteReader head(message);
    const auto representation = head.get<std::uint16_t>();
    (void)head.get<std::uint16_t>();  // options
    // The identifier is big-endian: 0x0000 is plain CDR big-endian, 0x0001 little-endian.
    known_ = head.ok() && (representation == 0x0000 || representation == 0x0100);
    swap_ = representation == 0x0000;
    body_ = ByteReader(message.subspan(head.position()));
  }

  template <typename T>
  [[nodiscard]] T get() {
    static_assert(std::is_arithmetic_v<T>);
    align(sizeof(T));
    T value = body_.get<T>();
    if (swap_) value = swapped(value);
    return value;
  }
  [[nodiscard]] std::string_view text() {
    const auto length = get<std::uint32_t>();
    const ByteSpan raw = body_.take(length);
    std::string_view view(reinterpret_cast<const char*>(raw.data()), raw.size());
    if (!view.empty() && view.back() == '\0') view.remove_suffix(1);  // CDR counts the final zero
    return view;
  }
  // A sequence of bytes with its length.
  [[nodiscard]] ByteSpan byte_sequence() { return body_.take(get<std::uint32_t>()); }
  [[nodiscard]] ByteSpan take(std::size_t count) { return body_.take(count); }
  // The length of a sequence whose elements take at least `element_size` bytes. It is 0 (and not
  // ok) if so many cannot be there: a damaged length allocates nothing.
  [[nodiscard]] std::uint32_t length(std::size_t element_size) {
    const auto count = get<std::uint32_t>();
    if (count > body_.remaining() / element_size) {
      known_ = false;
      return 0;
    }
    return count;
  }
  template <typename T>
  void skip_sequence() {
    const auto count = length(sizeof(T));
    if (count == 0) return;
    align(sizeof(T));
    (void)body_.take(static_cast<std::uint64_t>(count) * sizeof(T));
  }
  [[nodiscard]] bool is_ros1() const { return serialization_ == Serialization::kRos1; }
  [[nodiscard]] bool swaps_bytes() const { return swap_; }
  [[nodiscard]] std::size_t remaining() const { return body_.remaining(); }
  [[nodiscard]] bool ok() const { return known_ && body_.ok(); }

 private:
  void align(std::size_t size) {
    if (serialization_ == Serialization::kRos1) return;
    const std::size_t over = body_.position() % size;
    if (over != 0) (void)body_.take(size - over);
  }
  template <typename T>
  static T swapped(T value) {
    auto* raw = reinterpret_cast<std::uint8_t*>(&value);
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i)
      std::swap(raw[i], raw[sizeof(T) - 1 - i]);
    return value;
  }

  Serialization serialization_;
  ByteReader body_;
  bool swap_ = false;
  bool known_ = true;
};

}  // namespace understory
