#pragma once

#include <cstdint>

namespace understory {

// sensor_msgs/PointField datatypes.
enum class FieldType : std::uint8_t {
  kInt8 = 1,
  kUint8 = 2,
  kInt16 = 3,
  kUint16 = 4,
  kInt32 = 5,
  kUint32 = 6,
  kFloat32 = 7,
  kFloat64 = 8
};

// Calls visit with a zero of the C++ type that the field has and returns what it gives. For a value
// that names no type (a message may hold any) the zero of that.
template <typename Visit>
auto visit_field_type(FieldType type, const Visit& visit) {
  using Value = decltype(visit(0.0));
  switch (type) {
    case FieldType::kInt8:
      return visit(std::int8_t{});
    case FieldType::kUint8:
      return visit(std::uint8_t{});
    case FieldType::kInt16:
      return visit(std::int16_t{});
    case FieldType::kUint16:
      return visit(std::uint16_t{});
    case FieldType::kInt32:
      return visit(std::int32_t{});
    case FieldType::kUint32:
      return visit(std::uint32_t{});
    case FieldType::kFloat32:
      return visit(float{});
    case FieldType::kFloat64:
      return visit(double{});
  }
  return Value();
}

// Bytes; 0 for no type.
[[nodiscard]] inline std::uint32_t field_size(FieldType type) {
  return visit_field_type(type, [](auto zero) { return static_cast<std::uint32_t>(sizeof(zero)); });
}

}  // namespace understory
