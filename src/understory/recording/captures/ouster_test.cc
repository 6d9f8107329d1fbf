#include "understory/recording/captures/ouster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::Bytes;
using test::drain;
using test::put;

OusterMetadata small_sensor(OusterProfile profile) {
  OusterMetadata metadata;
  metadata.profile = profile;
  metadata.pixels_per_column = 2;
  metadata.columns_per_packet = 4;
  metadata.columns_per_frame = 16;
  metadata.last_column = 15;
  metadata.beam_altitude_deg = {10.0, -5.0};
  metadata.beam_azimuth_deg = {4.0, -4.0};
  metadata.lidar_from_beam(0, 3) = 0.015;
  metadata.sensor_from_lidar =
      Pose(so3_exp({0.0, 0.0, std::numbers::pi}), Eigen::Vector3d(0.0, 0.0, 0.036));
  return metadata;
}

// One pixel of `range_mm`, the second return 100 mm behind.
void put_pixel(Bytes& bytes, OusterProfile profile, std::uint32_t range_mm) {
  switch (profile) {
    case OusterProfile::kLegacy:
    case OusterProfile::kRng19:
      put(bytes, range_mm);
      put(bytes, std::uint16_t{9});
      put(bytes, std::uint16_t{77});
      put(bytes, std::uint32_t{5});
      break;
    case OusterProfile::kDual:
      put(bytes, range_mm);
      put(bytes, range_mm + 100);
      put(bytes, std::uint16_t{77});
      put(bytes, std::uint16_t{33});
      put(bytes, std::uint32_t{5});
      break;
    case OusterProfile::kRng15:
    case OusterProfile::kRng15Dual:
      put(bytes, static_cast<std::uint16_t>(range_mm / 8));
      put(bytes, std::uint16_t{77});
      if (profile == OusterProfile::kRng15) break;
      put(bytes, static_cast<std::uint16_t>((range_mm + 104) / 8));
      put(bytes, std::uint16_t{33});
  }
}

Bytes make_ouster(const OusterMetadata& metadata, std::uint16_t frame, std::uint16_t first,
                  TimeNs time, std::uint32_t range_mm = 4000) {
  const bool legacy = metadata.profile == OusterProfile::kLegacy;
  Bytes bytes;
  if (!legacy) {
    put(bytes, std::uint16_t{1});
    put(bytes, frame);
    bytes.resize(32, 0);
  }
  for (int i = 0; i < metadata.columns_per_packet; ++i) {
    put(bytes, time + i * 100'000);
    put(bytes, static_cast<std::uint16_t>(first + i));
    put(bytes, legacy ? frame : std::uint16_t{1});
    if (legacy) put(bytes, std::uint32_t{0});
    for (int pixel = 0; pixel < metadata.pixels_per_column; ++pixel)
      put_pixel(bytes, metadata.profile, range_mm);
    if (legacy) put(bytes, std::uint32_t{0xFFFFFFFF});
  }
  if (!legacy) bytes.resize(bytes.size() + 32, 0);
  return bytes;
}

void add_ouster(OusterDecoder& decoder, const Bytes& bytes) {
  decoder.add_lidar_packet(bytes.data(), bytes.size());
}

// A stream that begins within a turn, over the whole turn and over a window of 8 columns.
TEST(Ouster, LeavesOutAFirstScanThatIsAPart) {
  for (const int window : {16, 8}) {
    OusterMetadata metadata = small_sensor(OusterProfile::kRng19);
    metadata.last_column = window - 1;
    for (const int first : {0, 4}) {
      Log log;
      OusterDecoder decoder(metadata, "test", log);
      for (int frame = 0; frame < 3; ++frame) {
        for (int column = frame == 0 ? first : 0; column < window; column += 4) {
          add_ouster(decoder,
                     make_ouster(metadata, static_cast<std::uint16_t>(frame),
                                 static_cast<std::uint16_t>(column),
                                 5'000'000'000 + frame * 100'000'000LL + column * 100'000LL));
        }
      }
      EXPECT_EQ(drain(decoder).size(), first == 0 ? 3U : 2U) << window;
      EXPECT_EQ(test::count_of(log, "scan.part"), first == 0 ? 0U : 1U) << window;
    }
  }
}

class OusterProfiles : public ::testing::TestWithParam<OusterProfile> {};

// Against the formula of the manual, written out here in another way.
TEST_P(OusterProfiles, GivesThePointsOfTheManual) {
  const OusterMetadata metadata = small_sensor(GetParam());
  const bool dual = GetParam() == OusterProfile::kDual || GetParam() == OusterProfile::kRng15Dual;
  Log log;
  OusterDecoder decoder(metadata, "test", log);
  const Bytes bytes = make_ouster(metadata, 7, 4, 5'000'000'000);
  ASSERT_EQ(bytes.size(), metadata.lidar_packet_size());
  add_ouster(decoder, bytes);
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 1U);
  const Scan& scan = *scans[0];
  EXPECT_EQ(scan.stamp, 5'000'000'000);
  EXPECT_EQ(scan.ring_count, 2);
  const std::size_t per_column = dual ? 4 : 2;
  ASSERT_EQ(scan.points.size(), 4 * per_column);
  // Column 6, lower beam.
  const ScanPoint& point = scan.points[2 * per_column + per_column / 2];
  EXPECT_EQ(point.t_ns, 200'000U);
  EXPECT_EQ(point.ring, 0);
  EXPECT_EQ(point.intensity, 77.0F);
  const double encoder = -2.0 * std::numbers::pi * 6.0 / 16.0;
  const double direction = encoder + 4.0 * kDegree;
  const double range = 4.0 - 0.015;
  const Eigen::Vector3d in_lidar(
      range * std::cos(5.0 * kDegree) * std::cos(direction) + 0.015 * std::cos(encoder),
      range * std::cos(5.0 * kDegree) * std::sin(direction) + 0.015 * std::sin(encoder),
      -range * std::sin(5.0 * kDegree));
  EXPECT_NEAR(point.x, -in_lidar.x(), 1e-5);
  EXPECT_NEAR(point.y, -in_lidar.y(), 1e-5);
  EXPECT_NEAR(point.z, in_lidar.z() + 0.036, 1e-5);
  if (dual) {
    const ScanPoint& second = scan.points[2 * per_column + 3];
    EXPECT_EQ(second.return_index, 1);
    EXPECT_EQ(second.intensity, 33.0F);
  }
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

INSTANTIATE_TEST_SUITE_P(All, OusterProfiles,
                         ::testing::Values(OusterProfile::kLegacy, OusterProfile::kRng19,
                                           OusterProfile::kDual, OusterProfile::kRng15,
                                           OusterProfile::kRng15Dual));

TEST(Ouster, SplitsFramesAndDropsDoubledPackets) {
  const OusterMetadata metadata = small_sensor(OusterProfile::kRng19);
  Log log;
  OusterDecoder decoder(metadata, "test", log);
  TimeNs time = 1'000'000'000;
  for (const std::uint16_t frame : {65535, 0, 1}) {
    for (const std::uint16_t first : {0, 4, 4, 8, 12}) {
      add_ouster(decoder, make_ouster(metadata, frame, first, time + first * 100'000));
    }
    time += 100'000'000;
  }
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 3U);
  for (const ScanPtr& scan : scans)
    EXPECT_EQ(scan->points.size(), 32U);
  EXPECT_EQ(scans[2]->stamp - scans[1]->stamp, 100'000'000);
}

TEST(Ouster, GoesOnBehindAGapAndPassesOverDamage) {
  const OusterMetadata metadata = small_sensor(OusterProfile::kLegacy);
  Log log;
  OusterDecoder decoder(metadata, "test", log);
  add_ouster(decoder, make_ouster(metadata, 5, 0, 1'000'000'000));
  add_ouster(decoder, make_ouster(metadata, 999, 4, 1'000'400'000));  // flipped frame
  add_ouster(decoder, make_ouster(metadata, 5, 8, 900'000'000'000));  // flipped time
  add_ouster(decoder, make_ouster(metadata, 5, 12, 1'001'200'000));
  decoder.add_lidar_packet(make_ouster(metadata, 5, 12, 1).data(), 17);  // cut short
  add_ouster(decoder, make_ouster(metadata, 105, 0, 11'000'000'000));    // 10 s later
  add_ouster(decoder, make_ouster(metadata, 105, 4, 11'000'400'000));
  const auto scans = drain(decoder);
  ASSERT_EQ(scans.size(), 2U);
  EXPECT_EQ(scans[0]->points.size(), 16U);
  EXPECT_EQ(scans[1]->points.size(), 16U);
  EXPECT_EQ(scans[1]->stamp, 11'000'000'000);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 3U) << test::all_warnings(log);
}

TEST(Ouster, LeavesOutPixelsWithoutReturn) {
  const OusterMetadata metadata = small_sensor(OusterProfile::kRng19);
  Log log;
  OusterDecoder decoder(metadata, "test", log);
  add_ouster(decoder, make_ouster(metadata, 1, 0, 1'000, 0));
  EXPECT_TRUE(drain(decoder).empty());
}

TEST(Ouster, ImuPacketsAreInSi) {
  Log log;
  OusterDecoder decoder(small_sensor(OusterProfile::kLegacy), "test", log);
  Bytes bytes;
  for (const std::uint64_t time : {10U, 20U, 30U})
    put(bytes, time);
  for (const float value : {0.5F, 0.0F, 1.0F, 180.0F, 0.0F, -90.0F})
    put(bytes, value);
  const auto sample = decoder.add_imu_packet(bytes.data(), bytes.size());
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->stamp, 30);
  EXPECT_NEAR(sample->specific_force.x(), 4.903325, 1e-12);
  EXPECT_NEAR(sample->specific_force.z(), 9.80665, 1e-12);
  EXPECT_NEAR(sample->angular_rate.x(), std::numbers::pi, 1e-12);
  const float nan = std::nanf("");
  std::memcpy(bytes.data() + 24, &nan, 4);
  EXPECT_FALSE(decoder.add_imu_packet(bytes.data(), bytes.size()));
  EXPECT_FALSE(decoder.add_imu_packet(bytes.data(), 47));
}

TEST(OusterMetadata, ReadsTheFlatAndTheNestedLayout) {
  const std::string flat = R"({"prod_line": "OS-0-2", "lidar_mode": "1024x10",
      "beam_altitude_angles": [10, -5], "beam_azimuth_angles": [4, -4],
      "lidar_origin_to_beam_origin_mm": 27.67, "udp_port_lidar": 7502,
      "imu_to_sensor_transform": [1,0,0,6.253, 0,1,0,-11.775, 0,0,1,7.645, 0,0,0,1],
      "lidar_to_sensor_transform": [-1,0,0,0, 0,-1,0,0, 0,0,1,36.18, 0,0,0,1]})";
  const std::string nested = R"({"sensor_info": {"prod_line": "OS-0-2"},
      "beam_intrinsics": {"beam_altitude_angles": [10, -5], "beam_azimuth_angles": [4, -4],
        "beam_to_lidar_transform": [1,0,0,27.67, 0,1,0,0, 0,0,1,0, 0,0,0,1]},
      "imu_intrinsics": {"imu_to_sensor_transform":
        [1,0,0,6.253, 0,1,0,-11.775, 0,0,1,7.645, 0,0,0,1]},
      "lidar_intrinsics": {"lidar_to_sensor_transform":
        [-1,0,0,0, 0,-1,0,0, 0,0,1,36.18, 0,0,0,1]},
      "lidar_data_format": {"columns_per_frame": 1024, "columns_per_packet": 16,
        "pixels_per_column": 2, "column_window": [0, 1023], "udp_profile_lidar": "LEGACY"},
      "config_params": {"lidar_mode": "1024x10", "udp_port_lidar": 7502}})";
  const OusterMetadata a = parse_ouster_metadata(flat, "flat.json");
  const OusterMetadata b = parse_ouster_metadata(nested, "nested.json");
  for (const OusterMetadata& metadata : {a, b}) {
    EXPECT_EQ(metadata.product, "OS-0-2");
    EXPECT_EQ(metadata.columns_per_frame, 1024);
    EXPECT_EQ(metadata.lidar_packet_size(), 16U * (16 + 2 * 12 + 4));
    EXPECT_NEAR(metadata.lidar_from_beam(0, 3), 0.02767, 1e-12);
    EXPECT_EQ(metadata.lidar_port, 7502);
    const Eigen::Vector3d origin = metadata.rig().body_from_lidar * Eigen::Vector3d::Zero();
    EXPECT_NEAR((origin - Eigen::Vector3d(-0.006253, 0.011775, -0.007645)).norm(), 0.0, 1e-12);
    EXPECT_NEAR(metadata.sensor_from_lidar.translation().z(), 0.03618, 1e-12);
  }
}

TEST(OusterMetadata, NamesWhatIsWrong) {
  const auto message_of = [](const std::string& json) {
    try {
      (void)parse_ouster_metadata(json, "sensor.json");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message_of("{").find("sensor.json"), std::string::npos);
  EXPECT_NE(message_of(R"({"lidar_mode": "wide"})").find("columns_per_frame"), std::string::npos);
  EXPECT_NE(message_of(R"({"lidar_mode": "512x10"})").find("beam_altitude"), std::string::npos);
  EXPECT_NE(message_of(R"({"lidar_mode": "512x10", "beam_altitude_angles": [1],
      "beam_azimuth_angles": [0], "udp_profile_lidar": "NEW"})")
                .find("NEW"),
            std::string::npos);
}

}  // namespace
}  // namespace understory
