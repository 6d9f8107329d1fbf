#include "understory/simulation/sensors/satellite.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/util/angles.h"

namespace understory {
namespace {

constexpr double kSemiMajor = 6378137.0;
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricity2 = kFlattening * (2.0 - kFlattening);
constexpr double kFastSeconds = 2.0;      // correlation of the fast error
constexpr double kHeadingSeconds = 20.0;  // of the slow error of a heading
constexpr double kLeastShare = 0.5;       // of a line in the plane: a steeper one has no heading

Eigen::Vector3d ecef(double latitude, double longitude, double height) {
  const double s = std::sin(latitude);
  const double n = kSemiMajor / std::sqrt(1.0 - kEccentricity2 * s * s);
  return {(n + height) * std::cos(latitude) * std::cos(longitude),
          (n + height) * std::cos(latitude) * std::sin(longitude),
          (n * (1.0 - kEccentricity2) + height) * s};
}

}  // namespace

Eigen::Vector3d geodetic_from_enu(const OriginConfig& origin, const Eigen::Vector3d& point) {
  const double lat = origin.latitude_deg * kDegree;
  const double lon = origin.longitude_deg * kDegree;
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0.0);
  const Eigen::Vector3d up(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon),
                           std::sin(lat));
  const Eigen::Vector3d north = up.cross(east);
  const Eigen::Vector3d p =
      ecef(lat, lon, origin.height_m) + point.x() * east + point.y() * north + point.z() * up;
  const double plane = std::hypot(p.x(), p.y());
  // Bowring's start and a few fixed-point steps: exact to a nanometre near the ground.
  double latitude = std::atan2(p.z(), plane * (1.0 - kEccentricity2));
  double height = 0.0;
  for (int i = 0; i < 6; ++i) {
    const double s = std::sin(latitude);
    const double n = kSemiMajor / std::sqrt(1.0 - kEccentricity2 * s * s);
    height = plane * std::cos(latitude) + p.z() * s - n * (1.0 - kEccentricity2 * s * s);
    latitude = std::atan2(p.z(), plane * (1.0 - kEccentricity2 * n / (n + height)));
  }
  return {latitude / kDegree, std::atan2(p.y(), p.x()) / kDegree, height};
}

SatelliteReceiver::SatelliteReceiver(const SiteConfig& config, const CarrierPath& path,
                                     const ForestScene& scene, TimeNs start)
    : config_(config.gnss),
      hold_(config.receiver_hold),
      origin_(config.origin),
      path_(path),
      scene_(scene),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kGnss),
                         static_cast<std::uint64_t>(config.carrier.strip_road - 1))) {
  CounterNoise noise(seed_, 0, 1);
  slow_ = normal3(noise);
  fast_ = normal3(noise);
  CounterNoise second(seed_ + 6, 0, 1);
  second_slow_ = normal3(second);
  second_fast_ = normal3(second);
}

TimeNs SatelliteReceiver::next_stamp() const {
  return start_ +
         static_cast<TimeNs>(std::llround(static_cast<double>(count_) * 1e9 / config_.rate_hz));
}

void SatelliteReceiver::walk(double dt_s) {
  CounterNoise noise(seed_ + 1, static_cast<std::uint64_t>(count_), 0);
  const double slow = std::exp(-dt_s / config_.correlation_s);
  const double fast = std::exp(-dt_s / kFastSeconds);
  slow_ = slow * slow_ + std::sqrt(1.0 - slow * slow) * normal3(noise);
  fast_ = fast * fast_ + std::sqrt(1.0 - fast * fast) * normal3(noise);
  if (!has_second_positions()) return;
  CounterNoise second(seed_ + 6, static_cast<std::uint64_t>(count_), 0);
  second_slow_ = slow * second_slow_ + std::sqrt(1.0 - slow * slow) * normal3(second);
  second_fast_ = fast * second_fast_ + std::sqrt(1.0 - fast * fast) * normal3(second);
}

bool SatelliteReceiver::in_outage(double dt_s, CounterNoise& noise) {
  const double rate = cover_ * cover_ / config_.outage_interval_s;
  const bool begins = noise.uniform() < rate * dt_s;
  const double length = -config_.outage_s * std::log(1.0 - noise.uniform());
  if (outage_left_s_ > 0.0) {
    outage_left_s_ -= dt_s;
    return true;
  }
  if (begins && count_ > 0) outage_left_s_ = length;  // a recording starts with a fix
  return outage_left_s_ > 0.0;
}

bool SatelliteReceiver::is_silent(TimeNs stamp) const {
  const std::vector<double>& silent = config_.silent_s;
  const double time_s = to_seconds(stamp - start_);
  return !silent.empty() && time_s >= silent[0] && time_s < silent[1];
}

// A burst: the solution runs away to one side and comes back. The receiver does not know of it.
Eigen::Vector3d SatelliteReceiver::burst(double dt_s) {
  if (config_.burst_interval_s <= 0.0) return Eigen::Vector3d::Zero();
  CounterNoise noise(seed_ + 3, static_cast<std::uint64_t>(count_), 0);
  const bool begins = noise.uniform() < cover_ * cover_ * dt_s / config_.burst_interval_s;
  const double angle = 2.0 * std::numbers::pi * noise.uniform();
  const double share = 0.7 + 0.6 * noise.uniform();
  if (burst_left_s_ <= 0.0 && begins) {
    burst_s_ = share * config_.burst_s;
    burst_left_s_ = burst_s_;
    burst_peak_ =
        share * config_.burst_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), noise.normal());
  }
  if (burst_left_s_ <= 0.0) return Eigen::Vector3d::Zero();
  burst_left_s_ -= dt_s;
  const double sine = std::sin(std::numbers::pi * std::max(0.0, burst_left_s_) / burst_s_);
  return sine * sine * burst_peak_;
}

// The set of satellites changes: the solution steps aside, and stays there until the next change.
void SatelliteReceiver::jump(double dt_s) {
  if (config_.jump_interval_s <= 0.0) return;
  CounterNoise noise(seed_ + 4, static_cast<std::uint64_t>(count_), 0);
  if (noise.uniform() >= cover_ * cover_ * dt_s / config_.jump_interval_s) return;
  jump_ = config_.jump_m * normal3(noise);
  jump_.z() *= config_.height_factor;
}

// What the receiver reports of its solution.
Eigen::Vector3d SatelliteReceiver::hold(const Eigen::Vector3d& solution, double speed_m_s) {
  if (speed_m_s >= hold_.below_m_s) {
    held_.reset();
    return solution;
  }
  const bool left = held_ && (solution - *held_).head<2>().norm() > hold_.release_m;
  if (!held_ || left) held_ = solution;
  return *held_;
}

std::optional<GnssFix> SatelliteReceiver::next() {
  const TimeNs stamp = next_stamp();
  const double dt = 1.0 / config_.rate_hz;
  const CarrierState state = path_.state(to_seconds(stamp - start_));
  const Eigen::Vector3d arm(config_.mount_m[0], config_.mount_m[1], config_.mount_m[2]);
  const Eigen::Vector3d antenna = state.world_from_body * arm;
  // The sky changes slowly: a fast receiver looks up ten times a second.
  const auto every = static_cast<std::int64_t>(std::max(1.0, std::floor(config_.rate_hz / 10.0)));
  if (count_ % every == 0) cover_now_ = scene_.canopy_cover(antenna);
  const double cover_now = cover_now_;
  // A receiver's filter forgets slowly: what hides the sky counts for a second or two.
  cover_ = count_ == 0 ? cover_now : cover_ + std::min(1.0, dt / 1.5) * (cover_now - cover_);
  CounterNoise noise(seed_ + 2, static_cast<std::uint64_t>(count_), 0);
  walk(dt);
  const bool lost = in_outage(dt, noise) || is_silent(stamp);
  jump(dt);
  walk_heading(dt);
  const Eigen::Vector3d runaway = burst(dt) + jump_;
  ++count_;

  const double sd = config_.open_sd_m + config_.canopy_sd_m * cover_ * cover_;
  error_ = sd * (slow_ + config_.multipath_share * fast_) + config_.white_sd_m * normal3(noise);
  error_.z() *= config_.height_factor;
  error_ += runaway;
  if (lost) return std::nullopt;
  error_ = hold(antenna + error_, state.velocity.head<2>().norm()) - antenna;

  const Eigen::Vector3d geodetic = geodetic_from_enu(origin_, antenna + error_);
  GnssFix fix;
  fix.stamp = stamp;
  fix.latitude_deg = geodetic.x();
  fix.longitude_deg = geodetic.y();
  fix.height_m = geodetic.z();
  const double reported = std::max(0.01, config_.reported_factor * sd);
  fix.covariance = Eigen::Vector3d(1.0, 1.0, std::pow(config_.height_factor, 2.0)).asDiagonal();
  fix.covariance *= reported * reported;
  fix.quality = 1;
  fix.satellites = static_cast<int>(std::lround(24.0 - 15.0 * cover_ + noise.normal()));
  fix.satellites = std::max(4, fix.satellites);
  fix.hdop = std::max(0.5, 0.65 + 1.3 * cover_ * cover_ + 0.04 * noise.normal());
  fix.vdop = std::max(0.6, 1.55 * fix.hdop + 0.05 * noise.normal());
  const Eigen::Vector3d velocity =
      state.velocity + state.world_from_body.rotation() * state.angular_rate.cross(arm) +
      (0.03 + 0.12 * cover_) * normal3(noise);
  fix.track_deg = std::atan2(velocity.x(), velocity.y()) / kDegree;
  if (fix.track_deg < 0.0) fix.track_deg += 360.0;
  fix.speed_m_s = velocity.head<2>().norm();
  if (has_second_positions()) {
    second_fix_ = second_position(state.world_from_body, fix, sd);
  } else {
    tell_heading(state.world_from_body, fix);
  }
  return fix;
}

bool SatelliteReceiver::has_second_positions() const {
  const auto& line = config_.second_antenna_m;
  return config_.second_antenna_positions && (line[0] != 0.0 || line[1] != 0.0 || line[2] != 0.0);
}

// The same sky and the same promises; bursts and jumps are those of the first antenna alone.
GnssFix SatelliteReceiver::second_position(const Pose& world_from_body, const GnssFix& first,
                                           double sd_m) const {
  const double common = config_.second_antenna_common;  // is the correlation of both errors
  const double own = std::sqrt(1.0 - common * common);
  const Eigen::Vector3d slow = common * slow_ + own * second_slow_;
  const Eigen::Vector3d fast = common * fast_ + own * second_fast_;
  CounterNoise noise(seed_ + 7, static_cast<std::uint64_t>(count_), 0);
  Eigen::Vector3d error =
      sd_m * (slow + config_.multipath_share * fast) + config_.white_sd_m * normal3(noise);
  error.z() *= config_.height_factor;
  const Eigen::Vector3d antenna(config_.mount_m[0] + config_.second_antenna_m[0],
                                config_.mount_m[1] + config_.second_antenna_m[1],
                                config_.mount_m[2] + config_.second_antenna_m[2]);
  const Eigen::Vector3d geodetic = geodetic_from_enu(origin_, world_from_body * antenna + error);
  GnssFix fix = first;
  fix.latitude_deg = geodetic.x();
  fix.longitude_deg = geodetic.y();
  fix.height_m = geodetic.z();
  return fix;
}

// Half of the variance is slow, half of it changes from fix to fix. The errors go on in an outage.
void SatelliteReceiver::walk_heading(double dt_s) {
  CounterNoise noise(seed_ + 5, static_cast<std::uint64_t>(count_), 0);
  const double kept = std::exp(-dt_s / kHeadingSeconds);
  heading_slow_ = count_ == 0
                      ? noise.normal()
                      : kept * heading_slow_ + std::sqrt(1.0 - kept * kept) * noise.normal();
  heading_error_ = std::sqrt(0.5) * (heading_slow_ + noise.normal());
}

// Nothing where there is no second antenna, or where it stands above the first one.
void SatelliteReceiver::tell_heading(const Pose& world_from_body, GnssFix& fix) const {
  const Eigen::Vector3d baseline(config_.second_antenna_m[0], config_.second_antenna_m[1],
                                 config_.second_antenna_m[2]);
  const Eigen::Vector3d along = world_from_body.rotation() * baseline;
  const double length_m = along.head<2>().norm();
  if (length_m < kLeastShare * baseline.norm() || length_m == 0.0) return;
  fix.heading_sd_deg = config_.heading_sd_deg * (1.0 + 4.0 * cover_ * cover_) / length_m;
  const double heading_deg = std::atan2(along.x(), along.y()) / kDegree;
  fix.heading_deg =
      std::fmod(std::fmod(heading_deg + fix.heading_sd_deg * heading_error_, 360.0) + 360.0, 360.0);
}

}  // namespace understory
