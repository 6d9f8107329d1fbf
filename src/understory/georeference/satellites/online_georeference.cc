#include "understory/georeference/satellites/online_georeference.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/geometry/pose_io.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/sensor/fix_position.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using namespace georeference_constants::interpolation;
using namespace georeference_constants::online_georeference;

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Vector4d plane_sd() {
  return {std::sqrt(0.5), std::sqrt(0.5), kFarM, kFarM};
}

Vector3d height_sd(const OnlineGeoreferenceConfig& config) {
  const double tilt = config.tilt_sd_deg * kDegree;
  return {kFarM, tilt, tilt};
}

Matrix2d turn_by(double angle) {
  return Eigen::Rotation2Dd(angle).toRotationMatrix();
}

// How a point at `place` moves in the frame east, north by a small turn.
Vector2d moved_by_turn(double angle, const Vector2d& place) {
  return turn_by(angle + 0.5 * M_PI) * place;
}

Eigen::Matrix<double, 2, 4> plane_jacobian(const Vector2d& place) {
  Eigen::Matrix<double, 2, 4> jacobian;
  jacobian << place.x(), -place.y(), 1.0, 0.0, place.y(), place.x(), 0.0, 1.0;
  return jacobian;
}

// One kind of receiver with cosine and sine on the unit circle.
struct OnCircle {
  double turn = 0.0;
  Vector2d shift = Vector2d::Zero();
  Matrix3d covariance = Matrix3d::Zero();  // turn, shift
  double log_share = 0.0;                  // of its probability that lies there
};

OnCircle on_circle(const Vector4d& mean, const Matrix4d& covariance, double first_turn) {
  const Matrix2d information = covariance.topLeftCorner<2, 2>().inverse();
  OnCircle found;
  found.turn = first_turn;
  Vector2d along;
  Vector2d off;
  double curvature = 0.0;
  for (int step = 0; step < kCircleSteps; ++step) {
    const Vector2d on(std::cos(found.turn), std::sin(found.turn));
    along = Vector2d(-on.y(), on.x());
    off = on - mean.head<2>();
    curvature = along.dot(information * along);
    const double bent = curvature - on.dot(information * off);
    const double slope = along.dot(information * off);
    found.turn -= std::clamp(slope / (bent > 0.0 ? bent : curvature), -kLongestTurn, kLongestTurn);
  }
  const Eigen::Matrix2d gain = covariance.bottomLeftCorner<2, 2>() * information;
  const double variance = 1.0 / curvature;
  found.shift = mean.tail<2>() + gain * off;
  const Vector2d with_turn = gain * along;
  found.covariance(0, 0) = variance;
  found.covariance.block<2, 1>(1, 0) = variance * with_turn;
  found.covariance.block<1, 2>(0, 1) = variance * with_turn.transpose();
  found.covariance.bottomRightCorner<2, 2>() = covariance.bottomRightCorner<2, 2>() -
                                               gain * covariance.topRightCorner<2, 2>() +
                                               variance * with_turn * with_turn.transpose();
  found.log_share =
      0.5 * (std::log(information.determinant()) + std::log(variance) - off.dot(information * off));
  return found;
}

// A measurement of cosine, sine and shift: value = row * parameters + error.
void measure(const Vector4d& row, double value, double sd, Vector4d& mean, Matrix4d& covariance,
             double& log_weight) {
  const Vector4d spread = covariance * row;
  const double total = row.dot(spread) + sd * sd;
  const double off = value - row.dot(mean);
  log_weight -= 0.5 * (off * off / total + std::log(total));
  mean += spread * (off / total);
  covariance -= spread * spread.transpose() / total;
}

}  // namespace

OnlineGeoreference::OnlineGeoreference(const OnlineGeoreferenceConfig& config)
    : config_(config),
      plane_(config.plane, plane_sd()),
      height_(config.height, height_sd(config)),
      turn_(config.second_antenna) {
  sum_up_height();
}

void OnlineGeoreference::add_fix(const GnssFix& fix, const Vector3d& antenna_in_body,
                                 const std::optional<Vector3d>& second_in_body) {
  if (!has_position(fix)) return;
  Vector3d baseline = Vector3d::Zero();
  if (second_in_body) baseline = *second_in_body - antenna_in_body;
  waiting_.push_back({fix, antenna_in_body, baseline});
  if (waiting_.size() > kMostWaiting) waiting_.pop_front();
}

GlobalPose OnlineGeoreference::add_pose(const StampedPose& pose) {
  const Pose now = odometry_from_world_ * pose.world_from_body;
  if (last_) way_m_ += (now.translation() - last_->world_from_body.translation()).norm();
  const TimeNs shift = from_seconds(config_.time_offset_s);
  while (!waiting_.empty() && waiting_.front().fix.stamp + shift <= pose.stamp) {
    take(waiting_.front(), now, pose.stamp);
    waiting_.pop_front();
  }
  last_ = StampedPose{pose.stamp, now};
  return pose_on_globe(now, pose.stamp);
}

// A fix between the last pose and this one.
void OnlineGeoreference::take(const WaitingFix& waiting, const Pose& odometry_from_body,
                              TimeNs stamp) {
  const TimeNs at = waiting.fix.stamp + from_seconds(config_.time_offset_s);
  const Vector3d antenna = odometry_from_body * waiting.antenna_in_body;
  SatellitePair one;
  one.antenna_in_world = antenna;
  Eigen::Quaterniond rotation = odometry_from_body.rotation();
  if (at < stamp) {
    if (!last_ || at < last_->stamp || to_seconds(stamp - last_->stamp) > kGapS) return;
    const double u = to_seconds(at - last_->stamp) / to_seconds(stamp - last_->stamp);
    one.antenna_in_world =
        (1.0 - u) * (last_->world_from_body * waiting.antenna_in_body) + u * antenna;
    rotation = last_->world_from_body.rotation().slerp(u, rotation);
  }
  const GnssFix& fix = waiting.fix;
  if (std::isfinite(fix.heading_deg)) {
    one.turn_rad = turn_by_heading(fix, rotation * waiting.baseline_in_body);
    one.turn_sd_rad = turn_sd_rad(fix, config_.heading_sd_deg);
  }
  one.has_height = std::isfinite(fix.height_m);
  const GeodeticPlace place{fix.latitude_deg, fix.longitude_deg,
                            one.has_height ? fix.height_m : 0.0};
  if (!origin_) {
    origin_ = place;
    first_fix_ = fix.stamp;
    reference_ = one.antenna_in_world;
  }
  one.time_s = to_seconds(fix.stamp - first_fix_);
  one.fix_in_enu = EastNorthUp(*origin_).from_place(place);
  one.covariance = fix_covariance(fix, config_.covariance);
  one.fixes = 1;
  if (gathered_.fixes() > 0 && one.time_s - gathered_.begin_s() >= config_.interval_s) {
    take(gathered_.mean());
    gathered_ = {};
  }
  gathered_.add(one);
}

void OnlineGeoreference::take(const SatellitePair& pair) {
  const Vector3d antenna = pair.antenna_in_world - reference_;
  const double way_m = way_m_ - way_at_pair_m_;
  way_at_pair_m_ = way_m_;
  ++pairs_;
  if (pair.has_height) take_height(pair, antenna, way_m);
  take_in_plane(pair, levelled(antenna).head<2>(), way_m);
  at_antenna_ = levelled(antenna).head<2>();
  const double off_m =
      (pair.fix_in_enu.head<2>() - plane_jacobian(at_antenna_) * place_.linear).norm();
  outliers_in_a_row_ =
      plane_.last_was_outlier() && off_m > kElsewhereM ? outliers_in_a_row_ + 1 : 0;
  if (outliers_in_a_row_ >= kElsewherePairs) begin_anew();
}

void OnlineGeoreference::take_in_plane(const SatellitePair& pair, const Vector2d& antenna,
                                       double way_m) {
  const double shift = config_.drift_m_per_sqrt_m;
  Matrix4d walk = Matrix4d::Zero();
  walk.diagonal().tail<2>().setConstant(way_m * shift * shift);
  if (place_.heading_known) {
    Vector4d turn;
    turn << -std::sin(place_.turn_rad), std::cos(place_.turn_rad),
        -moved_by_turn(place_.turn_rad, antenna);
    turn *= config_.drift_deg_per_sqrt_m * kDegree * std::sqrt(way_m);
    walk += turn * turn.transpose();
  }
  plane_.add_walk(walk);
  FilterPair<4, 2> filter_pair;
  filter_pair.dt_s = plane_at_s_ ? pair.time_s - *plane_at_s_ : 0.0;
  filter_pair.stated_sd_m = std::sqrt(0.5 * pair.covariance.topLeftCorner<2, 2>().trace());
  filter_pair.jacobian = plane_jacobian(antenna);
  filter_pair.value = pair.fix_in_enu.head<2>();
  plane_.update(filter_pair);
  plane_at_s_ = pair.time_s;
  turn_.add(pair, config_.drift_deg_per_sqrt_m * kDegree * std::sqrt(way_m));
  sum_up_plane(antenna);
}

void OnlineGeoreference::take_height(const SatellitePair& pair, const Vector3d& antenna,
                                     double way_m) {
  const double tilt = config_.drift_deg_per_sqrt_m * kDegree * std::sqrt(way_m);
  const double shift = config_.drift_m_per_sqrt_m;
  Eigen::Matrix<double, 3, 2> turns;
  turns << -antenna.x(), -antenna.y(), 1.0, 0.0, 0.0, 1.0;
  turns *= tilt;
  Matrix3d walk = turns * turns.transpose();
  walk(0, 0) += way_m * shift * shift;
  height_.add_walk(walk);
  FilterPair<3, 1> filter_pair;
  filter_pair.dt_s = height_at_s_ ? pair.time_s - *height_at_s_ : 0.0;
  filter_pair.stated_sd_m = std::sqrt(pair.covariance(2, 2));
  filter_pair.jacobian << 1.0, antenna.x(), antenna.y();
  filter_pair.value(0) = pair.fix_in_enu.z() - antenna.z();
  height_.update(filter_pair);
  height_at_s_ = pair.time_s;
  place_.height_known = true;
  sum_up_height();
}

// The headings join what the positions tell if these do not contradict them.
void OnlineGeoreference::sum_up_plane(const Vector2d& antenna) {
  sum_up_kinds(antenna, false);
  contradicts_headings_ = false;
  if (!turn_.known()) return;
  contradicts_headings_ = contradicts(turn_.turn_rad() - place_.turn_rad, turn_.sd_rad(),
                                      std::sqrt(place_.covariance(0, 0)), config_.second_antenna);
  if (!contradicts_headings_) sum_up_kinds(antenna, true);
}

void OnlineGeoreference::sum_up_kinds(const Vector2d& antenna, bool with_headings) {
  const auto& kinds = plane_.kinds();
  place_.known = true;
  const auto [linear, linear_covariance] = plane_.parameters();
  place_.linear = linear;
  place_.linear_covariance = kCautious * kCautious * linear_covariance;
  const double first_turn = with_headings ? turn_.turn_rad() : std::atan2(linear(1), linear(0));
  std::vector<OnCircle> all;
  double best = -std::numeric_limits<double>::infinity();
  for (const auto& kind : kinds) {
    Vector4d parameters = kind.mean.template head<4>();
    Matrix4d covariance = kind.covariance.template topLeftCorner<4, 4>();
    double log_weight = kind.log_weight;
    if (with_headings) {
      const double c = std::cos(first_turn);
      const double s = std::sin(first_turn);
      measure({-s, c, 0.0, 0.0}, 0.0, turn_.sd_rad(), parameters, covariance, log_weight);
      measure({c, s, 0.0, 0.0}, 1.0, kRadiusSd, parameters, covariance, log_weight);
    }
    all.push_back(on_circle(parameters, covariance, first_turn));
    all.back().log_share += log_weight;
    best = std::max(best, all.back().log_share);
  }
  double total = 0.0;
  Vector3d mean = Vector3d::Zero();
  Matrix3d squares = Matrix3d::Zero();
  for (const OnCircle& one : all) {
    const double weight = std::exp(one.log_share - best);
    Vector3d at;
    at << std::remainder(one.turn - first_turn, 2.0 * M_PI),
        turn_by(one.turn) * antenna + one.shift;
    Matrix3d to_antenna = Matrix3d::Identity();
    to_antenna.block<2, 1>(1, 0) = moved_by_turn(one.turn, antenna);
    total += weight;
    mean += weight * at;
    squares +=
        weight * (to_antenna * one.covariance * to_antenna.transpose() + at * at.transpose());
  }
  mean /= total;
  place_.turn_rad = first_turn + mean(0);
  place_.antenna_in_enu = mean.tail<2>();
  place_.covariance = kCautious * kCautious * (squares / total - mean * mean.transpose());
  place_.heading_known = place_.covariance(0, 0) < std::pow(kMostHeadingDeg * kDegree, 2.0);
}

void OnlineGeoreference::sum_up_height() {
  const auto [mean, covariance] = height_.parameters();
  place_.height = mean;
  place_.height_covariance = covariance;
}

// Of the odometry's frame, a rotation vector.
Vector3d OnlineGeoreference::tilt() const {
  return {place_.height(2), -place_.height(1), 0.0};
}

// A place of the odometry, from the reference, in level axes.
Vector3d OnlineGeoreference::levelled(const Vector3d& point) const {
  return so3_exp(tilt()) * point;
}

GlobalPose OnlineGeoreference::pose_on_globe(const Pose& odometry_from_body, TimeNs stamp) const {
  GlobalPose pose;
  pose.stamp = stamp;
  pose.place = {kNan, kNan, kNan};
  pose.place_sd_m.setConstant(kNan);
  pose.turn_sd_deg.setConstant(kNan);
  if (!place_.known) return pose;
  const Vector3d from_reference = odometry_from_body.translation() - reference_;
  const double walked = (way_m_ - way_at_pair_m_) * std::pow(config_.drift_m_per_sqrt_m, 2.0);
  Vector2d in_plane;
  Vector2d variance;
  place_in_plane(levelled(from_reference).head<2>(), in_plane, variance);
  pose.place_sd_m.head<2>() = (variance.array() + walked).sqrt();
  const Vector3d row(1.0, from_reference.x(), from_reference.y());
  const double up = from_reference.z() + row.dot(place_.height);
  pose.place = EastNorthUp(*origin_).to_place({in_plane.x(), in_plane.y(), up});
  pose.known = true;
  pose.height_known = place_.height_known;
  if (pose.height_known)
    pose.place_sd_m.z() = std::sqrt(row.dot(place_.height_covariance * row) + walked);
  else
    pose.place.height_m = kNan;
  if (place_.heading_known) turn_on_globe(odometry_from_body.rotation(), pose);
  return pose;
}

void OnlineGeoreference::place_in_plane(const Vector2d& at, Vector2d& in_enu,
                                        Vector2d& variance) const {
  if (!place_.heading_known) {
    const Eigen::Matrix<double, 2, 4> jacobian = plane_jacobian(at);
    in_enu = jacobian * place_.linear;
    variance = (jacobian * place_.linear_covariance * jacobian.transpose()).diagonal();
    return;
  }
  in_enu = place_.antenna_in_enu + turn_by(place_.turn_rad) * (at - at_antenna_);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << moved_by_turn(place_.turn_rad, at - at_antenna_), Matrix2d::Identity();
  variance = (jacobian * place_.covariance * jacobian.transpose()).diagonal();
}

void OnlineGeoreference::turn_on_globe(const Eigen::Quaterniond& odometry_from_body,
                                       GlobalPose& pose) const {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(place_.turn_rad, Vector3d::UnitZ()));
  pose.heading_known = true;
  pose.enu_from_body = turn * so3_exp(tilt()) * odometry_from_body;
  // A slope along y is a turn about x, one along x a turn about -y.
  const Matrix3d& slopes = place_.height_covariance;
  Matrix2d tilts;
  tilts << slopes(2, 2), -slopes(1, 2), -slopes(1, 2), slopes(1, 1);
  const Matrix2d in_enu = turn_by(place_.turn_rad) * tilts * turn_by(-place_.turn_rad);
  pose.turn_sd_deg << std::sqrt(in_enu(0, 0)), std::sqrt(in_enu(1, 1)),
      std::sqrt(place_.covariance(0, 0));
  pose.turn_sd_deg /= kDegree;
}

// Heading and place go on from where they were, whatever the new world's tilt.
void OnlineGeoreference::move_world(const Pose& new_world_from_old_world) {
  if (!last_) return;
  const Matrix3d turn = new_world_from_old_world.rotation().toRotationMatrix();
  const double heading = std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
  const Eigen::Quaterniond level(Eigen::AngleAxisd(heading, Vector3d::UnitZ()));
  const Vector3d body = (odometry_from_world_.inverse() * last_->world_from_body).translation();
  const Pose moved(level, new_world_from_old_world * body - level * body);
  odometry_from_world_ = odometry_from_world_ * moved.inverse();
}

void OnlineGeoreference::begin_piece() {
  plane_.forget_parameters(plane_sd());
  height_.forget_parameters(height_sd(config_));
  turn_.forget();
  contradicts_headings_ = false;
  place_ = {};
  sum_up_height();
  gathered_ = {};
  last_.reset();
}

// The fixes are of another place than the first ones were.
void OnlineGeoreference::begin_anew() {
  plane_ = PlaneFilters(config_.plane, plane_sd());
  height_ = HeightFilters(config_.height, height_sd(config_));
  turn_.forget();
  contradicts_headings_ = false;
  origin_.reset();
  plane_at_s_.reset();
  height_at_s_.reset();
  place_ = {};
  sum_up_height();
  gathered_ = {};
  outliers_in_a_row_ = 0;
}

void OnlineGeoreference::save(BinaryWriter& writer) const {
  plane_.save(writer);
  height_.save(writer);
  writer.put(origin_.has_value());
  if (origin_) {
    for (const double value : {origin_->latitude_deg, origin_->longitude_deg, origin_->height_m})
      writer.put(value);
  }
  writer.put(static_cast<std::uint64_t>(waiting_.size()));
  for (const WaitingFix& waiting : waiting_) {
    put_fix(writer, waiting.fix);
    writer.put_doubles(waiting.antenna_in_body.data(), 3);
    writer.put_doubles(waiting.baseline_in_body.data(), 3);
  }
  gathered_.save(writer);
  put_pose(writer, odometry_from_world_);
  put_optional(writer, last_, put_stamped_pose);
  writer.put_doubles(reference_.data(), 3);
  writer.put_doubles(at_antenna_.data(), 2);
  for (const double value :
       {way_m_, way_at_pair_m_, plane_at_s_.value_or(kNan), height_at_s_.value_or(kNan)})
    writer.put(value);
  writer.put(first_fix_);
  writer.put(pairs_);
  writer.put(outliers_in_a_row_);
  turn_.save(writer);
  writer.put(place_.known);
  writer.put(place_.height_known);
}

void OnlineGeoreference::load(BinaryReader& reader) {
  plane_.load(reader);
  height_.load(reader);
  if (reader.get<bool>()) {
    origin_.emplace();
    for (double* value : {&origin_->latitude_deg, &origin_->longitude_deg, &origin_->height_m})
      *value = reader.get<double>();
  }
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    WaitingFix& waiting = waiting_.emplace_back();
    waiting.fix = get_fix(reader);
    reader.get_doubles(waiting.antenna_in_body.data(), 3);
    reader.get_doubles(waiting.baseline_in_body.data(), 3);
  }
  gathered_.load(reader);
  odometry_from_world_ = get_pose(reader);
  last_ = get_optional(reader, get_stamped_pose);
  reader.get_doubles(reference_.data(), 3);
  reader.get_doubles(at_antenna_.data(), 2);
  way_m_ = reader.get<double>();
  way_at_pair_m_ = reader.get<double>();
  for (std::optional<double>* at : {&plane_at_s_, &height_at_s_}) {
    const auto value = reader.get<double>();
    if (std::isfinite(value)) *at = value;
  }
  first_fix_ = reader.get<TimeNs>();
  pairs_ = reader.get<std::uint64_t>();
  outliers_in_a_row_ = reader.get<std::uint64_t>();
  turn_.load(reader);
  // The rest follows from the filters.
  if (reader.get<bool>()) sum_up_plane(at_antenna_);
  place_.height_known = reader.get<bool>();
  sum_up_height();
}

}  // namespace understory
