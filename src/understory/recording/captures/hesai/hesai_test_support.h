#pragma once

#include <cstdint>
#include <vector>

#include "understory/recording/captures/hesai/hesai_tables.h"
#include "understory/recording/captures/packet_test_support.h"

namespace understory::test {

// A packet of Hesai, put together by the tables "Data Structure" of the manuals, field by field.
// All returns of a block have the same distance and reflectivity.
struct HesaiPacket {
  HesaiModel model = HesaiModel::kXt32;
  int azimuth_cdeg = 0;  // of the first firing
  int step_cdeg = 18;
  std::uint8_t mode = 0x37;
  std::uint16_t distance = 2500;  // 10 m
  std::uint16_t other = 2500;     // of even blocks in dual return
  std::uint8_t reflectivity = 50;
  std::uint8_t other_reflectivity = 60;
  std::uint16_t rpm = 600;
  std::uint32_t sequence = 1;
  std::uint32_t microseconds = 250'000;  // of 2023-11-14 22:13:20 UTC

  [[nodiscard]] Bytes bytes() const {
    const bool old = model == HesaiModel::kPandar64;
    const bool qt = model == HesaiModel::kQt64;
    const int channels = model == HesaiModel::kXt16 ? 16 : model == HesaiModel::kXt32 ? 32 : 64;
    const int blocks = old ? 6 : qt ? 4 : 8;
    const bool dual = mode >= 0x39 && mode <= 0x3C;
    Bytes out{0xEE, 0xFF};
    if (old) {
      append(out, {64, 6, 0, 4, 2, 1});
    } else {
      append(out,
             {static_cast<std::uint8_t>(qt ? 3 : 6), 1, 0, 0, static_cast<std::uint8_t>(channels),
              static_cast<std::uint8_t>(blocks), 0, 4, 2, 1});
    }
    for (int block = 0; block < blocks; ++block) {
      const int firing = dual ? block / 2 : block;
      put(out, static_cast<std::uint16_t>((azimuth_cdeg + firing * step_cdeg) % 36'000));
      const bool second = dual && block % 2 == 1;
      for (int channel = 0; channel < channels; ++channel) {
        put(out, second ? other : distance);
        out.push_back(second ? other_reflectivity : reflectivity);
        if (!old) out.push_back(0);
      }
    }
    const Bytes date{static_cast<std::uint8_t>(old ? 23 : 123), 11, 14, 22, 13, 20};
    if (old || qt) {  // reserved, speed, microseconds, mode, factory, date
      out.resize(out.size() + (old ? 8 : 10), 0);
      put(out, rpm);
      put(out, microseconds);
      append(out, {mode, 0x42});
      append(out, date);
    } else {  // reserved, mode, speed, date, microseconds, factory
      out.resize(out.size() + 10, 0);
      out.push_back(mode);
      put(out, rpm);
      append(out, date);
      put(out, microseconds);
      out.push_back(0x42);
    }
    put(out, sequence);
    return out;
  }
};

inline constexpr TimeNs kHesaiTime = 1'700'000'000'250'000'000;  // of that packet

}  // namespace understory::test
