#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/recording/bytes.h"

namespace understory {

// Models of Hesai that packets are decoded of.
enum class HesaiModel { kUnknown, kXt32, kXt16, kPandar64, kQt64 };

// Layout, geometry and timing of the packets of one model. They come from the user manuals of
// PandarXT, PandarXT-16, Pandar64 and PandarQT, and from the firing time files that Hesai publishes
// with its SDK. The sections are "Data Structure", and the appendices "Channel Distribution" and
// "Absolute Time and Laser Firing Time". Angles are those of the design: each sensor has a file
// with its own.
struct HesaiTable {
  std::string name;
  std::size_t channels = 0;
  std::size_t blocks = 0;
  std::size_t header_bytes = 0;
  std::size_t return_bytes = 0;  // distance (uint16), reflectivity, and a byte that is not used
  // In the tail, bytes from its begin.
  std::size_t motor_at = 0;
  std::size_t mode_at = 0;
  std::size_t microseconds_at = 0;
  std::size_t date_at = 0;
  std::size_t tail_bytes = 0;  // without the sequence number
  std::size_t flags_at = 0;    // in the header: bit 0, a sequence number follows the tail
  // A firing begins at packet time + offset_us + firing_us of the channel. The packet's time
  // belongs to the last firing of the packet, or to the first one.
  bool time_of_last = true;
  double offset_us = 0.0;
  double block_us = 0.0;              // from firing to firing
  std::vector<double> firing_us;      // by channel
  std::vector<double> elevation_deg;  // by channel
  std::vector<double> azimuth_deg;    // by channel, clockwise

  [[nodiscard]] std::size_t block_bytes() const { return 2 + channels * return_bytes; }
  [[nodiscard]] std::size_t tail_begin() const { return header_bytes + blocks * block_bytes(); }
};

// The table of a model; an empty one for kUnknown.
[[nodiscard]] HesaiTable hesai_table(HesaiModel model);

// Whether bytes begin as packets of Hesai do (EE FF, or FF EE with the length of a Pandar40).
[[nodiscard]] bool is_hesai_data(ByteSpan payload);

// Which model sends a packet; for one that is not read, kUnknown and what it is.
struct HesaiKind {
  HesaiModel model = HesaiModel::kUnknown;
  std::string other;  // "a Pandar128 (protocol 1.4)"
};
[[nodiscard]] HesaiKind hesai_kind(ByteSpan payload);

}  // namespace understory
