#pragma once

#include <array>
#include <memory>
#include <string>
#include <type_traits>
#include <variant>

#include "understory/recording/recording.h"

// What the files of EventOrderer share.
namespace understory::event_stamp {

// Of the streams, in the order of the kinds of Event.
inline constexpr std::array<const char*, 4> kNames = {"lidar", "imu", "gnss", "mag"};

// Seconds as nanoseconds, rounded towards zero.
inline TimeNs ns(double seconds) {
  return static_cast<TimeNs>(seconds * 1e9);
}

// The time at which an event was measured; of a scan, that of its first point.
inline TimeNs stamp_of(const Event& event) {
  return std::visit(
      [](const auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, ScanPtr>)
          return value->stamp;
        else
          return value.stamp;
      },
      event);
}

// Moves the time of an event by an offset; times of points within a scan stay as they are.
inline void move_stamp(Event& event, TimeNs offset) {
  if (offset == 0) return;
  std::visit(
      [&](auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, ScanPtr>) {
          auto moved = std::make_shared<Scan>(*value);
          moved->stamp += offset;
          value = std::move(moved);
        } else {
          value.stamp += offset;
        }
      },
      event);
}

// A time span as text for messages, in seconds.
inline std::string seconds(TimeNs time) {
  const std::string text = std::to_string(static_cast<double>(time) * 1e-9);
  return text.substr(0, text.size() - 3) + " s";
}

}  // namespace understory::event_stamp
