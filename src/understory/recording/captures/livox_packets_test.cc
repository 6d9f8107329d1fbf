#include "understory/recording/captures/livox_packets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::append;
using test::Bytes;
using test::put;

constexpr TimeNs kTime = 1'700'000'000'000'000'000;
constexpr TimeNs kPacket = 480'000;  // of 96 points at 200 000 a second

// A packet of a Mid-360, by the table "Point Cloud & IMU Data Protocol".
struct Mid360Packet {
  std::uint8_t type = 1;
  std::uint16_t counter = 0;
  TimeNs time = kTime;
  int points = 96;

  [[nodiscard]] Bytes bytes() const {
    Bytes data;
    for (int i = 0; i < points; ++i) {
      if (type == 0) {
        for (const float value : {0.25F, -0.5F, 0.125F, 0.0F, 0.5F, -1.0F})
          put(data, value);
        break;
      }
      if (type == 1) {
        for (const std::int32_t value : {1'000 + i, -2'000, 500})
          put(data, value);
      } else if (type == 2) {
        for (const int value : {100 + i, -200, 50})
          put(data, static_cast<std::int16_t>(value));
      } else {
        put(data, std::uint32_t{2'000});
        put(data, std::uint16_t{6'000});  // 60 degrees from the z axis
        put(data, std::uint16_t{9'000});
      }
      append(data, {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i == 5 ? 0x10 : 0)});
    }
    Bytes out{0};
    put(out, static_cast<std::uint16_t>(36 + data.size()));
    put(out, static_cast<std::uint16_t>(kPacket / 100));
    put(out, static_cast<std::uint16_t>(type == 0 ? 1 : points));
    put(out, counter);
    append(out, {0, type, 1});
    out.resize(out.size() + 12 + 4, 0);  // reserved, CRC
    put(out, time);
    append(out, data);
    return out;
  }
};

// A packet of an Avia, by section 3 of the Livox SDK Communication Protocol.
struct AviaPacket {
  std::uint8_t type = 2;
  TimeNs time = kTime;
  bool utc = false;

  [[nodiscard]] Bytes bytes() const {
    Bytes out{5, 1, 1, 0, 0, 0, 0, 0, static_cast<std::uint8_t>(utc ? 3 : 1), type};
    if (utc) {  // 2023-11-14 22h and 800 s
      append(out, {23, 11, 14, 22});
      put(out, std::uint32_t{800'000'000});
    } else {
      put(out, time);
    }
    if (type == 6) {
      for (const float value : {1.0F, 2.0F, 3.0F, 0.0F, 0.0F, 1.0F})
        put(out, value);
      return out;
    }
    const int firings = type == 2 || type == 3 ? 96 : type < 6 ? 48 : 30;
    const int returns = type == 2 || type == 3 ? 1 : type < 6 ? 2 : 3;
    const bool spherical = type == 3 || type == 5 || type == 8;
    for (int i = 0; i < firings; ++i) {
      if (spherical && returns > 1) {
        put(out, std::uint16_t{9'000});
        put(out, std::uint16_t{18'000});
      }
      for (int k = 0; k < returns; ++k) {
        if (spherical) {
          put(out, static_cast<std::uint32_t>(3'000 + 1'000 * k));
          if (returns == 1) {
            put(out, std::uint16_t{9'000});
            put(out, std::uint16_t{18'000});
          }
        } else {
          for (const std::int32_t value : {4'000, 0, 1'000 * k})
            put(out, value);
        }
        append(out, {77, static_cast<std::uint8_t>((k + 1) << 4)});
      }
    }
    return out;
  }
};

void add_livox(LivoxDecoder& decoder, const Bytes& bytes, TimeNs stamp = kTime) {
  decoder.add_packet(bytes.data(), bytes.size(), stamp);
}

ScanPtr decode_livox_alone(const Bytes& bytes) {
  Log log;
  LivoxDecoder decoder({}, "test", log);
  add_livox(decoder, bytes);
  decoder.finish();
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
  return decoder.take_scan();
}

TEST(LivoxPackets, ReadsAllTypesOfAMid360) {
  Mid360Packet packet;
  EXPECT_EQ(packet.bytes().size(), 1380U);  // as the sensor sends them
  const ScanPtr fine = decode_livox_alone(packet.bytes());
  ASSERT_EQ(fine->points.size(), 96U);
  const ScanPoint& point = fine->points[5];
  EXPECT_FLOAT_EQ(point.x, 1.005F);
  EXPECT_FLOAT_EQ(point.y, -2.0F);
  EXPECT_FLOAT_EQ(point.z, 0.5F);
  EXPECT_EQ(point.intensity, 5.0F);
  EXPECT_EQ(point.ring, 1);
  EXPECT_EQ(point.tag, 0x10);
  EXPECT_EQ(point.return_index, 0);
  EXPECT_EQ(point.t_ns, 25'000U);
  EXPECT_EQ(fine->stamp, kTime);
  EXPECT_EQ(fine->ring_count, 0);
  packet.type = 2;
  EXPECT_FLOAT_EQ(decode_livox_alone(packet.bytes())->points[7].x, 1.07F);
  packet.type = 3;
  const ScanPoint round = decode_livox_alone(packet.bytes())->points[0];
  EXPECT_NEAR(round.x, 0.0, 1e-6);
  EXPECT_NEAR(round.y, 2.0 * std::sin(std::numbers::pi / 3.0), 1e-6);
  EXPECT_NEAR(round.z, 1.0, 1e-6);
}

TEST(LivoxPackets, ReadsTheImu) {
  Log log;
  LivoxDecoder decoder({}, "test", log);
  Mid360Packet packet;
  packet.type = 0;
  const Bytes bytes = packet.bytes();
  EXPECT_EQ(bytes.size(), 60U);
  const auto sample = decoder.add_imu_packet(bytes.data(), bytes.size(), kTime);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->stamp, kTime);
  EXPECT_EQ(sample->angular_rate, Eigen::Vector3d(0.25, -0.5, 0.125));
  EXPECT_NEAR(sample->specific_force.z(), -9.80665, 1e-9);
  EXPECT_NEAR(sample->specific_force.y(), 0.5 * 9.80665, 1e-9);
  EXPECT_FALSE(decoder.add_imu_packet(bytes.data(), bytes.size(), kTime));  // comes twice
  EXPECT_FALSE(decoder.add_imu_packet(bytes.data(), 40, kTime));
  AviaPacket avia;
  avia.type = 6;
  avia.time = kTime + 5'000'000;
  const Bytes other = avia.bytes();
  const auto second = decoder.add_imu_packet(other.data(), other.size(), kTime);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->angular_rate, Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(LivoxPackets, ReadsTheTypesOfAnAvia) {
  for (const int type : {2, 3, 4, 5, 7, 8}) {
    AviaPacket packet;
    packet.type = static_cast<std::uint8_t>(type);
    const ScanPtr scan = decode_livox_alone(packet.bytes());
    const std::size_t returns = type < 4 ? 1 : type < 6 ? 2 : 3;
    const std::size_t firings = type < 4 ? 96 : type < 6 ? 48 : 30;
    ASSERT_EQ(scan->points.size(), returns * firings) << type;
    const ScanPoint& last = scan->points[returns - 1];  // of the first firing
    const bool spherical = type == 3 || type == 5 || type == 8;
    EXPECT_NEAR(last.x, spherical ? -2.0 - static_cast<double>(returns) : 4.0, 1e-5) << type;
    EXPECT_NEAR(last.z, spherical ? 0.0 : static_cast<double>(returns - 1), 1e-5) << type;
    EXPECT_EQ(last.return_index, returns - 1) << type;
    EXPECT_EQ(last.t_ns, 0U);
    EXPECT_EQ(scan->points[returns * 7].ring, 1);  // line 7 mod 6
    EXPECT_EQ(last.intensity, 77.0F);
  }
  AviaPacket utc;
  utc.utc = true;
  EXPECT_EQ(decode_livox_alone(utc.bytes())->stamp, kTime);
}

// Protocol 1 does not state the interval: the next packet tells it.
TEST(LivoxPackets, SpreadsPointsOfAnAviaUntilTheNextPacket) {
  Log log;
  LivoxDecoder decoder({}, "test", log);
  for (int i = 0; i < 3; ++i) {
    AviaPacket packet;
    packet.time = kTime + i * 960'000;
    add_livox(decoder, packet.bytes(), packet.time);
  }
  decoder.finish();
  const ScanPtr scan = decoder.take_scan();
  ASSERT_EQ(scan->points.size(), 288U);
  EXPECT_EQ(scan->points[10].t_ns, 100'000U);
  EXPECT_EQ(scan->points[287].t_ns, 2'870'000U);
}

TEST(LivoxPackets, ScansLastATenthOfASecond) {
  Log log;
  LivoxDecoder decoder({}, "test", log);
  for (int i = 0; i < 500; ++i) {
    Mid360Packet packet;
    packet.time = kTime + i * kPacket;
    packet.counter = static_cast<std::uint16_t>(i);
    add_livox(decoder, packet.bytes(), packet.time);
  }
  decoder.finish();
  std::vector<std::size_t> points;
  while (const ScanPtr scan = decoder.take_scan())
    points.push_back(scan->points.size());
  EXPECT_EQ(points, (std::vector<std::size_t>{20'000, 20'000, 8'000}));
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(LivoxPackets, NamesPacketsThatAreCutDoubledOrMissing) {
  Log log;
  LivoxDecoder decoder({}, "test", log);
  for (const int i : {0, 1, 2, 2, 3, 6}) {
    Mid360Packet packet;
    packet.time = kTime + i * kPacket;
    packet.counter = static_cast<std::uint16_t>(i);
    add_livox(decoder, packet.bytes(), packet.time);
  }
  Bytes cut = Mid360Packet().bytes();
  cut.resize(700);
  add_livox(decoder, cut);
  add_livox(decoder, {});
  decoder.finish();
  EXPECT_EQ(decoder.take_scan()->points.size(), 5U * 96U);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 4U) << test::all_warnings(log);
}

TEST(LivoxPackets, GoOnWhereTheyWereSaved) {
  Log log;
  LivoxDecoder whole({}, "test", log);
  LivoxDecoder first({}, "test", log);
  LivoxDecoder second({}, "test", log);
  for (int i = 0; i < 200; ++i) {
    AviaPacket packet;
    packet.time = kTime + i * 400'000;
    if (i == 70) {
      BinaryWriter writer;
      first.save(writer);
      BinaryReader reader(writer.bytes(), "test");
      second.load(reader);
    }
    add_livox(whole, packet.bytes(), packet.time);
    add_livox(i < 70 ? first : second, packet.bytes(), packet.time);
  }
  whole.finish();
  second.finish();
  test::expect_same(*whole.take_scan(), *second.take_scan());
}

void add_datagram(Bytes& file, TimeNs stamp, std::uint16_t from, std::uint16_t to,
                  const Bytes& payload) {
  Bytes udp = test::make_udp(to, payload);
  udp[0] = static_cast<std::uint8_t>(from >> 8);
  udp[1] = static_cast<std::uint8_t>(from);
  test::add_record(file, stamp, test::make_ethernet(test::make_ip(udp)));
}

TEST(LivoxPackets, ACaptureOfAMid360HasItsImuInPlace) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < 420; ++i) {
    Mid360Packet packet;
    packet.time = kTime + i * kPacket;
    packet.counter = static_cast<std::uint16_t>(i);
    add_datagram(file, packet.time, 56'300, 56'301, packet.bytes());
    if (i % 10 != 0) continue;
    packet.type = 0;
    add_datagram(file, packet.time, 56'400, 56'401, packet.bytes());
  }
  Log log;
  const auto recording = open_pcap(bytes_in_memory(file, "walk.pcap"), {}, log);
  EXPECT_EQ(recording->format(), "PCAP (Livox Mid-360)");
  const Rig& rig = recording->rig();
  ASSERT_TRUE(rig.body_from_imu);
  EXPECT_EQ(rig.body_frame, "imu");
  EXPECT_NEAR(
      (rig.body_from_lidar.translation() - Eigen::Vector3d(-0.011, -0.02329, 0.04412)).norm(), 0.0,
      1e-12);
  int scans = 0;
  int samples = 0;
  for (const Event& event : test::read_all(*recording)) {
    scans += std::holds_alternative<ScanPtr>(event) ? 1 : 0;
    samples += std::holds_alternative<ImuSample>(event) ? 1 : 0;
  }
  EXPECT_EQ(scans, 3);
  EXPECT_EQ(samples, 42);
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

}  // namespace
}  // namespace understory
