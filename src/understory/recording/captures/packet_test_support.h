#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/time.h"

namespace understory::test {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
void put(Bytes& bytes, T value) {
  std::uint8_t raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  for (const std::uint8_t byte : raw)
    bytes.push_back(byte);
}

template <typename T>
void put_big(Bytes& bytes, T value) {
  for (std::size_t i = sizeof(T); i-- > 0;)
    bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

inline void append(Bytes& bytes, const Bytes& more) {
  for (const std::uint8_t byte : more)
    bytes.push_back(byte);
}

struct VelodynePacket {
  int azimuth_cdeg = 0;  // of the first block
  int step_cdeg = 40;    // between firing sequences' blocks
  std::uint32_t us = 0;  // since the hour
  std::uint8_t mode = 0x37;
  std::uint8_t product = 0x22;
  std::uint16_t distance = 2500;  // of all returns of even blocks (or of all, if single)
  std::uint16_t other = 2500;     // of odd blocks in dual mode
};

inline Bytes make_packet(const VelodynePacket& packet) {
  Bytes bytes;
  const bool dual = packet.mode == 0x39;
  for (int block = 0; block < 12; ++block) {
    const int turn = dual ? block / 2 : block;
    put(bytes, std::uint16_t{0xEEFF});
    put(bytes, static_cast<std::uint16_t>((packet.azimuth_cdeg + turn * packet.step_cdeg) % 36000));
    for (int i = 0; i < 32; ++i) {
      put(bytes, dual && block % 2 == 1 ? packet.other : packet.distance);
      bytes.push_back(static_cast<std::uint8_t>(i + (block % 2 == 1 ? 100 : 0)));
    }
  }
  put(bytes, packet.us);
  bytes.push_back(packet.mode);
  bytes.push_back(packet.product);
  return bytes;
}

inline std::string nmea_line(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body)
    sum ^= static_cast<unsigned char>(c);
  const char* digits = "0123456789ABCDEF";
  return "$" + body + "*" + digits[sum / 16] + digits[sum % 16] + "\r\n";
}

inline Bytes make_position_packet(std::uint32_t us, const std::string& sentence) {
  Bytes bytes(198, 0);
  put(bytes, us);
  bytes.resize(206, 0);
  bytes.insert(bytes.end(), sentence.begin(), sentence.end());
  bytes.resize(512, 0);
  return bytes;
}

// The start of an hour, at which a sensor's time of the hour is zero.
inline constexpr TimeNs kHourStart = 1'700'002'800 * kNsPerSecond;

inline Bytes make_udp(std::uint16_t port, const Bytes& payload) {
  Bytes bytes;
  put_big(bytes, std::uint16_t{5000});
  put_big(bytes, port);
  put_big(bytes, static_cast<std::uint16_t>(8 + payload.size()));
  put_big(bytes, std::uint16_t{0});
  append(bytes, payload);
  return bytes;
}

// The i-th packet of a lidar that turns ten times a second.
inline Bytes velodyne_udp(int i) {
  VelodynePacket packet;
  packet.azimuth_cdeg = (480 * i) % 36000;
  packet.us = static_cast<std::uint32_t>(1327 * i);
  return make_udp(2368, make_packet(packet));
}

// Fills in the checksum for the addresses that make_ip gives.
inline void seal_udp(Bytes& udp) {
  std::uint32_t sum =
      17 + static_cast<std::uint32_t>(udp.size()) + 0xC0A8 + 0x01C9 + 0xC0A8 + 0x0101;
  for (std::size_t i = 0; i < udp.size(); i += 2)
    sum += static_cast<std::uint32_t>(udp[i] << 8) + (i + 1 < udp.size() ? udp[i + 1] : 0U);
  while (sum > 0xFFFF)
    sum = (sum & 0xFFFF) + (sum >> 16);
  const auto check = static_cast<std::uint16_t>(~sum);
  udp[6] = static_cast<std::uint8_t>(check >> 8);
  udp[7] = static_cast<std::uint8_t>(check);
}

inline Bytes make_ip(const Bytes& body, std::size_t offset = 0, bool more = false,
                     std::uint16_t id = 1) {
  Bytes bytes{0x45, 0};
  put_big(bytes, static_cast<std::uint16_t>(20 + body.size()));
  put_big(bytes, id);
  put_big(bytes, static_cast<std::uint16_t>((more ? 0x2000U : 0U) | offset / 8));
  append(bytes, {64, 17, 0, 0, 192, 168, 1, 201, 192, 168, 1, 1});
  append(bytes, body);
  return bytes;
}

inline Bytes make_ethernet(const Bytes& ip, bool vlan = false) {
  Bytes bytes(12, 0x11);
  if (vlan) append(bytes, {0x81, 0x00, 0x00, 0x07});
  append(bytes, {0x08, 0x00});
  append(bytes, ip);
  return bytes;
}

inline Bytes pcap_header(std::uint32_t link_type = 1) {
  Bytes bytes;
  put(bytes, std::uint32_t{0xA1B2C3D4});
  put(bytes, std::uint16_t{2});
  put(bytes, std::uint16_t{4});
  put(bytes, std::uint64_t{0});
  put(bytes, std::uint32_t{65535});
  put(bytes, link_type);
  return bytes;
}

inline void add_record(Bytes& file, TimeNs stamp, const Bytes& frame) {
  put(file, static_cast<std::uint32_t>(stamp / kNsPerSecond));
  put(file, static_cast<std::uint32_t>(stamp % kNsPerSecond / 1000));
  put(file, static_cast<std::uint32_t>(frame.size()));
  put(file, static_cast<std::uint32_t>(frame.size()));
  append(file, frame);
}

// All scans of a decoder that gets no more packets.
template <typename Decoder>
std::vector<ScanPtr> drain(Decoder& decoder) {
  decoder.finish();
  std::vector<ScanPtr> scans;
  while (ScanPtr scan = decoder.take_scan())
    scans.push_back(scan);
  return scans;
}

}  // namespace understory::test
