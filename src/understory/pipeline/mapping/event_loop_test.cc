#include "understory/pipeline/mapping/event_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr TimeNs kStart = 1000 * kNsPerSecond;
constexpr TimeNs kScanStep = kNsPerSecond / 10;
constexpr TimeNs kImuStep = kNsPerSecond / 50;

TimeNs at(double seconds) {
  return kStart + from_seconds(seconds);
}

// Ten seconds of scans and IMU samples; every fifth sample changes places with the one before.
std::vector<Event> ten_seconds() {
  std::vector<Event> events;
  for (TimeNs time = kStart; time < at(10.0); time += kImuStep) {
    if ((time - kStart) % kScanStep == 0) {
      auto scan = std::make_shared<Scan>();
      scan->stamp = time;
      scan->points.resize(1);
      events.emplace_back(ScanPtr(std::move(scan)));
    }
    ImuSample sample;
    sample.stamp = time;
    sample.specific_force.z() = 9.81;
    events.emplace_back(sample);
  }
  for (std::size_t i = 32; i + 1 < events.size(); i += 30)
    std::swap(events[i], events[i + 1]);
  return events;
}

// What the loop did with the parts that a test gave it.
struct Course {
  std::vector<TimeNs> handled;          // times of all events, in the order in which they came
  std::vector<TimeNs> saved;            // last scan at each checkpoint
  std::vector<RunConditions> made_for;  // conditions of each front end
  int opened = 0;                       // how often the recording was
  int finished = 0;
};

class MadeUpRecording : public Recording {
 public:
  MadeUpRecording(std::vector<Event> events, std::size_t readable)
      : events_(std::move(events)), readable_(readable) {}
  std::optional<Event> next() override {
    if (next_ == readable_) throw ReadError("walk.bin", "byte 12", EIO);
    if (next_ == events_.size()) return std::nullopt;
    return events_[next_++];
  }
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::vector<TopicReport> topics() const override { return {}; }
  [[nodiscard]] std::string format() const override { return "made up"; }
  [[nodiscard]] double progress() const override { return 0.0; }

 private:
  std::vector<Event> events_;
  std::size_t readable_;
  std::size_t next_ = 0;
  Rig rig_;
};

// What a front end of these tests does.
struct Script {
  TimeNs throws_at = 0;                       // at a scan of this stamp or later; 0: never
  std::pair<TimeNs, TimeNs> unsettled{0, 0};  // between scans of these stamps
  TimeNs imu_wrong_at = 0;                    // unless it was made without the IMU; 0: never
  TimeNs imu_suspected_at = 0;                // by a front end that was told nothing; 0: never
  TimeNs imu_cleared_at = 0;                  // by one that doubts it; 0: never
  TimeNs imu_refined_at = 0;                  // by any, 10 ms more each time; 0: never
};

class MadeUpFrontEnd : public FrontEnd {
 public:
  MadeUpFrontEnd(const Script& script, const RunConditions& conditions, Course& course)
      : script_(script), conditions_(conditions), course_(course) {}

  std::vector<PositionedScan> handle(const Event& event, const Rig& /*rig*/) override {
    const TimeNs time = event_time(event);
    std::vector<PositionedScan> positioned;
    if (std::holds_alternative<ScanPtr>(event)) {
      if (script_.throws_at != 0 && time >= script_.throws_at)
        throw std::runtime_error("a made-up failure");
      last_scan_ = time;
      ++scans_;
      positioned.emplace_back();
      positioned.back().end = positioned.back().pose.stamp = time;
    }
    course_.handled.push_back(time);
    ++events_;
    return positioned;
  }
  std::vector<PositionedScan> finish(const Rig& /*rig*/) override {
    ++course_.finished;
    return {};
  }
  void run_in_real_time() override {}
  [[nodiscard]] bool settled() const override {
    return last_scan_ < script_.unsettled.first || last_scan_ >= script_.unsettled.second;
  }
  [[nodiscard]] TimeNs first_scan() const override { return kStart; }
  [[nodiscard]] ImuFinding imu_finding() const override {
    const auto reached = [&](TimeNs time) { return time != 0 && last_scan_ >= time; };
    if (!conditions_.imu_refused.empty()) return {};
    if (reached(script_.imu_wrong_at)) return {ImuFinding::Verdict::kWrong, "it points down"};
    if (conditions_.imu_doubted && reached(script_.imu_cleared_at))
      return {ImuFinding::Verdict::kCleared, ""};
    if (!conditions_.imu_doubted && !conditions_.imu_cleared && reached(script_.imu_suspected_at))
      return {ImuFinding::Verdict::kSuspected, ""};
    return {};
  }
  [[nodiscard]] std::optional<RefinedImu> refined_imu() const override {
    if (script_.imu_refined_at == 0 || last_scan_ < script_.imu_refined_at) return std::nullopt;
    const double late_s = conditions_.imu_refined ? conditions_.imu_refined->late_s : 0.0;
    return RefinedImu{Pose(), late_s + 0.01};
  }
  [[nodiscard]] FrontEndProgress progress() const override { return {"made up", scans_, ""}; }
  [[nodiscard]] bool has_map() const override { return scans_ > 0; }
  [[nodiscard]] std::string why_no_map(const Recording& /*source*/) const override { return ""; }
  [[nodiscard]] std::unique_ptr<MapMaker> map_maker(const ReadRecording& /*recording*/) override {
    return nullptr;
  }
  void sync() override {}
  void save(BinaryWriter& writer) const override {
    course_.saved.push_back(last_scan_);
    writer.put(last_scan_);
    writer.put(events_);
  }
  [[nodiscard]] std::vector<CountedFile> files() const override { return {}; }
  void load(BinaryReader& reader, const Rig& /*rig*/) override {
    last_scan_ = reader.get<TimeNs>();
    events_ = reader.get<std::uint64_t>();
    scans_ = 1;
  }
  [[nodiscard]] TimeNs last_scan_end() const override { return last_scan_; }
  [[nodiscard]] std::uint64_t events() const { return events_; }

 private:
  Script script_;
  RunConditions conditions_;
  Course& course_;
  TimeNs last_scan_ = 0;
  std::uint64_t events_ = 0;
  std::size_t scans_ = 0;
};

class EventLoopTest : public ::testing::Test {
 protected:
  EventLoopTest() {
    std::ofstream(folder_ / "walk.bin") << "stands for the recording";
    request_.recording = (folder_ / "walk.bin").string();
    request_.run_folder = folder_ / "run";
    request_.config = config();
    request_.config_record.asked_yaml = yaml_of(request_.config);
  }
  static SparseMappingConfig config() {
    SparseMappingConfig config;
    config.loop.checkpoint_interval_s = 2.0;
    return config;
  }
  [[nodiscard]] EventLoopParts parts() {
    EventLoopParts parts;
    parts.open_recording = [this](const std::string& /*name*/, const OpenOptions& /*options*/,
                                  Log& /*log*/) {
      ++course_.opened;
      return std::make_unique<MadeUpRecording>(events_, readable_);
    };
    parts.front_end = [this](const FrontEndConfig& /*config*/, const SensorTraits& /*traits*/,
                             const RunConditions& conditions, const std::filesystem::path& /*work*/,
                             Log& /*log*/) {
      course_.made_for.push_back(conditions);
      return std::make_unique<MadeUpFrontEnd>(script_, conditions, course_);
    };
    return parts;
  }
  [[nodiscard]] RunFacts run(RunState& state) {
    EventLoop loop(request_, state, log_, progress_, stop_, parts());
    RunFacts facts = loop.run();
    events_handled_ = dynamic_cast<const MadeUpFrontEnd&>(loop.front_end()).events();
    return facts;
  }
  [[nodiscard]] RunFacts run() {
    RunState state = RunState::create(request_);
    return run(state);
  }

  test::TemporaryFolder folder_;
  MappingRequest request_;
  std::vector<Event> events_ = ten_seconds();
  std::size_t readable_ = 1'000'000;  // events until the disk fails
  Script script_;
  Course course_;
  std::uint64_t events_handled_ = 0;  // by the last front end, those before it was resumed included
  Log log_;
  ProgressSink progress_;
  StopRequested stop_;
};

TEST_F(EventLoopTest, EventsComeOnceAndInOrderOfTime) {
  ASSERT_FALSE(std::is_sorted(events_.begin(), events_.end(), [](const Event& a, const Event& b) {
    return event_time(a) < event_time(b);
  }));
  const RunFacts facts = run();
  EXPECT_TRUE(std::is_sorted(course_.handled.begin(), course_.handled.end()));
  EXPECT_EQ(course_.handled.size(), events_.size());
  EXPECT_EQ(course_.handled.front(), kStart);
  EXPECT_EQ(course_.handled.back(), event_time(events_.back()));
  EXPECT_EQ(course_.finished, 1);
  EXPECT_EQ(course_.opened, 1);
  EXPECT_FALSE(facts.stopped);
  EXPECT_TRUE(facts.unreadable.empty());
  EXPECT_EQ(facts.format, "made up");
}

// One before the first scan makes the run resumable; then one at the first scan, and then one each
// interval of the recording.
TEST_F(EventLoopTest, CheckpointsComeEachInterval) {
  (void)run();
  EXPECT_EQ(course_.saved, (std::vector<TimeNs>{0, at(0.0), at(2.0), at(4.0), at(6.0), at(8.0)}));
}

TEST_F(EventLoopTest, ACheckpointWaitsUntilTheFrontEndIsSettled) {
  script_.unsettled = {at(3.0), at(5.0)};
  (void)run();
  EXPECT_EQ(course_.saved, (std::vector<TimeNs>{0, at(0.0), at(2.0), at(5.0), at(7.0), at(9.0)}));
}

TEST_F(EventLoopTest, AStoppedRunSavesWhereItStopped) {
  stop_ = [this] { return !course_.handled.empty() && course_.handled.back() >= at(4.5); };
  RunState state = RunState::create(request_);
  const RunFacts facts = run(state);
  EXPECT_TRUE(facts.stopped);
  EXPECT_EQ(course_.finished, 1);
  EXPECT_LT(course_.handled.back(), at(5.0));
  EXPECT_EQ(course_.saved.back(), at(4.5));
  EXPECT_EQ(state.last_checkpoint(), at(4.5));
}

TEST_F(EventLoopTest, AFrontEndThatThrowsLeavesARunToGoOnWith) {
  script_.throws_at = at(5.0);
  EXPECT_THROW((void)run(), std::runtime_error);
  EXPECT_EQ(course_.finished, 0);
  script_.throws_at = 0;
  course_ = {};
  UnfinishedRun unfinished = RunState::reopen(request_.run_folder);
  EXPECT_EQ(unfinished.state.last_checkpoint(), at(4.0));
  unfinished.request.config = request_.config;
  request_ = unfinished.request;
  (void)run(unfinished.state);
  EXPECT_GT(course_.handled.front(), at(3.9));  // not from the beginning
  EXPECT_EQ(events_handled_, events_.size());   // and nothing twice, nothing left out
  EXPECT_EQ(course_.saved, (std::vector<TimeNs>{at(6.0), at(8.0)}));
}

TEST_F(EventLoopTest, ADiskThatFailsEndsTheRunWithWhatItHas) {
  readable_ = events_.size() / 2;
  const RunFacts facts = run();
  EXPECT_TRUE(facts.stopped);
  EXPECT_NE(facts.unreadable.find("Input/output error"), std::string::npos) << facts.unreadable;
  EXPECT_EQ(course_.finished, 1);
  EXPECT_GT(course_.handled.back(), at(4.0));
}

TEST_F(EventLoopTest, ADiskThatFailsBeforeTheFirstScanIsAnError) {
  readable_ = 2;
  EXPECT_THROW((void)run(), ReadError);
}

TEST_F(EventLoopTest, AWrongImuHasTheRecordingBegunAnew) {
  script_.imu_wrong_at = at(3.0);
  const RunFacts facts = run();
  EXPECT_FALSE(facts.stopped);
  EXPECT_EQ(course_.opened, 2);
  ASSERT_EQ(course_.made_for.size(), 2U);
  EXPECT_EQ(course_.made_for[0].imu_refused, "");
  EXPECT_EQ(course_.made_for[1].imu_refused, "it points down");
  EXPECT_NEAR(course_.made_for[1].imu_judged_s, 3.0, 1e-9);
  EXPECT_EQ(events_handled_, events_.size());  // all of it, from its beginning
  // No checkpoint of the first try is gone back to.
  const auto anew = std::find(course_.saved.begin() + 1, course_.saved.end(), 0);
  ASSERT_NE(anew, course_.saved.end());
  EXPECT_EQ(std::vector<TimeNs>(anew, course_.saved.end()),
            (std::vector<TimeNs>{0, 0, at(0.0), at(2.0), at(4.0), at(6.0), at(8.0)}));
}

// What was mapped while the IMU was doubted is mapped again with it, and it is not doubted again.
TEST_F(EventLoopTest, AnImuThatWasDoubtedAndIsRightHasTheRecordingBegunAnew) {
  script_.imu_suspected_at = at(2.0);
  script_.imu_cleared_at = at(5.0);
  (void)run();
  EXPECT_EQ(course_.opened, 3);
  ASSERT_EQ(course_.made_for.size(), 3U);
  EXPECT_TRUE(course_.made_for[1].imu_doubted);
  EXPECT_FALSE(course_.made_for[1].imu_cleared);
  EXPECT_FALSE(course_.made_for[2].imu_doubted);
  EXPECT_TRUE(course_.made_for[2].imu_cleared);
  EXPECT_NEAR(course_.made_for[2].imu_judged_s, 5.0, 1e-9);
  EXPECT_EQ(events_handled_, events_.size());
}

// Its samples then come with the refined clock, from the first one on. It ends though each pass
// finds another lateness.
TEST_F(EventLoopTest, ARefinedImuHasTheRecordingBegunAnewThreeTimesAtMost) {
  script_.imu_refined_at = at(3.0);
  (void)run();
  EXPECT_EQ(course_.opened, 4);
  ASSERT_EQ(course_.made_for.size(), 4U);
  EXPECT_FALSE(course_.made_for[0].imu_refined);
  for (int pass = 1; pass < 4; ++pass) {
    const RunConditions& conditions = course_.made_for[static_cast<std::size_t>(pass)];
    ASSERT_TRUE(conditions.imu_refined);
    EXPECT_NEAR(conditions.imu_refined->late_s, 0.01 * pass, 1e-12);
    EXPECT_EQ(conditions.imu_refinements, pass);
  }
  EXPECT_EQ(events_handled_, events_.size());
  // Of the last pass: scans at every tenth of a second, samples 30 ms before every fiftieth.
  std::size_t samples = 0;
  for (std::size_t i = course_.handled.size() - events_.size(); i < course_.handled.size(); ++i)
    samples += (course_.handled[i] - kStart + from_seconds(0.03)) % kImuStep == 0 ? 1 : 0;
  EXPECT_EQ(samples, 500U);
}

TEST_F(EventLoopTest, WhoListensHearsEachScanOfEachPass) {
  script_.imu_refined_at = at(9.0);
  std::vector<TimeNs> heard;
  request_.on_positioned = [&](const PositionedScan& scan) { heard.push_back(scan.pose.stamp); };
  (void)run();
  const auto passes = std::count(heard.begin(), heard.end(), heard.front());
  EXPECT_EQ(passes, 4);
  const auto last = std::find(heard.rbegin(), heard.rend(), heard.front());
  EXPECT_TRUE(std::is_sorted(heard.rbegin(), last, std::greater<>()));
  std::size_t scans = 0;
  for (const Event& event : events_)
    scans += std::holds_alternative<ScanPtr>(event) ? 1 : 0;
  EXPECT_EQ(static_cast<std::size_t>(last - heard.rbegin()) + 1, scans);
}

// The clock that was found goes on after a run was cut off.
TEST_F(EventLoopTest, ARefinedImuIsKeptByACheckpoint) {
  script_.imu_refined_at = at(3.0);
  script_.throws_at = at(7.0);
  EXPECT_THROW((void)run(), std::runtime_error);
  script_ = {};
  course_ = {};
  UnfinishedRun unfinished = RunState::reopen(request_.run_folder);
  unfinished.request.config = request_.config;
  request_ = unfinished.request;
  (void)run(unfinished.state);
  ASSERT_EQ(course_.made_for.size(), 1U);
  ASSERT_TRUE(course_.made_for[0].imu_refined);
  EXPECT_NEAR(course_.made_for[0].imu_refined->late_s, 0.03, 1e-12);
  EXPECT_EQ(course_.made_for[0].imu_refinements, 3);
  EXPECT_EQ(course_.handled.back(), event_time(events_.back()) - from_seconds(0.03));
}

}  // namespace
}  // namespace understory
