#include "understory/pipeline/judgement/run_judgement.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/time.h"

namespace understory {
namespace {

using namespace pipeline_constants::run_judgement;

double share(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return 100.0 * share(part, whole);
}

// Gathers reasons for one judgement.
class Judge {
 public:
  Judge(const RunEvidence& evidence, const JudgementConfig& config)
      : evidence_(evidence), config_(config) {}

  RunJudgement judge() {
    judge_ending();
    judge_unused_scans();
    judge_unused_sensors();
    judge_lidar_end();
    judge_damage();
    judge_times();
    judge_scan_motion();
    judge_further_lidar();
    judge_imu();
    judge_ranges();
    const std::size_t before = hurt_.size();
    judge_scale();
    judge_motion();
    judge_matches();
    judge_course();
    if (hurt_.size() > before) suspect_fixes();
    judge_outages();
    judge_stems();
    judge_stand();
    return judgement();
  }

 private:
  void missing(std::string reason) { missing_.push_back(std::move(reason)); }
  void hurt(std::string reason) { hurt_.push_back(std::move(reason)); }

  void judge_ending() {
    if (!evidence_.unreadable.empty()) {
      missing("the recording could not be read any further: " + evidence_.unreadable +
              "; once it can be, go on with `" + evidence_.goes_on_by + "`");
    } else if (evidence_.stopped) {
      const std::string stopped = "stopped by the user before the end of the recording";
      missing(stopped + (evidence_.goes_on_by.empty()
                             ? "; run the command again for the whole of it"
                             : "; go on with `" + evidence_.goes_on_by + "`"));
    }
    if (evidence_.cut_off) {
      missing("the recording is cut off, and the rest is missing: " + evidence_.where_cut_off);
    }
  }

  // Counts and what they count, in words; those of nothing are left out.
  using Parts = std::vector<std::pair<std::uint64_t, const char*>>;
  static std::string text_of(const Parts& parts) {
    std::string text;
    for (const auto& [count, what] : parts) {
      if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
    }
    return text;
  }
  static std::uint64_t sum_of(const Parts& parts) {
    std::uint64_t sum = 0;
    for (const auto& part : parts)
      sum += part.first;
    return sum;
  }

  [[nodiscard]] Parts unused_scans() const {
    const SensorEvidence& lidar = evidence_.lidar;
    return {{evidence_.dropped_scans, "dropped because the machine could not keep up"},
            {lidar.unreadable, "unreadable"},
            {lidar.late, "too late to be put in order"},
            {lidar.glitches, "with a stamp far off"},
            {lidar.stamp_taken,
             "with the stamp of another scan (the clock of the lidar or its driver stands still)"}};
  }
  [[nodiscard]] double unused_share() const { return share(sum_of(unused_scans()), sent_scans()); }
  [[nodiscard]] std::uint64_t sent_scans() const {
    return evidence_.dropped_scans + evidence_.lidar.received + evidence_.lidar.unreadable;
  }

  // Of all that the lidar sent, what never reached the map.
  void judge_unused_scans() {
    if (unused_share() <= config_.max_unused_scans) return;
    const std::uint64_t unused = sum_of(unused_scans());
    missing(fmt::format("{} of {} scans ({:.1f} %) are not in the map: {}", unused, sent_scans(),
                        percent(unused, sent_scans()), text_of(unused_scans())));
  }

  void judge_unused_sensors() {
    for (const SensorRole& role : kSensorRoles) {
      if (role.evidence == &RunEvidence::lidar) continue;
      const SensorEvidence& sensor = evidence_.*role.evidence;
      if (sensor.unused_s > config_.max_unused_s) {
        missing(fmt::format("the {} was not used for {:.1f} s: {}", role.words, sensor.unused_s,
                            sensor.unused_why));
      }
      judge_unused_messages(role.words, sensor);
    }
  }

  // Messages that have no say, whatever time they stand for.
  void judge_unused_messages(const char* name, const SensorEvidence& sensor) {
    const Parts parts = {{sensor.unreadable, "unreadable"},
                         {sensor.not_numbers, "not numbers (NaN)"},
                         {sensor.stamp_taken,
                          "with the stamp of another message (the sensor's clock stands still)"}};
    const std::uint64_t unused = sum_of(parts);
    const std::uint64_t all = sensor.received + sensor.unreadable + sensor.not_numbers;
    if (share(unused, all) <= config_.max_unused_scans) return;
    missing(fmt::format("{} of {} messages of the {} ({:.1f} %) were not used: {}", unused, all,
                        name, percent(unused, all), text_of(parts)));
  }

  // The lidar stopped, and the others went on. Scans that were dropped have their own reason.
  void judge_lidar_end() {
    const SensorEvidence& lidar = evidence_.lidar;
    if (unused_share() > config_.max_unused_scans) return;
    if (evidence_.stopped || lidar.silent_at_end_s <= config_.max_unused_s) return;
    missing(fmt::format(
        "the lidar stopped {:.1f} s before the {}: what the carrier passed after that is not in "
        "the map",
        lidar.silent_at_end_s, lidar.outlived_by));
  }

  void judge_damage() {
    if (evidence_.other_sensor_messages > 0) {
      missing(fmt::format("{} message(s) of a second sensor were not used: {}",
                          evidence_.other_sensor_messages, evidence_.first_other_sensor));
    }
    if (evidence_.silent_lidars > 0) {
      missing(fmt::format("one of several lidars was silent ({} time(s), the first: {})",
                          evidence_.silent_lidars, evidence_.first_silent_lidar));
    }
    if (!evidence_.late_sensor.empty()) missing("a sensor was not used: " + evidence_.late_sensor);
    if (evidence_.damaged_places > 0) {
      hurt(fmt::format("the recording is damaged ({} place(s), the first: {})",
                       evidence_.damaged_places, evidence_.first_damage));
    }
    if (evidence_.damaged_packets > evidence_.match.scans) {  // more than one a scan
      hurt(fmt::format("{} packets of the lidar are damaged, the first: {}",
                       evidence_.damaged_packets, evidence_.first_damaged_packet));
    }
  }

  void judge_times() {
    const MatchEvidence& match = evidence_.match;
    if (evidence_.point_times_missing && match.smear_m > config_.max_smear_m) {
      hurt(fmt::format("{}. The sensor moved so much that points 10 m away are smeared by {:.2f} m",
                       evidence_.why_no_point_times, match.smear_m));
    }
    if (share(evidence_.mixed_times, match.scans) > kMostMixedTimes) {
      std::string mixed = fmt::format(
          "in {} of {} scans the times of points are in no order: a driver or a converter has "
          "mixed them up. The motion within a scan (points 10 m away move by {:.2f} m) cannot be "
          "taken out",
          evidence_.mixed_times, match.scans, match.smear_m);
      match.smear_m > config_.max_smear_m ? hurt(std::move(mixed)) : missing(std::move(mixed));
    }
    if (share(match.repeated, match.scans) > config_.max_repeated) {
      hurt(
          fmt::format("{} of {} scans hold the same points as the scan before: the driver or the "
                      "recorder repeats scans, and the path stands still there or jumps",
                      match.repeated, match.scans));
    }
  }

  // What the times of the points say of the motion within a scan.
  void judge_scan_motion() {
    const MatchEvidence& match = evidence_.match;
    if (match.scan_motion_probes < config_.min_scan_motion_probes) return;
    const double ratio = match.scan_motion_ratio;
    // A few probes that differ much tell nothing.
    const double margin = std::min(kScanMotionSds * match.scan_motion_sd, kMostScanMotionMargin);
    if (ratio + margin >= config_.min_scan_motion && ratio - margin <= config_.max_scan_motion)
      return;
    const char* cause = "The times are wrong";
    if (ratio < -config_.min_scan_motion) {
      cause = "The times run backwards";
    } else if (ratio < config_.min_scan_motion) {
      cause = "The times are too long, or the points have been deskewed already";
    }
    hurt(fmt::format(
        "the times of points do not fit the motion: within scans the sensor moves {:.1f} "
        "times as far as from scan to scan. {}",
        ratio, cause));
  }

  // Whether several lidars see the same things in the same places.
  void judge_further_lidar() {
    const FurtherLidarEvidence& lidar = evidence_.further_lidar;
    if (lidar.apart_m <= config_.max_lidars_apart_m) return;
    hurt(
        fmt::format("the points of lidar {} lie {:.0f} cm beside those of the first one: its "
                    "clock or its extrinsics are wrong",
                    lidar.number, 100.0 * lidar.apart_m));
  }

  // Standard deviation of the scale, from the scatter of the accelerations about it.
  double scale_deviation() const {
    const double correlation = std::abs(evidence_.imu_motion_correlation);
    if (correlation <= 0.0) return 0.0;
    return std::abs(evidence_.imu_motion_scale) / correlation *
           std::sqrt((1.0 - std::min(1.0, correlation * correlation)) /
                     static_cast<double>(evidence_.imu_motion_windows));
  }

  // Standard deviation of the accelerations by matching about what the accelerometer explains of
  // them, m/s^2.
  double scatter_m_s2() const {
    const double correlation = std::abs(evidence_.imu_motion_correlation);
    if (correlation <= 0.0) return 0.0;
    return evidence_.imu_motion_spread_m_s2 * std::abs(evidence_.imu_motion_scale) / correlation *
           std::sqrt(1.0 - std::min(1.0, correlation * correlation));
  }

  [[nodiscard]] bool scale_is_off() const {
    if (evidence_.imu_motion_windows < config_.min_imu_windows) return false;
    const double slack = 3.0 * scale_deviation();
    return evidence_.imu_motion_scale + slack < config_.min_imu_scale ||
           evidence_.imu_motion_scale - slack > config_.max_imu_scale;
  }

  // Steps by stems err by centimetres: their accelerations correlate by 0.2 in good runs. Matches
  // that were wrong before have to fit better now.
  [[nodiscard]] bool accelerations_differ() const {
    const double share = evidence_.imu_cleared ? kShareOfScatterWhenCleared : 1.0;
    return !evidence_.by_stems && evidence_.imu_motion_windows >= config_.min_imu_scatter_windows &&
           evidence_.imu_motion_correlation < config_.min_imu_correlation &&
           scatter_m_s2() > share * config_.max_imu_scatter_m_s2;
  }

  void judge_scale() {
    if (!evidence_.imu_distrust.empty()) return;  // then the IMU cannot be compared with
    if (evidence_.imu_motion_spread_m_s2 < config_.min_imu_spread_m_s2) return;
    if (scale_is_off()) {
      hurt(fmt::format(
          "the accelerations of the path are {:.2f} times those of the accelerometer. One of these "
          "is wrong: the scale of the clouds (unit), the stamps of the scans, or the IMU's unit, "
          "clock or lever arm",
          evidence_.imu_motion_scale));
    } else if (accelerations_differ()) {
      hurt(fmt::format(
          "the accelerations of the path are not those of the accelerometer (correlation {:.2f}). "
          "Scans are matched wrongly, or their stamps, the IMU's clock or its lever arm are wrong",
          evidence_.imu_motion_correlation));
    }
  }

  // What surfaces say that were seen from two sides.
  void judge_ranges() {
    const MatchEvidence& match = evidence_.match;
    if (match.range_pairs < config_.min_range_pairs) return;
    const double off = std::abs(match.range_offset_m);
    if (off <= config_.max_range_offset_m || off <= kSureErrors * match.range_offset_error_m)
      return;
    hurt(fmt::format(
        "ranges seem to be {:.2f} m too {} (± {:.2f} m): surfaces seen from two places agree only "
        "then. The lidar's range offset or the driver's calibration is wrong",
        off, match.range_offset_m > 0.0 ? "long" : "short",
        std::max(0.01, match.range_offset_error_m)));
  }

  void judge_motion() {
    const MotionEvidence& motion = evidence_.motion;
    if (motion.jump_m > config_.max_jump_m) {
      hurt(
          fmt::format("the path jumps by {:.1f} m before {} s and does not come back: the maps "
                      "before and behind do not fit together",
                      motion.jump_m, format_seconds(motion.jump_stamp)));
    }
    if (!evidence_.imu_used && !evidence_.by_stems &&
        motion.acceleration_p95_m_s2 > config_.max_shake_m_s2) {
      missing(
          fmt::format("without an IMU the path shakes from scan to scan (accelerations of {:.0f} "
                      "m/s^2): single scans are up to some decimetres off in the map. Record the "
                      "IMU, or move more slowly",
                      motion.acceleration_p95_m_s2));
    }
    const double impossible = share(motion.impossible, motion.steps);
    if (impossible <= config_.max_misplaced) return;
    const std::string found = fmt::format(
        "{} of {} steps from scan to scan ({:.1f} %) are motions that no carrier makes (up to "
        "{:.0f} m/s and {:.0f} m/s^2)",
        motion.impossible, motion.steps, percent(motion.impossible, motion.steps),
        motion.fastest_m_s, motion.hardest_m_s2);
    if (evidence_.times_assumed) {
      hurt(found +
           ". The times of the clouds were assumed and are wrong: give --rate-hz or times.txt");
    } else if (impossible > config_.max_impossible) {
      hurt(found + ". The stamps of the scans or the matches are wrong");
    } else {
      missing(found + ". Single scans are at wrong places in the map");
    }
  }

  void judge_matches() {
    const MatchEvidence& match = evidence_.match;
    const std::uint64_t unmatched = match.unmatched - std::min(match.cut, match.unmatched);
    const std::uint64_t empty = match.empty - std::min(match.cut, match.empty);
    if (share(unmatched, match.scans) > config_.max_unmatched) {
      hurt(
          fmt::format("{} of {} scans ({:.1f} %) could not be matched to the map; their poses "
                      "are predictions{}",
                      unmatched, match.scans, percent(unmatched, match.scans),
                      evidence_.times_assumed
                          ? ". The times of the clouds were assumed: if they lie farther apart, "
                            "give --rate-hz or times.txt"
                          : ""));
    }
    if (share(empty, match.scans) > config_.max_unused_scans) {
      std::string few =
          fmt::format("{} of {} scans had hardly any usable point", empty, match.scans);
      share(empty, match.scans) > config_.max_empty ? hurt(std::move(few))
                                                    : missing(std::move(few));
    }
    if (match.segments > 1) {
      hurt(
          fmt::format("the position was lost {} time(s), first at {} s; the map consists of {} "
                      "pieces that do not fit together",
                      match.segments - 1 + match.joined, match.first_lost, match.segments));
    }
  }

  // How scans fitted the map as it grew.
  void judge_course() {
    const MatchEvidence& match = evidence_.match;
    if (match.few_share > config_.max_few) {
      hurt(fmt::format(
          "over {:.0f} % of the time scans found few of their points in the map: matches by so few "
          "points may be wrong",
          100.0 * match.few_share));
    }
    if (match.chance_share > config_.max_chance) {
      hurt(
          fmt::format("over {:.0f} % of the time matched points lie no nearer to the map than by "
                      "chance. The map is blurred, or its scans are matched wrongly",
                      100.0 * match.chance_share));
    }
    if (match.blur_growth > config_.max_blur_growth) {
      hurt(fmt::format(
          "the map blurs as it grows: in the last third of the run matched points lie {:.2f} times "
          "as far from it",
          match.blur_growth));
    }
  }

  void judge_outages() {
    if (evidence_.by_stems) return;
    const SensorEvidence& lidar = evidence_.lidar;
    const bool carried = evidence_.imu_used &&
                         evidence_.imu.longest_gap_s <= config_.longest_lidar_gap_s &&
                         evidence_.match.segments == 1;
    const char* way = carried ? "measured by the IMU alone" : "guessed";
    if (lidar.longest_gap_s > config_.longest_lidar_gap_s && evidence_.match.gap_joined) {
      missing(fmt::format(
          "the lidar was silent for {:.1f} s before {} s. The maps before and after were joined "
          "where places were seen again; of the way in between nothing is known",
          lidar.longest_gap_s, lidar.after_longest_gap));
    } else if (lidar.longest_gap_s > config_.longest_lidar_gap_s) {
      hurt(fmt::format(
          "the lidar was silent for {:.1f} s before {} s. The motion in between was {}, so the map "
          "before and after may be offset",
          lidar.longest_gap_s, lidar.after_longest_gap, way));
    } else if (evidence_.motion.longest_step_s > config_.longest_lidar_gap_s) {
      hurt(fmt::format("scans lie up to {:.1f} s apart; the motion from one to the next was {}",
                       evidence_.motion.longest_step_s, way));
    }
  }

  void judge_imu() {
    if (evidence_.imu_used && evidence_.tilt_at_end_deg > kMostTiltDeg &&
        evidence_.accelerometer_bias_m_s2 > kLargeBiasMPerS2) {
      hurt(fmt::format(
          "the map leans by {:.1f} degrees: the accelerometer is off by {:.2f} m/s^2, which showed "
          "only after the map was levelled by it. Calibrate the IMU",
          evidence_.tilt_at_end_deg, evidence_.accelerometer_bias_m_s2));
    }
    if (!evidence_.imu_distrust.empty()) {
      hurt(evidence_.imu_distrust);
    } else if (evidence_.imu_on_probation) {
      missing(
          "at the end the IMU was left out: the matches contradict it, and the recording ends "
          "before it is clear which of them is right");
    } else if (evidence_.imu_doubted_s > config_.max_unused_s) {
      missing(
          fmt::format("the IMU was left out for {:.1f} s, as the matches contradicted it, and "
                      "was used again after that. The path of that time may be wrong",
                      evidence_.imu_doubted_s));
    }
  }

  void judge_stems() {
    if (!evidence_.by_stems) return;
    const StemRunEvidence& stems = evidence_.stems;
    if (!stems.loops_solved) hurt("the loops were not solved: " + stems.loops_reason);
    if (stems.trees == 0) {
      hurt(fmt::format("no stem was seen often enough in {} views to be listed as a tree",
                       stems.views));
    }
    if (stems.doubtful > 0) {
      hurt(
          fmt::format("{} of {} views found too few of the stems seen before: the path may be bent "
                      "or broken there",
                      stems.doubtful, stems.views));
    }
  }

  void judge_stand() {
    const StandEvidence& stand = evidence_.stand;
    if (!stand.not_upright.empty()) {
      hurt("the map does not stand upright: " + stand.not_upright +
           ". Without an IMU its vertical is that of the scanner at the first scan. Record the "
           "IMU, or bring the map upright with `understory inventory --up`");
      return;  // that there are no stems follows from it
    }
    if (!stand.two_images.empty()) hurt(stand.two_images);
    // Around a path lie areas that were seen from afar alone, so few points in the mean are no harm
    // by themselves.
    if (stand.few_near_breast && stand.trees == 0) missing(few_points_reason(false));
  }

  // Something is wrong with the path. Where fixes pull at it, they may be what bent it.
  void suspect_fixes() {
    if (evidence_.match.by_satellites == 0) return;
    hurt(fmt::format(
        "positions by satellites moved the matches of {} of {} scans. A receiver that drifts and "
        "states centimetres bends the map. Map again with gnss.match.use=none and compare",
        evidence_.match.by_satellites, evidence_.match.scans));
  }

  RunJudgement judgement() {
    RunJudgement judgement;
    if (!missing_.empty()) judgement.status = RunStatus::kPartial;
    if (!hurt_.empty()) judgement.status = RunStatus::kUntrusted;
    judgement.reasons = std::move(missing_);
    judgement.reasons.insert(judgement.reasons.end(), hurt_.begin(), hurt_.end());
    return judgement;
  }

  const RunEvidence& evidence_;
  const JudgementConfig& config_;
  std::vector<std::string> missing_;
  std::vector<std::string> hurt_;
};

}  // namespace

std::string few_points_reason(bool any_trees) {
  return any_trees ? "few points lie near breast height: trees are missing from the list"
                   : "no stem could be measured, as too few points lie near breast height: the "
                     "list of trees is empty, but the stand need not be";
}

double smear_of(const Pose& step) {
  return step.translation().norm() + kRangeM * step.angle();
}

std::string imu_refusal(const std::string& reason) {
  return reason +
         ". The recording was mapped without the IMU: check how it is mounted (--extrinsics FILE), "
         "its axes, units and clock";
}

RunJudgement judge_run(const RunEvidence& evidence, const JudgementConfig& config) {
  return Judge(evidence, config).judge();
}

}  // namespace understory
