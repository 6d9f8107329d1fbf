#include "understory/recording/recording_info.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "understory/recording/extrinsics.h"
#include "understory/recording/imu_axes.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::all_warnings;
using test::count_of;
using test::kStart;
using test::make_scan;
using test::TemporaryFolder;
using test::write_bytes;

// An IMU that is carried with tilts to all sides: attitude and its rate in closed form.
ImuSample carried_sample(int i) {
  const double t = 0.01 * i;
  const auto attitude = [](double time) {
    return so3_exp({0.3 * std::sin(1.1 * time), 0.25 * std::sin(0.7 * time + 1.0), 0.4 * time});
  };
  constexpr double kStep = 1e-4;
  const Eigen::Quaterniond now = attitude(t);
  ImuSample sample;
  sample.stamp = kStart + i * 10'000'000LL;
  sample.angular_rate =
      so3_log(attitude(t - kStep).conjugate() * attitude(t + kStep)) / (2 * kStep);
  sample.specific_force = now.conjugate() * Eigen::Vector3d(0.0, 0.0, 9.81);
  return sample;
}

Eigen::Vector3d swap_xy(const Eigen::Vector3d& v) {
  return {v.y(), -v.x(), v.z()};
}

TEST(ImuAxisCheck, AgreesWithAConsistentImu) {
  ImuAxisCheck check;
  for (int i = 0; i < 6000; ++i)
    check.add(carried_sample(i));
  EXPECT_EQ(check.result(), "x y z");
  EXPECT_NEAR(check.rate_scale(), 1.0, 0.05);
}

TEST(ImuAxisCheck, FindsSwappedAxes) {
  ImuAxisCheck check;
  for (int i = 0; i < 6000; ++i) {
    ImuSample sample = carried_sample(i);
    sample.angular_rate = swap_xy(sample.angular_rate);
    check.add(sample);
  }
  // (x, y) of the true rates are (-y, x) of the swapped ones.
  EXPECT_EQ(check.result().substr(0, 4), "-y x") << check.result();
}

TEST(ImuAxisCheck, FindsDegrees) {
  ImuAxisCheck check;
  for (int i = 0; i < 6000; ++i) {
    ImuSample sample = carried_sample(i);
    sample.angular_rate *= 180.0 / M_PI;
    check.add(sample);
  }
  EXPECT_NEAR(check.rate_scale(), M_PI / 180.0, 1e-3);
}

TEST(ImuAxisCheck, SaysNothingWithoutTilts) {
  ImuAxisCheck check;
  for (int i = 0; i < 6000; ++i) {
    ImuSample sample;
    sample.stamp = kStart + i * 10'000'000LL;
    sample.specific_force = {0.0, 0.0, 9.81};
    check.add(sample);
  }
  EXPECT_EQ(check.result(), "");
}

RecordingInfo info_of(const std::vector<Event>& events, const Rig& rig) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.mcap";
  {
    McapWriter writer(path);
    writer.set_rig(rig);
    for (const Event& event : events)
      writer.write(event);
    writer.finish();
  }
  Log log;
  const auto recording = open_recording(path, {}, log);
  RecordingSurvey survey;
  while (const auto event = recording->next())
    survey.add(*event);
  return survey.finish(path, *recording, log);
}

bool warns_of(const RecordingInfo& info, const std::string& part) {
  for (const std::string& warning : info.warnings) {
    if (warning.find(part) != std::string::npos) return true;
  }
  return false;
}

std::vector<Event> carried_drive(int seconds) {
  std::vector<Event> events;
  for (int i = 0; i < seconds * 100; ++i) {
    events.emplace_back(carried_sample(i));
    if (i % 10 != 9) continue;
    auto scan = std::make_shared<Scan>(make_scan(kStart + (i - 9) * 10'000'000LL, 200, 1));
    scan->points.back().t_ns = 90'000'000U;
    events.emplace_back(ScanPtr(std::move(scan)));
  }
  return events;
}

Rig imu_rig() {
  Rig rig;
  rig.body_frame = "imu";
  rig.body_from_imu = Pose();
  return rig;
}

TEST(RecordingInfo, AGoodRecordingHasNoWarnings) {
  const RecordingInfo info = info_of(carried_drive(20), imu_rig());
  EXPECT_TRUE(info.warnings.empty()) << info.warnings.front();
  EXPECT_EQ(info.lidar.scans, 200U);
  EXPECT_NEAR(info.lidar.rate_hz, 10.0, 1e-6);
  EXPECT_EQ(info.lidar.ring_count, 16);
  EXPECT_EQ(info.imu.samples, 2000U);
  EXPECT_NEAR(info.imu.rate_hz, 100.0, 1e-6);
  EXPECT_EQ(info.imu.gravity, "included");
  EXPECT_EQ(info.imu.gyroscope_axes, "x y z");
  EXPECT_NEAR(info.duration_s, 20.0, 0.02);
}

// What is said of a good recording after `change`.
RecordingInfo changed(const std::function<void(std::vector<Event>&)>& change) {
  std::vector<Event> events = carried_drive(20);
  change(events);
  return info_of(events, imu_rig());
}

TEST(RecordingInfo, WarnsOfEventsThatAreMissingOrTwice) {
  const auto drop = [](const std::function<bool(const Event&)>& wanted) {
    return [wanted](std::vector<Event>& events) { std::erase_if(events, wanted); };
  };
  const auto is_scan = [](const Event& e) { return std::holds_alternative<ScanPtr>(e); };
  const auto is_imu = [](const Event& e) { return std::holds_alternative<ImuSample>(e); };
  const TimeNs middle = kStart + 10 * kNsPerSecond;

  EXPECT_TRUE(warns_of(changed(drop(is_scan)), "lidar: there is none"));
  EXPECT_TRUE(warns_of(changed(drop(is_imu)), "imu: there is none"));
  EXPECT_TRUE(
      warns_of(changed(drop([&](const Event& e) { return is_imu(e) && event_time(e) > middle; })),
               "imu: stops 10.0 s before the lidar"));
  EXPECT_TRUE(warns_of(changed(drop([&](const Event& e) {
                         return is_scan(e) && std::abs(event_time(e) - middle) < kNsPerSecond;
                       })),
                       "lidar: 1 gaps, the longest of 2.10 s"));
  // Reading by log time puts the one that came late back beside its twin.
  EXPECT_TRUE(warns_of(changed([](std::vector<Event>& events) {
                         events.insert(events.begin() + 50, events[40]);
                         events.insert(events.begin() + 400, events[399]);
                       }),
                       "imu: 2 messages repeat"));
}

TEST(RecordingInfo, WarnsOfSamplesInOtherUnitsOrAxes) {
  const auto each_sample = [](const std::function<void(ImuSample&)>& change) {
    return [change](std::vector<Event>& events) {
      for (Event& event : events) {
        if (auto* sample = std::get_if<ImuSample>(&event)) change(*sample);
      }
    };
  };
  EXPECT_TRUE(warns_of(changed(each_sample([](ImuSample& s) { s.specific_force /= 9.80665; })),
                       "in g; converted"));
  EXPECT_TRUE(warns_of(changed(each_sample([](ImuSample& s) {
                         s.specific_force -= s.specific_force.normalized() * 9.81;
                       })),
                       "gravity has been taken out"));
  EXPECT_TRUE(warns_of(changed(each_sample([](ImuSample& s) { s.angular_rate *= 57.29578; })),
                       "degrees per second"));
  EXPECT_TRUE(
      warns_of(changed(each_sample([](ImuSample& s) { s.angular_rate = swap_xy(s.angular_rate); })),
               "disagree on the axes"));
  EXPECT_TRUE(warns_of(
      changed(each_sample([](ImuSample& s) {
        s.specific_force = {s.specific_force.z(), s.specific_force.x(), s.specific_force.y()};
        s.angular_rate = {s.angular_rate.z(), s.angular_rate.x(), s.angular_rate.y()};
      })),
      "not along z"));
}

TEST(RecordingInfo, WarnsOfPointsWithoutTimes) {
  EXPECT_TRUE(warns_of(changed([](std::vector<Event>& events) {
                         for (Event& event : events) {
                           auto* scan = std::get_if<ScanPtr>(&event);
                           if (scan == nullptr) continue;
                           auto copy = std::make_shared<Scan>(**scan);
                           copy->has_point_times = false;
                           for (ScanPoint& point : copy->points)
                             point.t_ns = 0;
                           *scan = copy;
                         }
                       }),
                       "no time per point"));
}

TEST(Extrinsics, AreFoundAlongChainsEitherWay) {
  TransformTree tree;
  const Pose base_from_mast(so3_exp({0.0, 0.0, 0.5}), {1.0, 0.0, 2.0});
  const Pose mast_from_lidar(so3_exp({0.1, 0.0, 0.0}), {0.0, 0.0, 0.3});
  const Pose imu_from_base(so3_exp({0.0, 0.2, 0.0}), {0.0, -1.0, 0.0});
  tree.add("base_link", "mast", base_from_mast);
  tree.add("mast", "os_sensor", mast_from_lidar);
  tree.add("imu_link", "base_link", imu_from_base);
  const Rig rig = rig_from_transforms(tree, {"os_sensor", "imu_link", "gps", ""});
  EXPECT_EQ(rig.body_frame, "base_link");
  EXPECT_LT(right_difference(rig.body_from_lidar, base_from_mast * mast_from_lidar).norm(), 1e-12);
  ASSERT_TRUE(rig.body_from_imu);
  EXPECT_LT(right_difference(*rig.body_from_imu, imu_from_base.inverse()).norm(), 1e-12);
  EXPECT_FALSE(rig.body_from_gnss);
  // The second antenna has a frame of its own; headings in that of the fixes tell nothing of it.
  tree.add("base_link", "gps", Pose());
  tree.add("base_link", "gps_bow", base_from_mast);
  const Rig two = rig_from_transforms(tree, {"os_sensor", "imu_link", "gps", "gps_bow"});
  ASSERT_TRUE(two.body_from_second_gnss);
  EXPECT_LT(right_difference(*two.body_from_second_gnss, base_from_mast).norm(), 1e-12);
  EXPECT_FALSE(
      rig_from_transforms(tree, {"os_sensor", "imu_link", "gps", "gps"}).body_from_second_gnss);
  // Without base_link the IMU is the body, without a chain to it the lidar.
  TransformTree without_base;
  without_base.add("imu_link", "os_sensor", mast_from_lidar);
  EXPECT_EQ(rig_from_transforms(without_base, {"os_sensor", "imu_link", "", ""}).body_frame, "imu");
  const Rig lidar_only = rig_from_transforms({}, {"os_sensor", "imu_link", "", ""});
  EXPECT_EQ(lidar_only.body_frame, "lidar");
  EXPECT_FALSE(lidar_only.body_from_imu);
}

TEST(Extrinsics, AFileOverridesAndTellsAllThatIsWrong) {
  const TemporaryFolder folder;
  const std::string path = folder / "rig.yaml";
  const auto write = [&](const std::string& text) {
    write_bytes(path, {text.begin(), text.end()});
  };
  write("body_frame: base_link\nbody_from_imu: {translation_m: [1, 2, 3], rpy_deg: [0, 0, 90]}\n");
  Rig rig;
  Log log;
  apply_extrinsics_file(path, {}, rig, log);
  EXPECT_EQ(rig.body_frame, "base_link");
  EXPECT_NE(all_warnings(log).find("taken to sit in its origin"), std::string::npos);
  ASSERT_TRUE(rig.body_from_imu);
  EXPECT_LT((*rig.body_from_imu * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(),
            1e-12);
  write("body_from_lidar: {translation_m: [1, 2], turn: 3}\nspeed: 4\n");
  try {
    apply_extrinsics_file(path, {}, rig, log);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.problems().size(), 3U);
  }
  EXPECT_THROW(apply_extrinsics_file(folder / "none.yaml", {}, rig, log), InputError);
}

void expect_near(const std::optional<Pose>& pose, const Pose& expected) {
  ASSERT_TRUE(pose);
  EXPECT_LT(right_difference(*pose, expected).norm(), 1e-9);
}

// Bug: the IMU kept its place on the recording's body although the file speaks of another one.
TEST(Extrinsics, OtherSensorsMoveToTheBodyOfTheFile) {
  const TemporaryFolder folder;
  const std::string path = folder / "rig.yaml";
  const auto write = [&](const std::string& text) {
    write_bytes(path, {text.begin(), text.end()});
  };
  Rig recorded;  // as an Ouster says it: the IMU is the body
  recorded.body_frame = "imu";
  recorded.body_from_lidar = Pose(so3_exp({0.1, 0.2, 0.3}), {0.01, 0.02, 0.03});
  recorded.body_from_imu = Pose();
  recorded.body_from_gnss = Pose(Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0});
  recorded.body_from_second_gnss = Pose(Eigen::Quaterniond::Identity(), {1.0, 0.0, 1.0});
  recorded.imu_extrinsic_source = "sensor metadata";
  const Pose base_from_lidar(Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0});
  const std::string place = "{translation_m: [1, 2, 3]}\n";
  {
    write("body_frame: base_link\nbody_from_lidar: " + place);
    Log log;
    Rig rig = recorded;
    apply_extrinsics_file(path, {"os_imu"}, rig, log);
    expect_near(rig.body_from_lidar, base_from_lidar);
    expect_near(rig.body_from_imu, base_from_lidar * recorded.body_from_lidar.inverse());
    expect_near(rig.body_from_gnss,
                base_from_lidar * recorded.body_from_lidar.inverse() * *recorded.body_from_gnss);
    expect_near(rig.body_from_second_gnss, base_from_lidar * recorded.body_from_lidar.inverse() *
                                               *recorded.body_from_second_gnss);
    EXPECT_NE(rig.imu_extrinsic_source.find("moved to base_link"), std::string::npos);
    EXPECT_EQ(all_warnings(log), "");
  }
  {  // by the IMU; the lidar moves along
    write("body_frame: base_link\nbody_from_imu: " + place);
    Log log;
    Rig rig = recorded;
    apply_extrinsics_file(path, {}, rig, log);
    expect_near(rig.body_from_imu, base_from_lidar);
    expect_near(rig.body_from_lidar, base_from_lidar * recorded.body_from_lidar);
  }
  for (const char* body : {"imu", "os_imu"}) {  // the recording's body under either name
    write(std::string("body_frame: ") + body + "\nbody_from_lidar: " + place);
    Log log;
    Rig rig = recorded;
    apply_extrinsics_file(path, {"os_imu"}, rig, log);
    expect_near(rig.body_from_lidar, base_from_lidar);
    expect_near(rig.body_from_imu, Pose());
    EXPECT_EQ(all_warnings(log), "");
  }
  {  // without a name it is the recording's body too, which is said
    write("body_from_lidar: " + place);
    Log log;
    Rig rig = recorded;
    apply_extrinsics_file(path, {}, rig, log);
    expect_near(rig.body_from_imu, Pose());
    EXPECT_EQ(count_of(log, "recording.extrinsics_body"), 1U);
  }
}

TEST(Extrinsics, AFilePlacesTheSecondAntenna) {
  const TemporaryFolder folder;
  const std::string path = folder / "rig.yaml";
  const std::string text = "body_frame: imu\nbody_from_second_gnss: {translation_m: [1, 2, 3]}\n";
  write_bytes(path, {text.begin(), text.end()});
  Rig rig;
  rig.body_frame = "imu";
  rig.body_from_second_gnss = Pose(Eigen::Quaterniond::Identity(), {1.0, 0.0, 1.0});
  Log log;
  apply_extrinsics_file(path, {}, rig, log);
  expect_near(rig.body_from_second_gnss, Pose(Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0}));
  EXPECT_NE(rig.second_gnss_extrinsic_source.find("extrinsics file"), std::string::npos);
}

TEST(Extrinsics, APlaceThatNothingTellsIsDroppedOrRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "rig.yaml";
  const std::string text = "body_frame: base_link\nbody_from_imu: {translation_m: [1, 2, 3]}\n";
  write_bytes(path, {text.begin(), text.end()});
  Log log;
  Rig rig;  // the lidar is the body, nothing tells of the IMU
  rig.body_from_gnss = Pose();
  apply_extrinsics_file(path, {}, rig, log);
  EXPECT_FALSE(rig.body_from_gnss);
  EXPECT_EQ(rig.gnss_extrinsic_source, "none");
  EXPECT_EQ(count_of(log, "recording.extrinsics_body"), 2U) << all_warnings(log);
  Rig on_mast;
  on_mast.body_frame = "mast";
  EXPECT_THROW(apply_extrinsics_file(path, {}, on_mast, log), ConfigError);
}

}  // namespace
}  // namespace understory
