#include "understory/odometry/stems/stem_pacer.h"

#include <algorithm>
#include <cmath>

#include "understory/features/lidar_stems.h"
#include "understory/geometry/pose_io.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::gathered_scan;

StemScan between(const StampedPose& from, const StemScan& to, const Scan& scan, int frame) {
  StemScan result;
  result.positioned = false;
  result.view.frame = frame;
  result.view.stamp = scan.stamp;
  const double share = to_seconds(scan.stamp - from.stamp) / to_seconds(to.view.stamp - from.stamp);
  result.step = to.step;
  result.step.world_from_body =
      interpolate(from.world_from_body, to.step.world_from_body, std::clamp(share, 0.0, 1.0));
  return result;
}

}  // namespace

void describe(ConfigTable& table, StemPaceConfig& config) {
  table.add("longest_gap_s", config.longest_gap_s, {0.0, 10.0}, "s",
            "longest time between positioned scans while the motion is even; 0: every scan is "
            "positioned");
  table.add("tolerance", config.tolerance, {0.0, 1000.0}, "",
            "largest error of scans between, in standard deviations of a match");
}

// Constant acceleration over a gap leads its end four times as far from even motion as its middle.
bool StemPacer::even(const StemScan& last) const {
  if (last.step.status != SparseStepStatus::kTracked || !last.expected) return false;
  const Vector6d off = (last.expected->inverse() * last.step.world_from_body).log();
  const double limit = 4.0 * config_.tolerance;
  // Tilt and height follow from what each view shows of up and ground; they are noise, not motion.
  const Matrix6d& covariance = last.step.covariance;
  const Eigen::Index upright = upright_axis(last.step.up.up_in_body);
  const Eigen::Index one = upright == 0 ? 4 : 3;
  const Eigen::Index other = upright == 2 ? 4 : 5;
  const double shift_variance = covariance(one, one) + covariance(other, other);
  return std::abs(off[upright]) <= limit * std::sqrt(covariance(upright, upright)) &&
         off[one] * off[one] + off[other] * off[other] <= limit * limit * 0.5 * shift_variance;
}

bool StemPacer::due(TimeNs stamp) const {
  if (gathers_)
    return waiting_.back()->end() + from_seconds(0.5 * period_s_) - waiting_.front()->stamp >=
           kWindow;
  if (!last_ || static_cast<int>(waiting_.size()) >= wait_) return true;
  return to_seconds(stamp - last_->stamp) + period_s_ > config_.longest_gap_s;
}

std::vector<StemScan> StemPacer::add(ScanPtr scan, const Rig& rig) {
  const TimeNs stamp = scan->stamp;
  if (waiting_.empty()) gathers_ = !all_have_level_rings(*scan, rig);
  waiting_.push_back(std::move(scan));
  return due(stamp) ? settle(rig) : std::vector<StemScan>();
}

std::vector<StemScan> StemPacer::finish(const Rig& rig) {
  return waiting_.empty() ? std::vector<StemScan>() : settle(rig);
}

// At the end of a recording a part of a window waits; it is gathered as it is.
std::vector<StemScan> StemPacer::settle_gathered(const Rig& rig) {
  const TimeNs stamp = waiting_.back()->stamp;
  const int last_frame = first_frame_ + static_cast<int>(waiting_.size()) - 1;
  GatheredMotion motion = front_end_.gathered_motion(&samples_);
  StemFrontEnd positioned = front_end_;
  StemScan last;
  for (int round = 0; round < kRounds; ++round) {
    positioned = front_end_;
    last = positioned.add(*gather_scans(waiting_, stamp, rig, motion, front_end_.machine_boxes()),
                          last_frame, rig, &samples_);
    if (last.step.status != SparseStepStatus::kTracked) break;
    motion.per_s = positioned.motion_per_s();
  }
  front_end_ = std::move(positioned);
  const StampedPose from =
      last_ ? *last_ : StampedPose{waiting_.front()->stamp, last.step.world_from_body};
  std::vector<StemScan> results;
  for (std::size_t i = 0; i + 1 < waiting_.size(); ++i)
    results.push_back(between(from, last, *waiting_[i], first_frame_ + static_cast<int>(i)));
  results.push_back(std::move(last));
  return results;
}

std::vector<StemScan> StemPacer::settle(const Rig& rig) {
  std::vector<StemScan> results;
  const bool trusted = imu_trust().trusted;
  const int last_frame = first_frame_ + static_cast<int>(waiting_.size()) - 1;
  bool whole = waiting_.size() == 1;
  if (gathers_) {
    results = settle_gathered(rig);
  } else if (!whole) {
    StemFrontEnd trial = front_end_;
    StemScan ahead = trial.add(*waiting_.back(), last_frame, rig, &samples_);
    whole = even(ahead);
    if (whole) {
      for (std::size_t i = 0; i + 1 < waiting_.size(); ++i)
        results.push_back(between(*last_, ahead, *waiting_[i], first_frame_ + static_cast<int>(i)));
      results.push_back(std::move(ahead));
      front_end_ = std::move(trial);
    }
  }
  if (results.empty()) {
    for (std::size_t i = 0; i < waiting_.size(); ++i)
      results.push_back(
          front_end_.add(*waiting_[i], first_frame_ + static_cast<int>(i), rig, &samples_));
  }
  const StemScan& last = results.back();
  wait_ = whole && even(last) ? 2 * wait_ : 1;
  if (last_) {
    const auto scans = static_cast<double>(waiting_.size());
    period_s_ = to_seconds(last.view.stamp - last_->stamp) / scans;
  }
  const auto most = period_s_ > 0.0 ? config_.longest_gap_s / period_s_ : 1.0;
  wait_ = std::clamp(wait_, 1, std::max(1, static_cast<int>(std::min(most, 1000.0))));
  last_ = StampedPose{last.view.stamp, last.step.world_from_body};
  samples_.forget_before(last_->stamp);
  if (trusted && !imu_trust().trusted && log_ != nullptr) {
    log_->warn("imu.untrusted",
               imu_trust().reason +
                   (imu_trust().usable ? "" : "; the rest of the run does without the IMU"));
  }
  first_frame_ = last_frame + 1;
  waiting_.clear();
  return results;
}

void StemPacer::save(BinaryWriter& writer) const {
  UNDERSTORY_CHECK(waiting_.empty());
  front_end_.save(writer);
  samples_.save(writer);
  writer.put(first_frame_);
  writer.put(wait_);
  put_optional(writer, last_, put_stamped_pose);
  writer.put(period_s_);
}

void StemPacer::load(BinaryReader& reader) {
  front_end_.load(reader);
  samples_.load(reader);
  first_frame_ = reader.get<int>();
  wait_ = reader.get<int>();
  last_ = get_optional(reader, get_stamped_pose);
  period_s_ = reader.get<double>();
}

}  // namespace understory
