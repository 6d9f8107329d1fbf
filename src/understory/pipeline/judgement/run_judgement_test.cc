#include "understory/pipeline/judgement/run_judgement.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace understory {
namespace {

// A run of 1,000 scans in which nothing was wrong.
RunEvidence good_run() {
  RunEvidence evidence;
  evidence.lidar.received = 1000;
  evidence.imu.received = 20'000;
  evidence.imu_used = true;
  evidence.match.scans = 1000;
  evidence.motion.steps = 999;
  evidence.imu_motion_scale = 1.0;
  evidence.imu_motion_correlation = 1.0;
  evidence.imu_motion_windows = 300;
  evidence.imu_motion_spread_m_s2 = 1.0;
  evidence.match.scan_motion_ratio = 1.0;
  evidence.match.scan_motion_probes = 40;
  evidence.match.range_pairs = 20;
  evidence.match.range_offset_m = 0.02;
  evidence.match.range_offset_error_m = 0.02;
  return evidence;
}

RunJudgement judged(const RunEvidence& evidence) {
  return judge_run(evidence, JudgementConfig());
}

void expect_complete(const RunEvidence& evidence) {
  const RunJudgement judgement = judged(evidence);
  EXPECT_EQ(judgement.status, RunStatus::kComplete);
  EXPECT_TRUE(judgement.reasons.empty()) << judgement.reasons.front();
}

// One reason, which says this.
void expect(RunStatus status, const std::string& words, const RunEvidence& evidence) {
  const RunJudgement judgement = judged(evidence);
  EXPECT_EQ(judgement.status, status) << words;
  ASSERT_EQ(judgement.reasons.size(), 1U) << words;
  EXPECT_NE(judgement.reasons.front().find(words), std::string::npos) << judgement.reasons.front();
}

// A good run in which `figure` is at its limit is complete; beyond, it has this status and reason.
template <class Owner, class Value>
void expect_limit(Owner RunEvidence::*owner, Value Owner::*figure, Value limit, Value beyond,
                  RunStatus status, const std::string& words) {
  RunEvidence evidence = good_run();
  evidence.*owner.*figure = limit;
  expect_complete(evidence);
  evidence.*owner.*figure = beyond;
  expect(status, words, evidence);
}

TEST(RunJudgement, AGoodRunIsComplete) {
  expect_complete(good_run());
  RunEvidence mended = good_run();
  mended.lidar.duplicates = 500;  // recorded twice, and the content is known to be the same
  mended.lidar.reordered = 500;
  mended.lidar.clock_jumps = 3;
  mended.times_assumed = true;
  expect_complete(mended);
}

TEST(RunJudgement, FixesThatPullAreNamedWhereThePathIsWrong) {
  RunEvidence evidence = good_run();
  evidence.match.by_satellites = 300;
  expect_complete(evidence);
  evidence.match.unmatched = evidence.match.scans / 4;
  const RunJudgement judgement = judged(evidence);
  EXPECT_EQ(judgement.status, RunStatus::kUntrusted);
  ASSERT_EQ(judgement.reasons.size(), 2U);
  EXPECT_NE(judgement.reasons.back().find("gnss.match.use=none"), std::string::npos);
  evidence.match.by_satellites = 0;
  EXPECT_EQ(judged(evidence).reasons.size(), 1U);
}

TEST(RunJudgement, ScansWithoutASay) {
  const auto with = [](std::uint64_t dropped, std::uint64_t late, std::uint64_t unreadable,
                       std::uint64_t glitches) {
    RunEvidence evidence = good_run();
    evidence.dropped_scans = dropped;
    evidence.lidar.late = late;
    evidence.lidar.unreadable = unreadable;
    evidence.lidar.glitches = glitches;
    return evidence;
  };
  expect_complete(with(10, 0, 0, 0));
  expect(RunStatus::kPartial, "11 dropped because the machine could not keep up",
         with(11, 0, 0, 0));
  expect_complete(with(0, 10, 0, 0));
  expect(RunStatus::kPartial, "11 too late", with(0, 11, 0, 0));
  expect(RunStatus::kPartial, "11 unreadable", with(0, 0, 11, 0));
  expect(RunStatus::kPartial, "11 with a stamp far off", with(0, 0, 0, 11));
  expect_complete(with(3, 3, 2, 2));
  expect(RunStatus::kPartial, "12 of 1006 scans (1.2 %) are not in the map", with(3, 3, 3, 3));
}

// A regression: scans of a clock that stands still passed for messages recorded twice.
TEST(RunJudgement, AClockThatStandsStill) {
  expect_limit<SensorEvidence, std::uint64_t>(&RunEvidence::lidar, &SensorEvidence::stamp_taken, 10,
                                              11, RunStatus::kPartial,
                                              "11 with the stamp of another scan");
  expect_limit<SensorEvidence, std::uint64_t>(
      &RunEvidence::imu, &SensorEvidence::stamp_taken, 200, 201, RunStatus::kPartial,
      "201 of 20000 messages of the IMU (1.0 %) were not used: 201 with the stamp of another");
}

// A regression: an IMU that sends NaN was no reason.
TEST(RunJudgement, MessagesThatAreNoNumbers) {
  RunEvidence evidence = good_run();
  evidence.imu.received = 0;
  evidence.imu.not_numbers = 20'000;
  evidence.imu_used = false;
  expect(RunStatus::kPartial,
         "20000 of 20000 messages of the IMU (100.0 %) were not used: 20000 not numbers (NaN)",
         evidence);
  evidence = good_run();
  evidence.gnss.received = 98;
  evidence.gnss.unreadable = 1;
  expect(RunStatus::kPartial, "1 of 99 messages of the GNSS", evidence);
}

// A regression: the run was complete, though the lidar had died long before its recording ended.
TEST(RunJudgement, ALidarThatStopsBeforeTheOthers) {
  RunEvidence evidence = good_run();
  evidence.lidar.outlived_by = "IMU";
  evidence.lidar.silent_at_end_s = 1.0;
  expect_complete(evidence);
  evidence.lidar.silent_at_end_s = 2.9;
  expect(RunStatus::kPartial, "the lidar stopped 2.9 s before the IMU", evidence);
  evidence.lidar.stamp_taken = 500;  // it went on, and its scans could not be used
  expect(RunStatus::kPartial, "with the stamp of another scan", evidence);
  RunEvidence stopped = good_run();
  stopped.stopped = true;
  stopped.lidar.silent_at_end_s = 2.9;
  expect(RunStatus::kPartial, "stopped by the user", stopped);
}

TEST(RunJudgement, AnImuThatWasLeftOutAtTheEnd) {
  RunEvidence evidence = good_run();
  evidence.imu_on_probation = true;
  expect(RunStatus::kPartial, "at the end the IMU was left out", evidence);
  evidence.imu_distrust = "its axes look swapped";
  expect(RunStatus::kUntrusted, "its axes look swapped", evidence);
}

TEST(RunJudgement, AnImuThatWasLeftOutForATime) {
  RunEvidence evidence = good_run();
  evidence.imu_doubted_s = 0.9;
  expect_complete(evidence);
  evidence.imu_doubted_s = 6.2;
  expect(RunStatus::kPartial, "the IMU was left out for 6.2 s", evidence);
}

TEST(RunJudgement, AMapThatIsNoGroundForAListOfTrees) {
  RunEvidence evidence = good_run();
  evidence.stand.trees = 20;
  expect_complete(evidence);
  evidence.stand.few_near_breast = true;  // in the mean over the area
  expect_complete(evidence);
  evidence.stand.trees = 0;
  expect(RunStatus::kPartial, "the list of trees is empty", evidence);
  evidence.stand = {20, false, "", "12 of 20 trees stand twice"};
  expect(RunStatus::kUntrusted, "12 of 20 trees stand twice", evidence);
  evidence.stand = {0, true, "z is not up", ""};
  expect(RunStatus::kUntrusted, "the map does not stand upright: z is not up", evidence);
}

TEST(RunJudgement, SensorsWithoutASay) {
  for (SensorEvidence RunEvidence::*sensor :
       {&RunEvidence::imu, &RunEvidence::gnss, &RunEvidence::mag}) {
    RunEvidence evidence = good_run();
    (evidence.*sensor).unused_s = 1.0;
    (evidence.*sensor).unused_why = "it stops";
    expect_complete(evidence);
    (evidence.*sensor).unused_s = 1.1;
    expect(RunStatus::kPartial, "was not used for 1.1 s: it stops", evidence);
  }
}

TEST(RunJudgement, WhatIsMissingIsPartialAndWhatIsWrongIsUntrusted) {
  RunEvidence evidence = good_run();
  evidence.stopped = true;
  expect(RunStatus::kPartial, "run the command again", evidence);
  evidence.goes_on_by = "understory map --resume 'my plot'";
  expect(RunStatus::kPartial, "go on with `understory map --resume 'my plot'`", evidence);
  evidence.match.unmatched = 100;
  EXPECT_EQ(judged(evidence).status, RunStatus::kUntrusted);
  EXPECT_EQ(judged(evidence).reasons.size(), 2U);
  RunEvidence cut = good_run();
  cut.cut_off = true;
  cut.where_cut_off = "at byte 17";
  expect(RunStatus::kPartial, "at byte 17", cut);
}

TEST(RunJudgement, Damage) {
  RunEvidence evidence = good_run();
  evidence.damaged_packets = 1000;  // one a scan
  expect_complete(evidence);
  evidence.damaged_packets = 1001;
  expect(RunStatus::kUntrusted, "packets of the lidar are damaged", evidence);
  RunEvidence places = good_run();
  places.damaged_places = 1;
  places.first_damage = "a chunk at byte 5";
  expect(RunStatus::kUntrusted, "a chunk at byte 5", places);
}

TEST(RunJudgement, Matches) {
  constexpr auto kUntrusted = RunStatus::kUntrusted;
  expect_limit<MatchEvidence, std::uint64_t>(&RunEvidence::match, &MatchEvidence::unmatched, 20, 21,
                                             kUntrusted,
                                             "21 of 1000 scans (2.1 %) could not be matched");
  expect_limit<MatchEvidence, std::uint64_t>(&RunEvidence::match, &MatchEvidence::empty, 10, 11,
                                             RunStatus::kPartial, "hardly any usable point");
  RunEvidence covered = good_run();
  covered.match.empty = 100;
  expect(RunStatus::kPartial, "100 of 1000 scans had hardly any usable point", covered);
  covered.match.empty = 101;
  expect(kUntrusted, "101 of 1000 scans had hardly any usable point", covered);
  expect_limit<MatchEvidence, std::uint64_t>(&RunEvidence::match, &MatchEvidence::repeated, 10, 11,
                                             kUntrusted, "hold the same points as the scan before");
  expect_limit<MotionEvidence, std::uint64_t>(&RunEvidence::motion, &MotionEvidence::impossible, 9,
                                              10, RunStatus::kPartial,
                                              "Single scans are at wrong places");
  RunEvidence jumps = good_run();
  jumps.motion.impossible = 39;
  expect(RunStatus::kPartial, "Single scans are at wrong places", jumps);
  jumps.motion.impossible = 40;
  expect(kUntrusted, "stamps of the scans or the matches are wrong", jumps);
  expect_limit<MotionEvidence, double>(&RunEvidence::motion, &MotionEvidence::jump_m, 1.0, 1.1,
                                       kUntrusted, "the path jumps by 1.1 m");
  RunEvidence pieces = good_run();
  pieces.match.segments = 2;
  pieces.match.first_lost = "17.5";
  expect(kUntrusted, "lost 1 time(s), first at 17.5 s", pieces);
  pieces.match.joined = 1;
  expect(kUntrusted, "lost 2 time(s), first at 17.5 s; the map consists of 2 pieces", pieces);
  RunEvidence gap = good_run();
  gap.lidar.longest_gap_s = 30.0;
  gap.lidar.after_longest_gap = "17.5";
  expect(kUntrusted, "silent for 30.0 s before 17.5 s. The motion in between was", gap);
  gap.match.joined = 1;
  expect(kUntrusted, "silent for 30.0 s", gap);
  gap.match.gap_joined = true;
  expect(RunStatus::kPartial, "joined where places were seen again", gap);
}

TEST(RunJudgement, APathThatShakesWithoutAnImuIsPartial) {
  RunEvidence evidence = good_run();
  evidence.motion.acceleration_p95_m_s2 = 10.1;
  expect_complete(evidence);  // the accelerometer has felt it
  evidence.imu_used = false;
  expect(RunStatus::kPartial, "shakes from scan to scan (accelerations of 10 m/s^2)", evidence);
  evidence.by_stems = true;
  evidence.stems.trees = 5;
  expect_complete(evidence);
  evidence.by_stems = false;
  evidence.motion.acceleration_p95_m_s2 = 10.0;
  expect_complete(evidence);
}

// A regression: a good recording of five scans that ends within a turn was untrusted.
TEST(RunJudgement, ThePartOfATurnAtTheEndIsNoLoss) {
  RunEvidence evidence = good_run();
  evidence.match.scans = 5;
  evidence.match.empty = evidence.match.unmatched = evidence.match.cut = 1;
  expect_complete(evidence);
  evidence.match.cut = 0;
  EXPECT_EQ(judged(evidence).reasons.size(), 2U);
}

TEST(RunJudgement, AssumedTimesAreNamedAsTheCause) {
  RunEvidence unmatched = good_run();
  unmatched.times_assumed = true;
  unmatched.match.unmatched = 21;
  expect(RunStatus::kUntrusted, "times of the clouds were assumed", unmatched);
  RunEvidence impossible = good_run();
  impossible.times_assumed = true;
  impossible.motion.impossible = 10;
  expect(RunStatus::kUntrusted, "times of the clouds were assumed", impossible);
}

TEST(RunJudgement, TimesOfPoints) {
  RunEvidence missing = good_run();
  missing.point_times_missing = true;
  missing.why_no_point_times = "no time per point";
  missing.match.smear_m = 0.05;
  expect_complete(missing);
  missing.match.smear_m = 0.06;
  expect(RunStatus::kUntrusted, "smeared by 0.06 m", missing);
  RunEvidence evidence = good_run();
  const JudgementConfig limits;
  const std::vector<std::pair<double, std::string>> wrong = {
      {-1.0, "backwards"}, {0.1, "too long"}, {limits.max_scan_motion + 0.1, "wrong"}};
  for (const auto& [ratio, words] : wrong) {
    evidence.match.scan_motion_ratio = ratio;
    evidence.match.scan_motion_probes = limits.min_scan_motion_probes;
    expect(RunStatus::kUntrusted, words, evidence);
    evidence.match.scan_motion_probes = limits.min_scan_motion_probes - 1;
    expect_complete(evidence);
  }
  evidence.match.scan_motion_probes = 100;
  evidence.match.scan_motion_ratio = limits.min_scan_motion;
  expect_complete(evidence);
  evidence.match.scan_motion_ratio = limits.max_scan_motion;
  expect_complete(evidence);
  // A regression: six probes that differed much called a right path wrong.
  evidence.match.scan_motion_ratio = limits.min_scan_motion - 0.06;
  evidence.match.scan_motion_sd = 0.07;
  expect_complete(evidence);
  evidence.match.scan_motion_sd = 0.05;
  expect(RunStatus::kUntrusted, "too long", evidence);
  // Nor do wrong times that make probes differ pass for right ones.
  evidence.match.scan_motion_ratio = -0.5;
  evidence.match.scan_motion_sd = 1.0;
  expect(RunStatus::kUntrusted, "backwards", evidence);
}

TEST(RunJudgement, LidarsThatSeeTheSameElsewhereAreUntrusted) {
  RunEvidence evidence = good_run();
  const double limit = JudgementConfig().max_lidars_apart_m;
  evidence.further_lidar = {2, limit, 0.03, 0.001, 0.0, 0.01};
  expect_complete(evidence);
  evidence.further_lidar.apart_m = limit + 0.03;
  expect(RunStatus::kUntrusted, "the points of lidar 2 lie 8 cm beside those of the first one",
         evidence);
  EXPECT_EQ(figures_of(evidence).count("further_lidar_late_s"), 1U);
  EXPECT_EQ(figures_of(good_run()).count("further_lidar_late_s"), 0U);
}

TEST(RunJudgement, TimesOfPointsInNoOrder) {
  RunEvidence evidence = good_run();
  evidence.mixed_times = 50;
  evidence.match.smear_m = 0.5;
  expect_complete(evidence);
  evidence.mixed_times = 60;
  expect(RunStatus::kUntrusted, "60 of 1000 scans the times of points are in no order", evidence);
  evidence.match.smear_m = 0.01;  // a machine that hardly moves
  expect(RunStatus::kPartial, "in no order", evidence);
}

TEST(RunJudgement, AMapThatLeansByABadAccelerometer) {
  RunEvidence evidence = good_run();
  evidence.tilt_at_end_deg = 5.8;
  evidence.accelerometer_bias_m_s2 = 0.1;  // a path that bends, no accelerometer
  expect_complete(evidence);
  evidence.accelerometer_bias_m_s2 = 1.0;
  expect(RunStatus::kUntrusted, "the map leans by 5.8 degrees", evidence);
  evidence.tilt_at_end_deg = 0.3;  // it lies along the vertical, or was known at the beginning
  expect_complete(evidence);
}

TEST(RunJudgement, AccelerationsOfTheImu) {
  const JudgementConfig limits;
  RunEvidence evidence = good_run();
  for (const double scale : {limits.min_imu_scale - 0.01, limits.max_imu_scale + 0.01}) {
    evidence.imu_motion_scale = scale;
    expect(RunStatus::kUntrusted, "times those of the accelerometer", evidence);
  }
  evidence.imu_motion_spread_m_s2 = limits.min_imu_spread_m_s2 - 0.01;
  expect_complete(evidence);
  evidence.imu_motion_spread_m_s2 = 1.0;
  evidence.imu_motion_windows = limits.min_imu_windows - 1;
  expect_complete(evidence);
  evidence.imu_distrust = "its axes look swapped";
  expect(RunStatus::kUntrusted, "axes look swapped", evidence);
}

// A regression: clouds 1.2 times too large made a map 1.2 times too large that was complete.
TEST(RunJudgement, AScaleThatIsOffByAFifthIsNoticedWhereItIsKnownWell) {
  RunEvidence evidence = good_run();
  evidence.imu_motion_scale = 1.2;
  evidence.imu_motion_correlation = 0.99;  // the scale's standard deviation is 0.01
  expect(RunStatus::kUntrusted, "1.20 times those", evidence);
  evidence.imu_motion_correlation = 0.5;  // 0.12
  evidence.imu_motion_spread_m_s2 = 0.3;
  expect_complete(evidence);
  evidence.imu_motion_scale = 3.3;  // 0.33
  expect(RunStatus::kUntrusted, "3.30 times those", evidence);
}

TEST(RunJudgement, HowScansFittedTheMap) {
  constexpr auto kUntrusted = RunStatus::kUntrusted;
  const JudgementConfig limits;
  expect_limit(&RunEvidence::match, &MatchEvidence::few_share, limits.max_few,
               limits.max_few + 0.01, kUntrusted, "found few of their points in the map");
  expect_limit(&RunEvidence::match, &MatchEvidence::chance_share, limits.max_chance,
               limits.max_chance + 0.01, kUntrusted, "no nearer to the map than by chance");
  expect_limit(&RunEvidence::match, &MatchEvidence::blur_growth, limits.max_blur_growth,
               limits.max_blur_growth + 0.01, kUntrusted, "the map blurs as it grows");
}

TEST(RunJudgement, SilenceOfTheLidar) {
  RunEvidence evidence = good_run();
  evidence.lidar.longest_gap_s = 1.0;
  expect_complete(evidence);
  evidence.lidar.longest_gap_s = 1.1;
  expect(RunStatus::kUntrusted, "measured by the IMU alone", evidence);
  evidence.imu.longest_gap_s = 1.1;
  expect(RunStatus::kUntrusted, "guessed", evidence);
  evidence.by_stems = true;  // there a step that finds too few stems is judged
  evidence.stems.trees = 1;
  expect_complete(evidence);
}

// A regression: clouds six seconds apart, matched by chance, made a wrong map that was complete.
TEST(RunJudgement, ScansFarApart) {
  RunEvidence evidence = good_run();
  evidence.motion.longest_step_s = 1.0;
  expect_complete(evidence);
  evidence.motion.longest_step_s = 5.7;
  expect(RunStatus::kUntrusted, "scans lie up to 5.7 s apart; the motion", evidence);
  evidence.imu_used = false;
  expect(RunStatus::kUntrusted, "guessed", evidence);
  evidence.lidar.longest_gap_s = 5.7;
  expect(RunStatus::kUntrusted, "the lidar was silent", evidence);
}

TEST(RunJudgement, Stems) {
  RunEvidence evidence = good_run();
  evidence.by_stems = true;
  expect(RunStatus::kUntrusted, "listed as a tree", evidence);
  evidence.stems.trees = 5;
  expect_complete(evidence);
  evidence.stems.doubtful = 1;
  expect(RunStatus::kUntrusted, "too few of the stems", evidence);
  evidence.stems.doubtful = 0;
  evidence.stems.loops_solved = false;
  evidence.stems.loops_reason = "no end";
  expect(RunStatus::kUntrusted, "no end", evidence);
}

// A lever arm that is wrong by 3 m: the matches that it spoilt were said, and not why.
TEST(RunJudgement, APathThatIsNotTheAccelerometers) {
  RunEvidence evidence = good_run();
  evidence.imu_motion_spread_m_s2 = 0.42;
  evidence.imu_motion_scale = 0.82;
  evidence.imu_motion_correlation = 0.25;
  expect(RunStatus::kUntrusted, "lever arm", evidence);
  // A recording of 12 s whose slow turn was matched as if the carrier stood still.
  evidence.imu_motion_windows = JudgementConfig().min_imu_scatter_windows;
  expect(RunStatus::kUntrusted, "matched wrongly", evidence);
  --evidence.imu_motion_windows;
  expect_complete(evidence);
  evidence.imu_motion_windows = 300;
  // Steps by stems err by more than the motion of a good run.
  evidence.by_stems = true;
  evidence.stems.trees = 5;
  expect_complete(evidence);
  evidence.by_stems = false;
  // Noise of matching in a motion that is nearly even.
  evidence.imu_motion_spread_m_s2 = 0.21;
  evidence.imu_motion_scale = 1.0;
  evidence.imu_motion_correlation = 0.5;
  expect_complete(evidence);
  // Where matches contradicted an IMU that was right, they have to fit better.
  evidence.imu_cleared = true;
  evidence.imu_motion_correlation = 0.4;  // they differ by 0.48 m/s^2
  expect(RunStatus::kUntrusted, "matched wrongly", evidence);
  evidence.imu_cleared = false;
  expect_complete(evidence);
  // Vibrations: large, and of both.
  evidence.imu_motion_spread_m_s2 = 5.0;
  evidence.imu_motion_correlation = 0.97;
  expect_complete(evidence);
  evidence.imu_motion_correlation = 0.0;  // nothing is known
  evidence.imu_motion_scale = 1.0;
  evidence.imu_motion_windows = 0;
  expect_complete(evidence);
}

// A regression: ranges that were all 1 m too long made a wrong map that was complete.
TEST(RunJudgement, RangesThatAreAllTooLong) {
  expect_limit(&RunEvidence::match, &MatchEvidence::range_offset_m, 0.4, 0.41,
               RunStatus::kUntrusted, "0.41 m too long (± 0.02 m)");
  expect_limit(&RunEvidence::match, &MatchEvidence::range_offset_m, -0.4, -0.9,
               RunStatus::kUntrusted, "0.90 m too short");
  RunEvidence evidence = good_run();
  evidence.match.range_offset_m = 0.9;
  evidence.match.range_offset_error_m = 0.19;  // may be chance
  expect_complete(evidence);
  evidence.match.range_offset_error_m = 0.17;
  expect(RunStatus::kUntrusted, "0.90 m too long (± 0.17 m)", evidence);
  evidence.match.range_pairs = 4;
  expect_complete(evidence);
}

}  // namespace
}  // namespace understory
