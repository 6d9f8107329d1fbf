#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "understory/output/run_summary.h"
#include "understory/util/time.h"

namespace understory {

// The messages of one sensor of the recording, and how many of them were used.
struct SensorEvidence {
  std::uint64_t received = 0;     // messages that could be decoded
  std::uint64_t unreadable = 0;   // messages that could not
  std::uint64_t not_numbers = 0;  // messages that measure NaN or infinity, dropped
  std::uint64_t late = 0;         // too late to be put in order, dropped
  std::uint64_t glitches = 0;     // stamps far off, dropped
  std::uint64_t duplicates = 0;   // recorded twice: same stamp, same content; dropped
  std::uint64_t stamp_taken = 0;  // the stamp of another message, other content; dropped
  std::uint64_t reordered = 0;    // put in order
  std::uint64_t clock_jumps = 0;  // stamps shifted from there on
  double longest_gap_s = 0.0;
  std::string after_longest_gap;  // stamp of the message that ended it, seconds
  // How long the sensor was not used although it belongs to the recording, and why, in words. It
  // may have begun late, stopped, been silent, or been left out.
  double unused_s = 0.0;
  std::string unused_why;
  // How long another sensor went on after the last message of this one, and which, in words.
  double silent_at_end_s = 0.0;
  std::string outlived_by;
};

// How the carrier moved by the finished path.
struct MotionEvidence {
  std::uint64_t steps = 0;  // from scan to scan
  double speed_p99_m_s = 0.0;
  double acceleration_p95_m_s2 = 0.0;
  double acceleration_p99_m_s2 = 0.0;
  double turn_rate_p99_deg_s = 0.0;
  double fastest_m_s = 0.0;
  double hardest_m_s2 = 0.0;
  double longest_step_s = 0.0;  // between two scans
  // Steps beyond what any carrier does, see JudgementConfig.
  std::uint64_t impossible = 0;
  // How far the path went astray over such steps without coming back, at most, and when.
  double jump_m = 0.0;
  TimeNs jump_stamp = 0;
};

// How scans fitted the map.
struct MatchEvidence {
  std::uint64_t scans = 0;      // that reached the front end
  std::uint64_t unmatched = 0;  // without a usable match, or dropped by the velocity gate
  std::uint64_t empty = 0;      // hardly any usable point
  std::uint64_t repeated = 0;   // hold the same points as the scan before
  std::uint64_t cut = 0;        // one where the recording ends within a turn: empty, unmatched
  std::uint64_t segments = 1;   // pieces of map that hang together by predictions only
  std::uint64_t joined = 0;     // pieces that were joined to others where a place was seen again
  bool gap_joined = false;      // one of them begins where the longest gap of the lidar ends
  std::string first_lost;       // stamp of the first scan of the second piece, seconds
  double inliers_mean = 0.0;    // share of a scan's points near the map, 0 to 1
  double inliers_low = 0.0;     // the same of the tenth of the scans that have least
  double fitness_rms_m = 0.0;   // distance of matched points from what they matched
  // Of the windows of two seconds after the first ones, see MatchCourse. First the share in which
  // scans find few of their points in the map, then that in which found points lie where chance
  // puts them. Last the distance of matched points in the last third of the run over that in the
  // first, 1 where it is not known.
  double few_share = 0.0;
  double chance_share = 0.0;
  double blur_growth = 1.0;
  // Motion within scans over motion between them, and on how many scans that rests; see ScanMotion.
  double scan_motion_ratio = 0.0;
  double scan_motion_sd = 0.0;
  int scan_motion_probes = 0;
  // By how much all ranges seem to be too long, how sure that is, and how many pairs of views tell
  // it; see RangeCheck.
  double range_offset_m = 0.0;
  double range_offset_error_m = 0.0;
  int range_pairs = 0;
  double smear_m = 0.0;             // how far a point 10 m away moves during a scan, on average
  std::uint64_t by_satellites = 0;  // scans whose match or place fixes told something of
};

// The one of several lidars whose points lie farthest off those of the first one, see LidarOffset.
// All zero with one lidar, and before enough scans have told.
struct FurtherLidarEvidence {
  int number = 0;        // 2: the second one
  double apart_m = 0.0;  // from the points of the first one
  double late_s = 0.0;   // of its clock
  double late_sd_s = 0.0;
  double misplaced_m = 0.0;  // its place on the body
  double misplaced_sd_m = 0.0;
};

// By stems: how views fitted each other. All zero for the dense front end.
struct StemRunEvidence {
  std::uint64_t views = 0;
  std::uint64_t doubtful = 0;  // views that found too few of the stems before, and no loop bridges
  std::uint64_t trees = 0;
  bool loops_solved = true;
  std::string loops_reason;
};

// Whether the finished map can be the ground for a list of trees. Without a map it says nothing.
struct StandEvidence {
  std::uint64_t trees = 0;
  bool few_near_breast = false;  // too few points near breast height to see stems reliably
  std::string not_upright;       // why z of the map is not up, in words; empty: nothing says so
  std::string two_images;        // why the map shows trees twice, in words; empty: nothing says so
};

// Everything that the judgement of a run rests on: numbers, and words only to say where. Filled by
// evidence_gathering.h, judged by run_judgement.h, written to run.json as `evidence`.
struct RunEvidence {
  bool by_stems = false;            // which front end
  bool stopped = false;             // before the end of the recording
  std::string goes_on_by;           // command that goes on with it; empty: it is begun anew
  std::string unreadable;           // why it could not be read to its end; else the user stopped
  std::uint64_t dropped_scans = 0;  // --realtime: the machine could not keep up
  SensorEvidence lidar;
  SensorEvidence imu;
  SensorEvidence gnss;
  SensorEvidence mag;
  std::uint64_t damaged_places = 0;  // of the recording's files
  std::string first_damage;
  std::uint64_t damaged_packets = 0;
  std::string first_damaged_packet;
  std::uint64_t other_sensor_messages = 0;  // of a second lidar on the topic, left out
  std::string first_other_sensor;
  std::uint64_t silent_lidars = 0;  // times that one of several lidars was silent
  std::string first_silent_lidar;
  std::string late_sensor;  // one that a capture's reader met too late to use; empty: none
  bool cut_off = false;     // the recording ends in the middle of something
  std::string where_cut_off;
  bool times_assumed = false;        // nothing tells when the clouds of a folder were taken
  bool point_times_missing = false;  // of a lidar that spins
  std::string why_no_point_times;
  std::uint64_t mixed_times = 0;  // scans whose points have times in no order
  FurtherLidarEvidence further_lidar;
  bool imu_used = false;          // at the end
  bool imu_on_probation = false;  // at the end: left out until it is clear whether it is right
  double imu_doubted_s = 0.0;     // left out for so long, and used again
  bool imu_cleared = false;       // a run before this one found it right, and matches wrong
  // Acceleration by matching over that by the accelerometer, how well they go together, and how
  // much there was to compare; see MotionScale.
  double imu_motion_scale = 0.0;
  double imu_motion_correlation = 0.0;
  double imu_motion_spread_m_s2 = 0.0;
  int imu_motion_windows = 0;
  // How far z of the world is from up, by gravity at the end, and by how much the accelerometer is
  // off then. A world is levelled once, at the beginning; what is learnt of the accelerometer later
  // turns gravity in it.
  double tilt_at_end_deg = 0.0;
  double accelerometer_bias_m_s2 = 0.0;
  std::string imu_distrust;  // why the IMU is not trusted; empty: it is, or is none
  MotionEvidence motion;
  MatchEvidence match;
  StemRunEvidence stems;
  StandEvidence stand;
};

// The sensors by the names of their roles, in the order of EventOrderer's streams.
struct SensorRole {
  const char* name;   // in files
  const char* words;  // in messages
  SensorEvidence RunEvidence::*evidence;
};
inline constexpr std::array<SensorRole, 4> kSensorRoles = {
    {{"lidar", "lidar", &RunEvidence::lidar},
     {"imu", "IMU", &RunEvidence::imu},
     {"gnss", "GNSS", &RunEvidence::gnss},
     {"mag", "magnetometer", &RunEvidence::mag}}};

// For run.json: the numbers by name, sensors before their figures ("lidar_late").
[[nodiscard]] std::map<std::string, Figure> figures_of(const RunEvidence& evidence);

}  // namespace understory
