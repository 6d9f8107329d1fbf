#include "understory/recording/captures/velodyne.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using test::drain;
using test::make_packet;
using test::VelodynePacket;

constexpr TimeNs kHour = 3600 * kNsPerSecond;
constexpr TimeNs kFullHour = 1'700'002'800 * kNsPerSecond;  // 472222 hours since 1970
static_assert(kFullHour % kHour == 0);

void add_velodyne(VelodyneDecoder& decoder, const VelodynePacket& packet, TimeNs stamp) {
  const test::Bytes bytes = make_packet(packet);
  decoder.add_packet(bytes.data(), bytes.size(), stamp);
}

TEST(Velodyne, PlacesEachFiringByTheManual) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  packet.azimuth_cdeg = 9000;
  packet.us = 7'000'000;
  add_velodyne(decoder, packet, kFullHour + 7 * kNsPerSecond);
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  const Scan& scan = *scans[0];
  ASSERT_EQ(scan.points.size(), 384U);
  EXPECT_EQ(scan.stamp, kFullHour + 7 * kNsPerSecond);
  EXPECT_EQ(scan.ring_count, 16);
  EXPECT_EQ(log.warnings().size(), 0U);
  // Laser 3 (elevation 3 deg, ring 9) of the second sequence of block 4.
  const ScanPoint& point = scan.points[4 * 32 + 16 + 3];
  const double microseconds = 9 * 55.296 + 3 * 2.304;
  EXPECT_EQ(point.t_ns, static_cast<std::uint32_t>(std::llround(microseconds * 1000.0)));
  EXPECT_EQ(point.ring, 9);
  EXPECT_EQ(point.intensity, 19.0F);
  const double azimuth = (90.0 + 0.4 * microseconds / 110.592) * kDegree;
  const double range = 5.0;
  EXPECT_NEAR(point.x, range * std::cos(3.0 * kDegree) * std::cos(azimuth), 1e-5);
  EXPECT_NEAR(point.y, -range * std::cos(3.0 * kDegree) * std::sin(azimuth), 1e-5);
  EXPECT_NEAR(point.z, range * std::sin(3.0 * kDegree) - 0.0022, 1e-5);
}

TEST(Velodyne, RingsRiseWithTheBeams) {
  for (const auto model : {VelodyneModel::kVlp16, VelodyneModel::kPuckHiRes, VelodyneModel::kHdl32e,
                           VelodyneModel::kVlp32c}) {
    const VelodyneTable table = velodyne_table(model);
    std::vector<double> by_ring(table.lasers.size(), -2.0);
    for (const auto& laser : table.lasers)
      by_ring[laser.ring] = laser.sin_elevation;
    for (std::size_t i = 1; i < by_ring.size(); ++i)
      EXPECT_GT(by_ring[i], by_ring[i - 1]) << table.name << " ring " << i;
  }
}

TEST(Velodyne, DualReturnKeepsBothOrOneIfTheSame) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  packet.mode = 0x39;
  packet.distance = 2500;
  packet.other = 1500;
  add_velodyne(decoder, packet, kFullHour);
  auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->points.size(), 384U);
  // Odd blocks are the brighter ones here.
  EXPECT_EQ(scans[0]->points[0].return_index, 1);
  EXPECT_EQ(scans[0]->points[1].return_index, 0);
  // Six pairs of blocks of two sequences: half as long as in single mode.
  EXPECT_EQ(scans[0]->end() - scans[0]->stamp, std::llround((11 * 55.296 + 15 * 2.304) * 1000.0));
  packet.other = packet.distance;
  packet.us = 700;
  add_velodyne(decoder, packet, kFullHour + 700'000);
  scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->points.size(), 192U);
}

TEST(Velodyne, CutsScansWhereTheHeadPassesTheStart) {
  Log log;
  VelodyneConfig config;
  config.scan_start_deg = 180.0;
  VelodyneDecoder decoder(config, "test", log);
  for (int i = 0; i < 3 * 75; ++i) {
    VelodynePacket packet;
    packet.azimuth_cdeg = (480 * i) % 36000;
    packet.us = static_cast<std::uint32_t>(1327 * i);
    add_velodyne(decoder, packet, kFullHour + i * 1'327'000LL);
  }
  // The first half turn is left out, the last one kept.
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 3U);
  for (const std::size_t i : {0U, 1U}) {
    EXPECT_NEAR(static_cast<double>(scans[i]->points.size()), 75.0 * 384, 64);
    EXPECT_NEAR(to_seconds(scans[i]->end() - scans[i]->stamp), 0.0995, 1e-3);
    EXPECT_LT(scans[i]->points.front().x, -4.0F);
  }
  EXPECT_EQ(test::all_warnings(log),
            "scan.part: test: begins within a turn of the lidar: its first scan, of 14400 points, "
            "lacks 50 % of the turn and is left out\n");
}

// A stream that begins within a turn.
TEST(Velodyne, LeavesOutAFirstScanThatIsAPart) {
  for (const int first : {0, 3, 19, 37, 56}) {
    Log log;
    VelodyneDecoder decoder({}, "test", log);
    for (int i = first; i < 3 * 75; ++i) {
      VelodynePacket packet;
      packet.azimuth_cdeg = (480 * i) % 36000;
      packet.us = static_cast<std::uint32_t>(1327 * i);
      add_velodyne(decoder, packet, kFullHour + i * 1'327'000LL);
    }
    const bool part = first > 7;
    const auto scans = drain(decoder);
    ASSERT_EQ(scans.size(), part ? 2U : 3U) << first;
    EXPECT_EQ(test::count_of(log, "scan.part"), part ? 1U : 0U) << first;
    EXPECT_NEAR(to_seconds(scans[1]->stamp - scans[0]->stamp), 0.1, 0.008) << first;
  }
}

TEST(Velodyne, KeepsAPartThatIsAll) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  packet.azimuth_cdeg = 30'000;
  add_velodyne(decoder, packet, kFullHour);
  EXPECT_EQ(drain(decoder).size(), 1U);
  EXPECT_EQ(test::all_warnings(log), "");
}

TEST(Velodyne, LeavesOutZeroAndNearReturns) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  packet.distance = 0;
  add_velodyne(decoder, packet, kFullHour);
  packet.distance = 40;  // 8 cm
  packet.us = 1327;
  add_velodyne(decoder, packet, kFullHour + 1'327'000);
  EXPECT_TRUE(drain(decoder).empty());
}

TEST(Velodyne, PositionPacketsGiveTheHourAndTheFix) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  // The receiver's clock is two hours off.
  const std::string sentence =
      test::nmea_line("GPRMC,081802.00,A,3649.7478,N,00224.4542,W,0.5,212.5,210116,0.0,E,A");
  const test::Bytes position = test::make_position_packet(1'082'342'001, sentence);
  const auto fix = decoder.add_position_packet(position.data(), position.size());
  ASSERT_TRUE(fix);
  EXPECT_EQ(fix->stamp, 1'453'364'282 * kNsPerSecond);
  EXPECT_NEAR(fix->latitude_deg, 36.0 + 49.7478 / 60.0, 1e-12);
  EXPECT_NEAR(fix->longitude_deg, -(2.0 + 24.4542 / 60.0), 1e-12);
  EXPECT_NEAR(fix->speed_m_s, 0.5 * 0.514444, 1e-6);
  EXPECT_TRUE(std::isnan(fix->height_m));
  EXPECT_FALSE(decoder.add_position_packet(position.data(), position.size()));
  VelodynePacket packet;
  packet.us = 1'082'343'000;
  add_velodyne(decoder, packet, 1'453'364'282 * kNsPerSecond + 2 * kHour);
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->stamp, 1'453'364'282 * kNsPerSecond + 343'000'000);
}

TEST(Velodyne, FollowsTheStampsWhereTheSensorHasNoUtc) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  for (int i = 0; i < 10; ++i) {
    packet.us = static_cast<std::uint32_t>(140'000'000 + 1327 * i);
    packet.azimuth_cdeg = 480 * i;
    // Jitter of the receiver must not reach the times.
    add_velodyne(decoder, packet,
                 kFullHour + 1671 * kNsPerSecond + i * 1'327'000LL + (i % 3) * 200'000);
  }
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->stamp, kFullHour + 1671 * kNsPerSecond);
  EXPECT_NEAR(static_cast<double>(scans[0]->points[384 * 9].t_ns), 9 * 1'327'000.0, 500.0);
}

TEST(Velodyne, CountsOnAcrossTheHour) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  VelodynePacket packet;
  packet.us = 3'599'999'000;
  add_velodyne(decoder, packet, kFullHour + kHour - 1'000'000);
  packet.us = 327;
  packet.azimuth_cdeg = 480;
  add_velodyne(decoder, packet, kFullHour + kHour + 327'000);
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->points[384].t_ns, 1'327'000U);
}

TEST(Velodyne, PassesOverDamageAndGoesOn) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  test::Bytes good = make_packet({});
  decoder.add_packet(good.data(), 1205, kFullHour);  // short
  VelodynePacket packet;
  packet.us = 1000;
  test::Bytes bytes = make_packet(packet);
  bytes[300] = 0;      // flag of block 3
  bytes[702] ^= 0x20;  // azimuth of block 7
  decoder.add_packet(bytes.data(), bytes.size(), kFullHour + 1'000'000);
  packet.us = 2327;
  packet.azimuth_cdeg = 480;
  bytes = make_packet(packet);
  bytes[1205] = 0x21;  // another model
  decoder.add_packet(bytes.data(), bytes.size(), kFullHour + 2'327'000);
  packet.us = 1'803'654'000;  // half an hour off
  packet.azimuth_cdeg = 960;
  add_velodyne(decoder, packet, kFullHour + 3'654'000);
  packet.us = 4981;
  packet.azimuth_cdeg = 1440;
  add_velodyne(decoder, packet, kFullHour + 4'981'000);
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->points.size(), 10U * 32 + 384);
  EXPECT_LT(to_seconds(scans[0]->end() - scans[0]->stamp), 0.01);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 5U) << test::all_warnings(log);
}

TEST(Velodyne, LeavesOutPacketsThatComeTwice) {
  Log log;
  VelodyneDecoder decoder({}, "test", log);
  for (int i = 0; i < 3; ++i) {
    VelodynePacket packet;
    packet.us = static_cast<std::uint32_t>(1327 * i);
    packet.azimuth_cdeg = static_cast<std::uint16_t>(480 * i);
    const TimeNs stamp = kFullHour + 1'327'000LL * i;
    add_velodyne(decoder, packet, stamp);
    if (i == 1) add_velodyne(decoder, packet, stamp + 30'000);
  }
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0]->points.size(), 3U * 384);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 1U);
  EXPECT_NE(test::all_warnings(log).find("packet 3: comes twice"), std::string::npos)
      << test::all_warnings(log);
}

}  // namespace
}  // namespace understory
