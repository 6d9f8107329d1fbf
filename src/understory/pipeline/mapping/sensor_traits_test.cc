#include "understory/pipeline/mapping/sensor_traits.h"

#include <gtest/gtest.h>

#include <vector>

namespace understory {
namespace {

// Scans of the given sizes, 100 ms apart, an IMU sample before each.
class ScansOf : public Recording {
 public:
  explicit ScansOf(std::vector<std::size_t> sizes, bool second_lidar = false)
      : sizes_(std::move(sizes)) {
    rig_.body_from_imu = Pose();
    rig_.body_from_lidar = Pose(Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0});
    const Pose second(Eigen::Quaterniond::Identity(), {0.0, 0.0, 2.0});
    if (second_lidar) rig_.further_lidars.push_back({second, kRingsALidar});
  }
  std::optional<Event> next() override {
    if (i_ == 2 * sizes_.size()) return std::nullopt;
    const std::size_t k = i_ / 2;
    const auto stamp = static_cast<TimeNs>(k) * 100'000'000;
    if (i_++ % 2 == 0) {
      ImuSample sample;
      sample.stamp = stamp;
      return Event(sample);
    }
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    scan->ring_count = 16;
    scan->points.resize(sizes_[k]);
    return Event(ScanPtr(scan));
  }
  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override { return {}; }
  std::string format() const override { return "scans"; }
  double progress() const override { return 0.0; }

 private:
  std::vector<std::size_t> sizes_;
  std::size_t i_ = 0;
  Rig rig_;
};

SensorTraits traits_of(const std::vector<std::size_t>& sizes) {
  SensorTraits traits;
  static_cast<void>(learn_traits(std::make_unique<ScansOf>(sizes), traits));
  return traits;
}

// One early scan decided: a part of a revolution made a dense lidar a sparse one.
TEST(SensorTraits, EarlyScansThatSeeLittleDoNotDecide) {
  EXPECT_EQ(traits_of({8'000, 12'000, 9'000, 110'000, 112'000, 111'000}).scan_points, 111'000U);
  EXPECT_EQ(traits_of({29'000, 58'000, 29'100, 28'900}).scan_points, 29'100U);
  EXPECT_EQ(traits_of({50'000, 100'000}).scan_points, 100'000U);
  EXPECT_EQ(traits_of({500, 400, 450, 430}).scan_points, 450U);
}

TEST(SensorTraits, EmptyScansAreWaitedOver) {
  std::vector<std::size_t> sizes(30, 3);
  sizes.insert(sizes.end(), 12, 110'000);
  EXPECT_EQ(traits_of(sizes).scan_points, 110'000U);
  EXPECT_EQ(traits_of(std::vector<std::size_t>(300, 0)).scan_points, 0U);
  EXPECT_EQ(traits_of({}).scan_points, 0U);
}

TEST(SensorTraits, TellWhatTheSensorsAre) {
  const SensorTraits traits = traits_of({29'000, 29'100, 29'200});
  EXPECT_EQ(traits.rings, 16);
  EXPECT_DOUBLE_EQ(traits.period_s, 0.1);
  EXPECT_TRUE(traits.has_imu);
  EXPECT_EQ(traits.lidar_in_body, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(to_string(traits),
            "lidar: 29100 points a scan, 16 rings, 10.0 scans a second; with an IMU");
}

// Lidars are placed on the body, and stay so in a checkpoint.
TEST(SensorTraits, TellWhereAllLidarsAre) {
  SensorTraits traits;
  static_cast<void>(
      learn_traits(std::make_unique<ScansOf>(std::vector<std::size_t>(3, 29'000), true), traits));
  ASSERT_EQ(traits.further_lidars_in_body.size(), 1U);
  EXPECT_LT((traits.further_lidars_in_body[0] - Eigen::Vector3d(1.0, 2.0, 5.0)).norm(), 1e-12);
  BinaryWriter writer;
  put_traits(writer, traits);
  BinaryReader reader(writer.bytes(), "test");
  EXPECT_EQ(get_traits(reader).further_lidars_in_body, traits.further_lidars_in_body);
  EXPECT_TRUE(reader.at_end());
}

// Scans, and an IMU whose samples the reader drops.
class ScansBesideNoNumbers : public ScansOf {
 public:
  using ScansOf::ScansOf;
  std::optional<Event> next() override {
    std::optional<Event> event = ScansOf::next();
    while (event && std::holds_alternative<ImuSample>(*event)) {
      ++dropped_;
      event = ScansOf::next();
    }
    return event;
  }
  std::vector<TopicReport> topics() const override {
    TopicReport imu;
    imu.role = "imu";
    imu.messages = imu.not_numbers = dropped_;
    return {imu};
  }

 private:
  std::uint64_t dropped_ = 0;
};

// A regression: such a run took the settings of one with an IMU and was worse than without.
TEST(SensorTraits, AnImuThatSendsNoNumbersIsNone) {
  SensorTraits traits;
  static_cast<void>(learn_traits(
      std::make_unique<ScansBesideNoNumbers>(std::vector<std::size_t>(5, 29'000)), traits));
  EXPECT_FALSE(traits.has_imu);
  EXPECT_TRUE(traits.imu_is_numb);
  EXPECT_NE(to_string(traits).find("an IMU whose samples are not numbers"), std::string::npos);
  EXPECT_FALSE(traits_of({29'000, 29'000}).imu_is_numb);
}

TEST(SensorTraits, WhatIsLookedAtIsStillThere) {
  const std::vector<std::size_t> sizes(15, 2'000);
  SensorTraits traits;
  const auto recording = learn_traits(std::make_unique<ScansOf>(sizes), traits);
  ScansOf other(sizes);
  std::size_t events = 0;
  while (auto event = recording->next()) {
    const auto expected = other.next();
    ASSERT_TRUE(expected);
    EXPECT_EQ(event->index(), expected->index());
    EXPECT_EQ(event_time(*event), event_time(*expected));
    ++events;
  }
  EXPECT_EQ(events, 30U);
}

}  // namespace
}  // namespace understory
