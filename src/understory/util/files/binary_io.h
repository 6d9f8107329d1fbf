#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "understory/util/error.h"

namespace understory {

// Plain bytes in the machine's own order: for checkpoints, which are read by the program that wrote
// them. Fixed-size Eigen matrices and other trivially laid-out values go through `put_raw`.
class BinaryWriter {
 public:
  BinaryWriter() = default;
  // With room for about `expected` bytes, so that large content is not moved as it grows.
  explicit BinaryWriter(std::size_t expected) { bytes_.reserve(expected); }

  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void put(const T& value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T)); }
  void put(const std::string& text) {
    put(static_cast<std::uint64_t>(text.size()));
    bytes_ += text;
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint64_t>(values.size()));
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  }
  // `count` doubles, e.g. of a fixed-size Eigen matrix (matrix.data(), matrix.size()).
  void put_doubles(const double* values, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(double));
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Reads what BinaryWriter wrote, in the same order. Throws InputError (naming `origin` and the
// byte) where the bytes end too early, or hold no value of a bool or an enumeration.
class BinaryReader {
 public:
  BinaryReader(std::string bytes, std::string origin)
      : bytes_(std::move(bytes)), origin_(std::move(origin)) {}

  template <typename T>
  requires std::is_trivially_copyable_v<T>
  [[nodiscard]] T get() {
    static_assert(!std::is_enum_v<T>, "get_enum checks the range");
    if constexpr (std::is_same_v<T, bool>) {
      return get_bool();
    } else {
      T value;
      std::memcpy(static_cast<void*>(&value), take(sizeof(T)), sizeof(T));
      return value;
    }
  }
  // An enumeration whose values count up from 0 or 1 to `last`.
  template <typename T>
  requires std::is_enum_v<T>
  [[nodiscard]] T get_enum(T last) {
    const auto value = get<std::underlying_type_t<T>>();
    const auto number = static_cast<std::int64_t>(value);
    if (number < 0 || number > static_cast<std::int64_t>(last)) {
      fail("expected a number from 0 to " + std::to_string(static_cast<std::int64_t>(last)) +
           ", found " + std::to_string(number));
    }
    return static_cast<T>(value);
  }
  [[nodiscard]] std::string get_string() {
    const auto size = get<std::uint64_t>();
    return {take(size), static_cast<std::size_t>(size)};
  }
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  [[nodiscard]] std::vector<T> get_vector() {
    const auto size = get<std::uint64_t>();
    if (size > bytes_.size() / sizeof(T)) fail();
    std::vector<T> values(size);
    if (size > 0)
      std::memcpy(static_cast<void*>(values.data()), take(size * sizeof(T)), size * sizeof(T));
    return values;
  }
  void get_doubles(double* values, std::size_t count) {
    std::memcpy(values, take(count * sizeof(double)), count * sizeof(double));
  }
  [[nodiscard]] bool at_end() const { return position_ == bytes_.size(); }

 private:
  [[noreturn]] void fail(const std::string& why = "ends too early") const {
    throw InputError(origin_, "at byte " + std::to_string(position_), why);
  }
  // Any other byte in a bool has no defined meaning.
  bool get_bool() {
    const auto byte = static_cast<unsigned char>(*take(1));
    if (byte > 1) fail("expected 0 or 1, found " + std::to_string(byte));
    return byte == 1;
  }
  const char* take(std::uint64_t size) {
    if (size > bytes_.size() - position_) fail();
    const char* at = bytes_.data() + position_;
    position_ += static_cast<std::size_t>(size);
    return at;
  }

  std::string bytes_;
  std::string origin_;
  std::size_t position_ = 0;
};

}  // namespace understory
