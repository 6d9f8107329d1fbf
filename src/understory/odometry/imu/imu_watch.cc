#include "understory/odometry/imu/imu_watch.h"

#include <cmath>

#include "understory/odometry/imu/imu_sums.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {

ImuTrust ImuWatch::trust() const {
  ImuTrust trust = monitor_.trust();
  trust.on_probation = monitor_.on_probation();
  trust.motion_scale = scale_.scale();
  trust.motion_correlation = scale_.correlation();
  trust.motion_spread_m_s2 = scale_.spread_m_s2();
  trust.motion_windows = scale_.windows();
  trust.without_samples_s = to_seconds(without_);
  return trust;
}

namespace {

MotionScale::Drive drive_of(const std::vector<InertialSample>& samples,
                            const Eigen::Quaterniond& world_from_imu) {
  ImuState state;
  state.world_from_imu = Pose(world_from_imu, Eigen::Vector3d::Zero());
  for (std::size_t i = 1; i < samples.size(); ++i)
    state = step_state(state, samples[i - 1], samples[i], Eigen::Vector3d::Zero());
  return {state.velocity, state.world_from_imu.translation()};
}

}  // namespace

template <class Change>
void ImuWatch::change_standing(TimeNs now, const Change& change) {
  const bool was_trusted = monitor_.trust().trusted;
  const bool was_on_probation = monitor_.on_probation();
  change();
  if (log_ == nullptr) return;
  if (was_trusted && !monitor_.trust().trusted) {
    log_->warn("imu.untrusted",
               monitor_.trust().reason +
                   (!monitor_.usable() ? "; the rest of the run does without the IMU" : ""));
  } else if (!was_on_probation && monitor_.on_probation()) {
    log_->warn("imu.probation",
               "IMU and lidar contradict each other at " + format_seconds(now) +
                   " s: the IMU is left out until it is clear whether it is right");
  } else if (was_on_probation && !monitor_.on_probation()) {
    log_->info("the IMU is used again from " + format_seconds(now) + " s on");
  }
}

void ImuWatch::suspect(TimeNs now) {
  change_standing(now, [&] { monitor_.suspect(now); });
}

void ImuWatch::pass_time(TimeNs now) {
  change_standing(now, [&] { monitor_.pass_time(now); });
}

void ImuWatch::compare(const ImuMatch& from, const ImuMatch& to,
                       const std::vector<InertialSample>& samples) {
  const double duration = to_seconds(to.stamp - from.stamp);
  const Eigen::Quaterniond& first = from.world_from_imu.rotation();
  const Eigen::Quaterniond& second = to.world_from_imu.rotation();
  if (from.stamp != compared_) scale_.interrupt();
  compared_ = to.stamp;
  const Eigen::Vector3d force = mean_force(samples);
  scale_.add(to.world_from_imu.translation() - from.world_from_imu.translation(),
             drive_of(samples, first), duration);
  // Rings on even ground say nothing of the heading: a match that hardly has anything else is no
  // word against the gyroscope.
  const double sigma = std::hypot(from.rotation_sigma_rad, to.rotation_sigma_rad);
  change_standing(to.stamp, [&] {
    if (sigma > odometry_constants::imu_watch::kUncertainTurn) {
      monitor_.leave_out_turn();
    } else {
      monitor_.add_turn(so3_log(first.conjugate() * second), raw_turn(samples), turning(samples),
                        duration);
    }
    monitor_.add_force(first.slerp(0.5, second), force, duration);
  });
}

void ImuWatch::note_samples(bool any, TimeNs from, TimeNs to) {
  const bool silent = !any && usable();
  if (silent && !silent_ && log_ != nullptr) {
    log_->warn("imu.silent", "no IMU between the scans at " + format_seconds(from) + " s and " +
                                 format_seconds(to) +
                                 " s: until it comes back the motion between scans is taken to be "
                                 "even");
  }
  silent_ = silent;
  if (silent) without_ += to - from;
}

void ImuWatch::save(BinaryWriter& writer) const {
  monitor_.save(writer);
  scale_.save(writer);
  writer.put(compared_);
  writer.put(silent_);
  writer.put(without_);
}

void ImuWatch::load(BinaryReader& reader) {
  monitor_.load(reader);
  scale_.load(reader);
  compared_ = reader.get<TimeNs>();
  silent_ = reader.get<bool>();
  without_ = reader.get<TimeNs>();
}

}  // namespace understory
