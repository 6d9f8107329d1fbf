#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/recording.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// An event of a recording in a checkpoint, bit for bit.
void put_event(BinaryWriter& writer, const Event& event);
// Throws InputError where the bytes end too early or are no event.
[[nodiscard]] Event get_event(BinaryReader& reader);
// A scan that may be null.
void put_scan(BinaryWriter& writer, const ScanPtr& scan);
[[nodiscard]] ScanPtr get_scan(BinaryReader& reader);

// Parts of recordings in the bytes of checkpoints, and back; reading past the end throws
// InputError.
void put_rig(BinaryWriter& writer, const Rig& rig);
[[nodiscard]] Rig get_rig(BinaryReader& reader);

// Whether there is a value, and the value; for types that are copied byte by byte.
template <typename T>
void put_optional(BinaryWriter& writer, const std::optional<T>& value) {
  writer.put(value.has_value());
  if (value) writer.put(*value);
}
template <typename T>
[[nodiscard]] std::optional<T> get_optional(BinaryReader& reader) {
  if (!reader.get<bool>()) return std::nullopt;
  return reader.get<T>();
}

// A list of flags, one byte each, and back.
void put_flags(BinaryWriter& writer, const std::vector<bool>& flags);
[[nodiscard]] std::vector<bool> get_flags(BinaryReader& reader);

// A table of strings in the order of its keys, and back.
void put_strings(BinaryWriter& writer, const std::map<std::string, std::string>& strings);
[[nodiscard]] std::map<std::string, std::string> get_strings(BinaryReader& reader);

// Events in a row, a std::deque say.
template <typename Events>
void put_events(BinaryWriter& writer, const Events& events) {
  writer.put(static_cast<std::uint64_t>(events.size()));
  for (const Event& event : events)
    put_event(writer, event);
}
template <typename Events>
void get_events(BinaryReader& reader, Events& events) {
  events.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    events.push_back(get_event(reader));
}

}  // namespace understory
