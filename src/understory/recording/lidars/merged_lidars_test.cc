#include "understory/recording/lidars/merged_lidars.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "understory/recording/finding.h"
#include "understory/recording/lidars/scan_merger.h"
#include "understory/recording/lidars/steady_scans.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr TimeNs kMs = 1'000'000;

// One lidar of a machine as a recording of its own; the first one has the IMU.
struct LidarPlan {
  std::string topic;
  TimeNs begin = 0;
  TimeNs end = 3'000 * kMs;
  TimeNs period = 100 * kMs;
  bool imu = false;
  std::optional<std::pair<TimeNs, TimeNs>> silent;
  double x_m = 0.0;  // of its points, in its frame
  Rig rig;
};

class FakeRecording : public Recording {
 public:
  explicit FakeRecording(const LidarPlan& plan) : plan_(plan) {
    for (TimeNs t = 0; t < 3'000 * kMs; t += 10 * kMs) {
      ImuSample sample;
      sample.stamp = test::kStart + t;
      if (plan.imu) events_.emplace_back(sample);
      const TimeNs since = t - plan.begin;
      if (since <= 0 || since % plan.period != 0 || t > plan.end) continue;
      const TimeNs stamp = t - plan.period;
      if (plan.silent && stamp >= plan.silent->first && stamp < plan.silent->second) continue;
      events_.emplace_back(scan_at(test::kStart + stamp));
    }
  }
  std::optional<Event> next() override {
    if (at_ == events_.size()) return std::nullopt;
    return events_[at_++];
  }
  bool save(BinaryWriter& writer) const override {
    writer.put(at_);
    return true;
  }
  void load(BinaryReader& reader) override { at_ = reader.get<std::size_t>(); }
  const Rig& rig() const override { return plan_.rig; }
  std::vector<TopicReport> topics() const override {
    TopicReport report;
    report.name = plan_.topic;
    report.role = "lidar";
    return {report};
  }
  std::string format() const override { return "fake"; }
  double progress() const override { return 0.0; }

 private:
  // A point each 10 ms.
  [[nodiscard]] ScanPtr scan_at(TimeNs stamp) const {
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    scan->ring_count = 16;
    for (TimeNs t = 0; t < plan_.period; t += 10 * kMs) {
      ScanPoint point;
      point.x = static_cast<float>(plan_.x_m);
      point.t_ns = static_cast<std::uint32_t>(t);
      point.ring = 3;
      scan->points.push_back(point);
    }
    return scan;
  }

  LidarPlan plan_;
  std::vector<Event> events_;
  std::size_t at_ = 0;
};

Rig rig_at(double x_m) {
  Rig rig;
  rig.body_frame = "base_link";
  rig.body_from_lidar = Pose(Eigen::Quaterniond::Identity(), {x_m, 0.0, 0.0});
  rig.lidar_extrinsic_source = "extrinsics file e.yaml";
  return rig;
}

std::vector<LidarPlan> two_plans() {
  LidarPlan front;
  front.topic = "/front";
  front.imu = true;
  front.x_m = 5.0;
  front.rig = rig_at(1.0);
  LidarPlan rear;
  rear.topic = "/rear";
  rear.begin = 30 * kMs;
  rear.period = 90 * kMs;
  rear.x_m = -7.0;
  rear.rig = rig_at(-2.0);
  return {front, rear};
}

std::unique_ptr<Recording> merged(const std::vector<LidarPlan>& plans, Log& log) {
  std::vector<LidarReader> readers;
  for (const LidarPlan& plan : plans)
    readers.push_back({plan.topic, std::make_unique<FakeRecording>(plan), nullptr});
  return merge_lidars("fake.mcap", std::move(readers), log);
}

struct ReadLidars {
  std::vector<ScanPtr> scans;
  std::vector<TimeNs> samples;
  std::size_t of_first = 0;  // points
  std::size_t of_second = 0;
};

ReadLidars read_lidars(Recording& recording) {
  ReadLidars read;
  while (const auto event = recording.next()) {
    if (const auto* sample = std::get_if<ImuSample>(&*event)) read.samples.push_back(sample->stamp);
    const auto* scan = std::get_if<ScanPtr>(&*event);
    if (scan == nullptr) continue;
    read.scans.push_back(*scan);
    for (const ScanPoint& point : (*scan)->points)
      (point.ring < kRingsALidar ? read.of_first : read.of_second) += 1;
  }
  return read;
}

TEST(MergedLidars, EveryPointComesOnceInTheScanOfItsTimeAndInTheFirstFrame) {
  Log log;
  const ReadLidars read = read_lidars(*merged(two_plans(), log));
  EXPECT_EQ(read.of_first, 290U);   // 29 scans
  EXPECT_EQ(read.of_second, 288U);  // 32 scans of nine
  EXPECT_EQ(read.samples.size(), 300U);
  EXPECT_TRUE(log.warnings().empty());
  for (std::size_t i = 1; i < read.scans.size(); ++i)
    EXPECT_EQ(read.scans[i]->stamp - read.scans[i - 1]->stamp, 100 * kMs);
  for (const ScanPtr& scan : read.scans) {
    EXPECT_EQ(scan->ring_count, 32);
    std::uint32_t last = 0;
    for (const ScanPoint& point : scan->points) {
      EXPECT_GE(point.t_ns, last);
      EXPECT_LT(point.t_ns, 100'000'000U);
      last = point.t_ns;
      // The rear one sits three metres behind the first.
      EXPECT_EQ(point.x, point.ring == 3 ? 5.0F : -10.0F);
    }
  }
}

TEST(MergedLidars, TheScanComesAmongTheSamplesOfItsTime) {
  Log log;
  const auto recording = merged(two_plans(), log);
  TimeNs last_sample = 0;
  while (const auto event = recording->next()) {
    if (const auto* sample = std::get_if<ImuSample>(&*event)) last_sample = sample->stamp;
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) {
      EXPECT_LE(std::llabs(last_sample - (*scan)->end()), 20 * kMs);
    }
  }
}

// Whichever of the two dies, the other one goes on.
TEST(MergedLidars, OneThatDiesLeavesTheOtherAndIsNamedWithTheTime) {
  for (std::size_t dead = 0; dead < 2; ++dead) {
    std::vector<LidarPlan> plans = two_plans();
    plans[dead].end = 1'000 * kMs;
    Log log;
    const ReadLidars read = read_lidars(*merged(plans, log));
    EXPECT_EQ(read.samples.size(), 300U);
    EXPECT_GT(dead == 0 ? read.of_second : read.of_first, 280U);
    EXPECT_GT(read.scans.back()->stamp, test::kStart + 2'700 * kMs);
    const Found silent = found(log, Finding::kSilentLidar);
    EXPECT_EQ(silent.count, 1U) << dead;
    EXPECT_NE(silent.first.find(plans[dead].topic), std::string::npos);
  }
}

// Its points are read, but none of them lies where a map is made.
TEST(MergedLidars, OneInMillimetresIsNamedOnce) {
  for (std::size_t far = 0; far < 2; ++far) {
    std::vector<LidarPlan> plans = two_plans();
    plans[1].period = plans[0].period;
    plans[far].x_m = 7'000.0;
    plans[1 - far].x_m = 90.0;
    Log log;
    (void)read_lidars(*merged(plans, log));
    const Found silent = found(log, Finding::kSilentLidar);
    EXPECT_EQ(silent.count, 1U) << far;
    EXPECT_NE(silent.first.find(plans[far].topic + " lie over 7000 m away"), std::string::npos);
  }
}

TEST(MergedLidars, OneThatIsSilentForAWhileComesBack) {
  for (std::size_t silent = 0; silent < 2; ++silent) {
    std::vector<LidarPlan> plans = two_plans();
    plans[silent].silent = {{500 * kMs, 2'000 * kMs}};
    Log log;
    const ReadLidars read = read_lidars(*merged(plans, log));
    EXPECT_GT(silent == 0 ? read.of_second : read.of_first, 280U);
    EXPECT_GT(silent == 0 ? read.of_first : read.of_second, 130U);
    EXPECT_EQ(found(log, Finding::kSilentLidar).count, 1U) << silent;
    for (std::size_t i = 1; i < read.scans.size(); ++i)
      EXPECT_LT(read.scans[i]->stamp - read.scans[i - 1]->stamp, 151 * kMs);
  }
}

TEST(MergedLidars, OneThatBeginsLateJoins) {
  for (std::size_t late = 0; late < 2; ++late) {
    std::vector<LidarPlan> plans = two_plans();
    plans[late].begin = 1'530 * kMs;
    Log log;
    const ReadLidars read = read_lidars(*merged(plans, log));
    EXPECT_GT(late == 0 ? read.of_second : read.of_first, 280U);
    EXPECT_GT(late == 0 ? read.of_first : read.of_second, 130U);
    ASSERT_EQ(log.warnings().size(), 1U) << late;
    EXPECT_EQ(log.warnings()[0].key, "recording.late_lidar");
  }
}

TEST(MergedLidars, OneWithoutAPlaceIsNamed) {
  std::vector<LidarPlan> plans = two_plans();
  plans[1].rig = Rig();
  Log log;
  const auto recording = merged(plans, log);
  try {
    (void)read_lidars(*recording);
    FAIL() << "expected an error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("/rear"), std::string::npos) << error.what();
  }
}

TEST(MergedLidars, GoesOnFromWhereItWasSaved) {
  for (const std::size_t at : {0U, 7U, 100U, 250U}) {
    Log log;
    const auto one = merged(two_plans(), log);
    for (std::size_t i = 0; i < at; ++i)
      (void)one->next();
    BinaryWriter writer;
    ASSERT_TRUE(one->save(writer));
    const auto other = merged(two_plans(), log);
    BinaryReader reader(writer.bytes(), "checkpoint");
    other->load(reader);
    EXPECT_TRUE(reader.at_end());
    for (;;) {
      const auto a = one->next();
      const auto b = other->next();
      ASSERT_EQ(a.has_value(), b.has_value());
      if (!a) break;
      BinaryWriter bytes_a;
      BinaryWriter bytes_b;
      put_event(bytes_a, *a);
      put_event(bytes_b, *b);
      ASSERT_EQ(bytes_a.bytes(), bytes_b.bytes());
    }
  }
}

// One stamp a year ahead would have all others wait for it.
TEST(SteadyScans, ASingleStampFarOffIsLeftOutAndAStepOfTheClockIsNot) {
  const auto at = [](TimeNs stamp) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    return scan;
  };
  SteadyScans scans;
  EXPECT_EQ(scans.add(at(0)).size(), 1U);
  EXPECT_EQ(scans.add(at(1'000'000 * 1'000 * kMs)).size(), 0U);
  EXPECT_EQ(scans.add(at(100 * kMs)).size(), 1U);
  EXPECT_EQ(scans.left_out(), 1U);
  EXPECT_EQ(scans.add(at(60'000 * kMs)).size(), 0U);
  EXPECT_EQ(scans.add(at(60'100 * kMs)).size(), 2U);
  EXPECT_EQ(scans.left_out(), 1U);
}

std::string write_file(const std::string& name, const std::string& text) {
  const std::string path = (std::filesystem::path(::testing::TempDir()) / name).string();
  std::ofstream(path) << text;
  return path;
}

// What each reader is asked for.
struct Asked {
  std::vector<OpenOptions> options;
  std::unique_ptr<Recording> open(const OpenOptions& of_lidar) {
    options.push_back(of_lidar);
    return std::make_unique<FakeRecording>(two_plans()[of_lidar.lidar_entry == 0 ? 0 : 1]);
  }
};

TEST(OpenLidars, TakesAllThatTheFileListsOrThoseThatAreNamed) {
  const std::string file = write_file("open_lidars.yaml",
                                      "lidars:\n- {topic: /front, late_s: 0.5}\n"
                                      "- {topic: /rear, body_from_lidar: {translation_m: [1, 0, "
                                      "2]}}\n");
  Log log;
  OpenOptions options;
  options.extrinsics_file = file;
  Asked asked;
  const OpenOneLidar open = [&](const OpenOptions& own, Log& /*log*/) { return asked.open(own); };
  const auto both = open_lidars("r", options, open, log);
  ASSERT_EQ(asked.options.size(), 2U);
  EXPECT_EQ(asked.options[1].lidar_topic, "/rear");
  EXPECT_EQ(asked.options[1].lidar_entry, 1);
  EXPECT_EQ(both->format(), "fake, 2 lidars merged");

  options.lidar_topic = "/front";
  const auto one = open_lidars("r", options, open, log);
  ASSERT_EQ(asked.options.size(), 3U);
  const ReadLidars read = read_lidars(*one);
  EXPECT_EQ(read.scans.front()->stamp, test::kStart - 500 * kMs);
}

TEST(OpenLidars, TheOnlyLidarHasALatenessToo) {
  OpenOptions options;
  options.extrinsics_file =
      write_file("late_lidar.yaml", "body_from_lidar: {translation_m: [0, 0, 1]}\nlate_s: 0.25\n");
  Log log;
  const OpenOneLidar open = [](const OpenOptions& /*own*/, Log& /*log*/) {
    return std::make_unique<FakeRecording>(two_plans()[0]);
  };
  for (const char* topic : {"", "/front"}) {
    options.lidar_topic = topic;
    EXPECT_EQ(lateness_of(options), 0.25);
    const auto read = read_lidars(*open_lidars("r", options, open, log));
    EXPECT_EQ(read.scans.front()->stamp, test::kStart - 250 * kMs);
  }
}

TEST(OpenLidars, RefusesWhatContradictsItself) {
  const OpenOneLidar open = [](const OpenOptions& /*own*/, Log& /*log*/) {
    return std::make_unique<FakeRecording>(two_plans()[0]);
  };
  Log log;
  const auto refused = [&](const std::string& topics, const std::string& yaml) {
    OpenOptions options;
    options.lidar_topic = topics;
    if (!yaml.empty()) options.extrinsics_file = write_file("refused_lidars.yaml", yaml);
    EXPECT_THROW((void)open_lidars("r", options, open, log), ConfigError) << topics << yaml;
  };
  refused("/a,/a", "");
  refused("/a,", "");
  refused("", "late_s: 0.1\nlidars:\n- {topic: /a}\n");
  refused("", "late_s: soon\n");
  refused("/a,/b", "body_from_lidar: {translation_m: [0, 0, 1]}\n");
  refused("/a,/b", "lidars: [{topic: /a}]\n");
  refused("", "lidars: []\n");
  refused("", "lidars: [{late_s: 0.1}]\n");
  refused("", "lidars: [{topic: /a}, {topic: /a}]\n");
  refused("", "lidars: [{topic: /a, late_s: 30}]\n");
  refused("", "lidars: [{topic: /a, place: 3}]\n");
  refused("", "lidars: [{topic: /a}]\nbody_from_lidar: {translation_m: [0, 0, 1]}\n");
}

}  // namespace
}  // namespace understory
