#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "understory/recording/bags/mcap_writer.h"
#include "understory/recording/recording.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory::test {

// Where the example data may lie (absent in most places: then tests skip).
inline std::filesystem::path data_folder() {
  const char* named = std::getenv("UNDERSTORY_DATA");
  if (named != nullptr) return named;
  return std::filesystem::path(UNDERSTORY_SOURCE_DIR) / ".." / "shared" / "data";
}

inline std::vector<std::uint8_t> read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

inline constexpr TimeNs kStart = 1'700'000'000'123'456'789;

// A second of a rig: scans at 10 Hz, IMU at 100 Hz, fixes at 2 Hz, all values different.
struct Drive {
  Rig rig;
  std::vector<Event> events;  // in the order of event_time
};

inline Scan make_scan(TimeNs stamp, int points, std::uint64_t seed) {
  Scan scan;
  scan.stamp = stamp;
  scan.ring_count = 16;
  for (int i = 0; i < points; ++i) {
    ScanPoint point;
    point.x = 1.0F + static_cast<float>((i * 37 + static_cast<int>(seed) * 11) % 1000) * 0.01F;
    point.y = static_cast<float>((i * 17) % 300) * 0.02F - 3.0F;
    point.z = static_cast<float>(i % 16) * 0.1F;
    point.intensity = static_cast<float>(i % 256);
    point.ring = static_cast<std::uint16_t>(i % 16);
    point.t_ns = static_cast<std::uint32_t>(99'000'000LL * i / points);
    scan.points.push_back(point);
  }
  return scan;
}

inline Drive make_drive(int seconds, int points_per_scan = 500) {
  Drive drive;
  drive.rig.body_frame = "base_link";
  drive.rig.body_from_lidar = Pose(so3_exp({0.1, -0.2, 0.3}), {0.1, 0.2, 1.5});
  drive.rig.body_from_imu = Pose(so3_exp({0.0, 0.0, 1.5}), {-0.1, 0.0, 1.4});
  drive.rig.body_from_gnss = Pose(so3_exp({0.0, 0.0, 0.0}), {0.0, 0.0, 2.0});
  drive.rig.lidar_model = "VLP-16";
  for (int i = 0; i < seconds * 100; ++i) {
    const TimeNs now = kStart + i * 10'000'000LL;
    ImuSample sample;
    sample.stamp = now;
    sample.angular_rate = {0.01 * i, -0.02, 0.03};
    sample.specific_force = {0.1, 0.001 * i, 9.81};
    if (i % 2 == 1) sample.orientation = so3_exp({0.0, 0.0, 0.01 * i});
    drive.events.emplace_back(sample);
    MagSample mag;
    mag.stamp = now;
    mag.field = {2e-5, 1e-7 * i, -4e-5};
    if (i % 10 == 3) drive.events.emplace_back(mag);
    if (i % 50 == 5) {
      GnssFix fix;
      fix.stamp = now;
      fix.latitude_deg = 47.1 + 1e-6 * i;
      fix.longitude_deg = 8.5;
      fix.height_m = 512.25;
      fix.covariance = Eigen::Vector3d(1.0, 2.0, 3.0).asDiagonal();
      fix.quality = 5;
      fix.satellites = 11;
      fix.hdop = 1.25;
      fix.vdop = 2.5;
      fix.track_deg = 77.0;
      fix.speed_m_s = 1.5;
      drive.events.emplace_back(fix);
    }
    // A scan is complete at its end.
    if (i % 10 == 9) {
      auto scan = std::make_shared<Scan>(
          make_scan(now - 90'000'000LL, points_per_scan, static_cast<std::uint64_t>(i)));
      scan->points.back().t_ns = 90'000'000U;
      drive.events.emplace_back(ScanPtr(scan));
    }
  }
  return drive;
}

inline void write_drive(const std::string& path, const Drive& drive,
                        const McapWriterOptions& options = {}) {
  McapWriter writer(path, options);
  writer.set_rig(drive.rig);
  for (const Event& event : drive.events)
    writer.write(event);
  writer.finish();
}

// Many chunks in a short file.
inline McapWriterOptions small_chunks(McapCompression compression = McapCompression::kZstd) {
  McapWriterOptions options;
  options.compression = compression;
  options.chunk_size_bytes = 20'000;
  return options;
}

inline std::vector<Event> read_all(Recording& recording) {
  std::vector<Event> events;
  while (auto event = recording.next())
    events.push_back(std::move(*event));
  return events;
}

inline void expect_same(const Scan& a, const Scan& b) {
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.has_point_times, b.has_point_times);
  EXPECT_EQ(a.ring_count, b.ring_count);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const ScanPoint& p = a.points[i];
    const ScanPoint& q = b.points[i];
    ASSERT_TRUE(p.x == q.x && p.y == q.y && p.z == q.z && p.intensity == q.intensity &&
                p.ring == q.ring && p.t_ns == q.t_ns && p.return_index == q.return_index)
        << "point " << i << " of the scan at " << a.stamp;
  }
}

inline void expect_same(const GnssFix& a, const GnssFix& b) {
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.latitude_deg, b.latitude_deg);
  EXPECT_EQ(a.longitude_deg, b.longitude_deg);
  EXPECT_EQ(a.height_m, b.height_m);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.quality, b.quality);
  EXPECT_EQ(a.satellites, b.satellites);
  EXPECT_EQ(a.hdop, b.hdop);
  EXPECT_EQ(a.vdop, b.vdop);
  EXPECT_EQ(a.track_deg, b.track_deg);
  EXPECT_EQ(a.speed_m_s, b.speed_m_s);
}

inline void expect_same(const Event& a, const Event& b) {
  ASSERT_EQ(a.index(), b.index());
  if (const auto* scan = std::get_if<ScanPtr>(&a)) {
    expect_same(**scan, *std::get<ScanPtr>(b));
  } else if (const auto* fix = std::get_if<GnssFix>(&a)) {
    expect_same(*fix, std::get<GnssFix>(b));
  } else if (const auto* imu = std::get_if<ImuSample>(&a)) {
    const auto& other = std::get<ImuSample>(b);
    EXPECT_EQ(imu->stamp, other.stamp);
    EXPECT_EQ(imu->angular_rate, other.angular_rate);
    EXPECT_EQ(imu->specific_force, other.specific_force);
    ASSERT_EQ(imu->orientation.has_value(), other.orientation.has_value());
    if (imu->orientation) {
      EXPECT_EQ(imu->orientation->coeffs(), other.orientation->coeffs());
    }
  } else {
    EXPECT_EQ(std::get<MagSample>(a).stamp, std::get<MagSample>(b).stamp);
    EXPECT_EQ(std::get<MagSample>(a).field, std::get<MagSample>(b).field);
  }
}

inline std::size_t count_of(const Log& log, const std::string& key) {
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key == key) return warning.count;
  }
  return 0;
}

inline std::string all_warnings(const Log& log) {
  std::string text;
  for (const Log::Warning& warning : log.warnings())
    text += warning.key + ": " + warning.first_message + "\n";
  return text;
}

}  // namespace understory::test
