#include "understory/recording/point_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/recording/recording_test_support.h"

namespace understory {
namespace {

using test::kStart;

using Kind = TimeConvention::Kind;
using Stamp = TimeConvention::Stamp;

constexpr TimeNs kPeriod = 100'000'000;

// One way of writing the times of points: the value for a point `offset` ns after the start of a
// scan. The scan began at `start`.
struct Style {
  const char* name;
  FieldType type;
  Stamp stamp;     // which point the header stamp is of
  TimeNs arrives;  // log time after the end of the scan; negative: log time = stamp
  std::function<double(TimeNs start, TimeNs offset)> value;
  Kind kind;
  double unit_s;
};

std::ostream& operator<<(std::ostream& out, const Style& style) {
  return out << style.name;
}

double seconds(TimeNs time) {
  return static_cast<double>(time) * 1e-9;
}

const Style kStyles[] = {
    {"t: uint32 ns offset", FieldType::kUint32, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs, TimeNs offset) { return static_cast<double>(offset); }, Kind::kOffset, 1e-9},
    {"time: float32 s offset", FieldType::kFloat32, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs, TimeNs offset) { return seconds(offset); }, Kind::kOffset, 1.0},
    {"time: float32 s offset, log time = stamp", FieldType::kFloat32, Stamp::kFirstPoint, -1,
     [](TimeNs, TimeNs offset) { return seconds(offset); }, Kind::kOffset, 1.0},
    {"time: float32 s, negative before the stamp", FieldType::kFloat32, Stamp::kLastPoint,
     5'000'000, [](TimeNs, TimeNs offset) { return seconds(offset - kPeriod + 1'000'000); },
     Kind::kOffset, 1.0},
    {"offset_time: uint32 us offset", FieldType::kUint32, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs, TimeNs offset) { return std::floor(static_cast<double>(offset) * 1e-3); },
     Kind::kOffset, 1e-6},
    {"time: float64 ms offset", FieldType::kFloat64, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs, TimeNs offset) { return static_cast<double>(offset) * 1e-6; }, Kind::kOffset, 1e-3},
    {"offsets from the first point, stamp of the last", FieldType::kUint32, Stamp::kLastPoint,
     5'000'000, [](TimeNs, TimeNs offset) { return static_cast<double>(offset); }, Kind::kOffset,
     1e-9},
    {"timestamp: float64 s absolute", FieldType::kFloat64, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs start, TimeNs offset) { return seconds(start + offset); }, Kind::kAbsolute, 1.0},
    {"timestamp: float64 s absolute, stamp of the last", FieldType::kFloat64, Stamp::kLastPoint,
     5'000'000, [](TimeNs start, TimeNs offset) { return seconds(start + offset); },
     Kind::kAbsolute, 1.0},
    {"timestamp: float64 ns absolute", FieldType::kFloat64, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs start, TimeNs offset) { return static_cast<double>(start + offset); },
     Kind::kAbsolute, 1e-9},
    {"time_stamp: uint32 us since the hour", FieldType::kUint32, Stamp::kFirstPoint, 5'000'000,
     [](TimeNs start, TimeNs offset) {
       return std::floor(static_cast<double>((start + offset) % (3600 * kNsPerSecond)) * 1e-3);
     },
     Kind::kForeignClock, 1e-6},
};

class PointTimes : public ::testing::TestWithParam<Style> {};
INSTANTIATE_TEST_SUITE_P(Styles, PointTimes, ::testing::ValuesIn(kStyles));

// A cloud with x, y, z (float32) and the time field at byte 16 in any type.
struct RawCloud {
  std::vector<std::uint8_t> bytes;
  PointCloud2Message message;
};

void store(double value, FieldType type, std::uint8_t* raw) {
  const auto put = [&](auto typed) { std::memcpy(raw, &typed, sizeof typed); };
  if (type == FieldType::kUint32) put(static_cast<std::uint32_t>(value));
  if (type == FieldType::kFloat32) put(static_cast<float>(value));
  if (type == FieldType::kFloat64) put(value);
}

constexpr int kTimedPoints = 200;

TimeNs offset_of(int point) {
  return (kPeriod - 1'000'000) * point / (kTimedPoints - 1);
}

RawCloud make_cloud(const Style& style, TimeNs start) {
  RawCloud cloud;
  constexpr std::uint32_t kStep = 24;
  cloud.bytes.resize(kStep * kTimedPoints);
  for (int i = 0; i < kTimedPoints; ++i) {
    std::uint8_t* raw = cloud.bytes.data() + kStep * i;
    const float xyz[3] = {1.0F + static_cast<float>(i), 2.0F, 3.0F};
    std::memcpy(raw, xyz, sizeof xyz);
    store(style.value(start, offset_of(i)), style.type, raw + 16);
  }
  PointCloud2Message& message = cloud.message;
  message.header.stamp = style.stamp == Stamp::kLastPoint ? start + kPeriod - 1'000'000 : start;
  message.height = 1;
  message.width = kTimedPoints;
  message.fields = {{"x", 0, FieldType::kFloat32, 1},
                    {"y", 4, FieldType::kFloat32, 1},
                    {"z", 8, FieldType::kFloat32, 1},
                    {"timestamp", 16, style.type, 1}};
  message.point_step = kStep;
  message.row_step = kStep * kTimedPoints;
  message.data = cloud.bytes;
  return cloud;
}

// `every`: of so many scans one is recorded.
TimeConvention detect(const Style& style, int every = 1) {
  std::vector<CloudTimes> clouds;
  for (int k = 0; k < 8; ++k) {
    const TimeNs start = kStart + k * every * kPeriod;
    const RawCloud cloud = make_cloud(style, start);
    const auto layout = CloudLayout::find(cloud.message);
    const TimeNs log_time =
        style.arrives < 0 ? cloud.message.header.stamp : start + kPeriod + style.arrives;
    clouds.push_back(measure_times(cloud.message, *layout, log_time));
  }
  return detect_point_times("timestamp", "any", clouds, std::vector<TimeNs>(100, 1'000'000));
}

TEST_P(PointTimes, AreUnderstood) {
  const Style& style = GetParam();
  const TimeConvention convention = detect(style);
  EXPECT_EQ(convention.kind, style.kind) << convention.text;
  EXPECT_EQ(convention.unit_s, style.unit_s) << convention.text;
  EXPECT_EQ(convention.stamp, style.stamp) << convention.text;

  const TimeNs start = kStart + 3 * kPeriod;
  const RawCloud cloud = make_cloud(style, start);
  const ConvertedCloud converted =
      convert_cloud(cloud.message, *CloudLayout::find(cloud.message), convention);
  ASSERT_EQ(converted.scan->points.size(), static_cast<std::size_t>(kTimedPoints));
  EXPECT_TRUE(converted.scan->has_point_times);
  // The coarsest of them, microseconds since the hour, starts within one of the first point.
  for (int i = 0; i < kTimedPoints; ++i) {
    const TimeNs time = converted.scan->stamp + converted.scan->points[i].t_ns;
    ASSERT_NEAR(static_cast<double>(time - start - offset_of(i)), 0.0, 2'000.0) << "point " << i;
  }
}

TEST_P(PointTimes, AreUnderstoodWhereMostScansWereLeftOut) {
  const TimeConvention convention = detect(GetParam(), 60);
  EXPECT_EQ(convention.kind, GetParam().kind) << convention.text;
  EXPECT_EQ(convention.unit_s, GetParam().unit_s) << convention.text;
}

TEST(PointTimes, AbsentOrConstantTimesAreSaidToBeMissing) {
  std::vector<CloudTimes> clouds(5);
  for (int k = 0; k < 5; ++k) {
    clouds[k].stamp = kStart + k * kPeriod;
    clouds[k].log_time = clouds[k].stamp;
  }
  EXPECT_EQ(detect_point_times("", "", clouds, {}).kind, Kind::kNone);
  for (CloudTimes& cloud : clouds)
    cloud.low = cloud.high = 17.0;
  const TimeConvention constant = detect_point_times("t", "uint32", clouds, {});
  EXPECT_EQ(constant.kind, Kind::kNone);
  EXPECT_FALSE(constant.warning.empty());
}

// Without times per point, the arrival still tells which end of the scan the stamp is of.
TEST(PointTimes, ArrivalShowsTheStampOfTheLastPoint) {
  std::vector<CloudTimes> clouds(8);
  for (int k = 0; k < 8; ++k) {
    clouds[k].stamp = kStart + k * kPeriod;
    clouds[k].log_time = clouds[k].stamp + 8'000'000;
  }
  const std::vector<TimeNs> imu(50, 2'000'000);
  const TimeConvention late = detect_point_times("", "", clouds, imu);
  EXPECT_EQ(late.stamp, Stamp::kLastPoint);
  EXPECT_EQ(late.shift, -kPeriod);
  for (CloudTimes& cloud : clouds)
    cloud.log_time += kPeriod;
  EXPECT_EQ(detect_point_times("", "", clouds, imu).stamp, Stamp::kFirstPoint);
}

TEST(PointTimes, ConvertsRawTimesExactly) {
  EXPECT_EQ(raw_time_to_ns(4'294'967'295.0, 1e-9), 4'294'967'295);
  EXPECT_EQ(raw_time_to_ns(-12.0, 1e-6), -12'000);
  EXPECT_EQ(raw_time_to_ns(1'700'000'000.5, 1.0), 1'700'000'000'500'000'000);
  EXPECT_EQ(raw_time_to_ns(std::nan(""), 1.0), 0);
  EXPECT_EQ(raw_time_to_ns(1e300, 1.0), 0);
}

TEST(PointCloud, DropsNanAndZeroRangePointsAndReadsAnyLayout) {
  // Organised 2 x 3, big-endian, with padding at the rows' ends, no ring field.
  std::vector<std::uint8_t> bytes(2 * 64, 0);
  const auto put = [&](int row, int column, int field, float value) {
    std::uint8_t raw[4];
    std::memcpy(raw, &value, 4);
    std::reverse(raw, raw + 4);
    std::memcpy(bytes.data() + row * 64 + column * 16 + field * 4, raw, 4);
  };
  for (int row = 0; row < 2; ++row) {
    put(row, 0, 0, 5.0F);  // column 1 stays at zero range
    put(row, 0, 3, 77.0F);
    put(row, 2, 1, std::nanf(""));
  }
  PointCloud2Message cloud;
  cloud.header.stamp = kStart;
  cloud.height = 2;
  cloud.width = 3;
  cloud.big_endian = true;
  cloud.point_step = 16;
  cloud.row_step = 64;
  cloud.fields = {{"X", 0, FieldType::kFloat32, 1},
                  {"Y", 4, FieldType::kFloat32, 1},
                  {"Z", 8, FieldType::kFloat32, 1},
                  {"Reflectivity", 12, FieldType::kFloat32, 1}};
  cloud.data = bytes;
  const auto layout = CloudLayout::find(cloud);
  ASSERT_TRUE(layout);
  const ConvertedCloud converted = convert_cloud(cloud, *layout, {});
  ASSERT_EQ(converted.scan->points.size(), 2U);
  EXPECT_EQ(converted.without_return, 4U);
  EXPECT_EQ(converted.scan->points[1].x, 5.0F);
  EXPECT_EQ(converted.scan->points[1].intensity, 77.0F);
  EXPECT_EQ(converted.scan->points[1].ring, 1);
  EXPECT_EQ(converted.scan->ring_count, 2);
  EXPECT_FALSE(converted.scan->has_point_times);
  // Fields beyond the point are not there.
  cloud.fields[2].offset = 14;
  EXPECT_FALSE(CloudLayout::find(cloud));
}

}  // namespace
}  // namespace understory
