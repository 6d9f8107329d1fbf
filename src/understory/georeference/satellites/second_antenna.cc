#include "understory/georeference/satellites/second_antenna.h"

#include <algorithm>
#include <cmath>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/angles.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::second_antenna;

double turn_between(double from_rad, double to_rad) {
  return std::remainder(to_rad - from_rad, 2.0 * M_PI);
}

}  // namespace

std::optional<TurnByHeadings> turn_by_headings(const std::vector<SatellitePair>& pairs,
                                               const SecondAntennaConfig& config) {
  std::vector<const SatellitePair*> with;
  for (const SatellitePair& pair : pairs) {
    if (std::isfinite(pair.turn_rad)) with.push_back(&pair);
  }
  if (with.size() < kFewestHeadings) return std::nullopt;
  // Around the direction of the sum of all, so that none lies at the cut of the circle.
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double stated = 0.0;
  for (const SatellitePair* pair : with) {
    sum += Eigen::Vector2d(std::cos(pair->turn_rad), std::sin(pair->turn_rad));
    stated += pair->turn_sd_rad * pair->turn_sd_rad / static_cast<double>(with.size());
  }
  const double about_rad = std::atan2(sum.y(), sum.x());
  std::vector<double> off;
  for (const SatellitePair* pair : with)
    off.push_back(turn_between(about_rad, pair->turn_rad));
  TurnByHeadings found;
  const double middle = upper_median(off);
  for (double& one : off)
    one = std::abs(turn_between(middle, one));
  const double seen = kSdOverMad * upper_median(off);
  const double span_s = with.back()->time_s - with.front()->time_s;
  const double independent = 1.0 + span_s / config.correlation_s;
  found.turn_rad = about_rad + middle;
  found.sd_rad = std::hypot(std::max(seen, std::sqrt(stated)) / std::sqrt(independent),
                            config.baseline_sd_deg * kDegree);
  found.pairs = with.size();
  return found;
}

bool contradicts(double off_rad, double heading_sd_rad, double position_sd_rad,
                 const SecondAntennaConfig& config) {
  return std::abs(std::remainder(off_rad, 2.0 * M_PI)) >
         config.most_sigmas * std::hypot(heading_sd_rad, position_sd_rad);
}

void TurnFilter::add(const SatellitePair& pair, double drift_sd_rad) {
  variance_ += drift_sd_rad * drift_sd_rad;
  if (!std::isfinite(pair.turn_rad)) return;
  const double own = pair.turn_sd_rad * pair.turn_sd_rad;
  const double off = turn_between(turn_rad_, pair.turn_rad);
  const bool far = known_ && std::abs(off) > kFarHeading * std::sqrt(variance_ + own);
  far_off_ = far ? far_off_ + 1 : 0;
  if (far && far_off_ < kMostFarHeadings) return;
  if (!known_ || far) {
    known_ = true;
    far_off_ = 0;
    turn_rad_ = pair.turn_rad;
    variance_ = own;
  } else {
    // Errors that stay alike: so many headings count as one.
    const double step_s = std::max(kShortestStepS, pair.time_s - time_s_);
    const double alike = std::max(1.0, config_.correlation_s / step_s);
    const double gain = variance_ / (variance_ + alike * own);
    turn_rad_ = std::remainder(turn_rad_ + gain * off, 2.0 * M_PI);
    variance_ *= 1.0 - gain;
  }
  time_s_ = pair.time_s;
}

void TurnFilter::forget() {
  *this = TurnFilter(config_);
}

double TurnFilter::sd_rad() const {
  return std::hypot(std::sqrt(variance_), config_.baseline_sd_deg * kDegree);
}

void TurnFilter::save(BinaryWriter& writer) const {
  writer.put(known_);
  for (const double value : {turn_rad_, variance_, time_s_})
    writer.put(value);
  writer.put(far_off_);
}

void TurnFilter::load(BinaryReader& reader) {
  known_ = reader.get<bool>();
  for (double* value : {&turn_rad_, &variance_, &time_s_})
    *value = reader.get<double>();
  far_off_ = reader.get<std::uint64_t>();
}

}  // namespace understory
