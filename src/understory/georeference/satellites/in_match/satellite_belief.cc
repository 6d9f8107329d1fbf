#include "understory/georeference/satellites/in_match/satellite_belief.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "understory/geometry/pose_io.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/sensor/fix_position.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using namespace georeference_constants::satellite_belief;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A covariance in other axes, such as that of east, north, up in those of the world.
Matrix3d turned(const Pose& world_from_enu, const Matrix3d& covariance) {
  const Matrix3d rotation = world_from_enu.rotation_matrix();
  return rotation * covariance * rotation.transpose();
}

// The part of a rotation that is about the z axis: its angle, rad, and as a rotation.
double turn_about_up(const Eigen::Quaterniond& rotation) {
  const Matrix3d turn = rotation.toRotationMatrix();
  return std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
}

Eigen::Quaterniond about_up(const Eigen::Quaterniond& rotation) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(turn_about_up(rotation), Vector3d::UnitZ()));
}

double heading_of(const Vector3d& direction) {
  return std::atan2(direction.y(), direction.x());
}

const Vector3d kPlane(1.0, 1.0, 0.0);

// Where the antenna is, and how well that is known.
struct AntennaBelief {
  Vector3d place;
  Matrix3d covariance;
};

// What a fix still says of an antenna that the odometry puts at `by_odometry`, if its own error
// stays. Nothing where that is within what is free, else the edge of that region. Plane and height
// each by itself.
AntennaBelief beyond_free(const AntennaBelief& fix, const Vector3d& by_odometry,
                          const SatelliteBeliefConfig& config) {
  AntennaBelief left = fix;
  const auto free_steps = [&](double sd) {
    return config.free_sd * std::max(0.0, 1.0 - config.followed_sd_m / sd);
  };
  // Of the way from the fix to the odometry that is free: 1 where all of it is. None is where the
  // covariance tells nothing.
  const auto share = [](double free, double steps) {
    if (!(free > 0.0) || !std::isfinite(steps)) return 0.0;
    return free < steps ? free / steps : 1.0;
  };
  const Vector3d off = by_odometry - fix.place;
  const Eigen::Matrix2d plane = fix.covariance.topLeftCorner<2, 2>();
  const double steps = std::sqrt(off.head<2>().dot(plane.inverse() * off.head<2>()));
  const double of_plane = share(free_steps(std::sqrt(0.5 * plane.trace())), steps);
  const double height_sd = std::sqrt(fix.covariance(2, 2));
  const double of_height = share(free_steps(height_sd), std::abs(off.z()) / height_sd);
  left.place += off.cwiseProduct(Vector3d(of_plane, of_plane, of_height));
  if (of_plane < 1.0 && of_height < 1.0) return left;
  left.covariance.topRightCorner<2, 1>().setZero();
  left.covariance.bottomLeftCorner<1, 2>().setZero();
  const double unknown = kUnknownM * kUnknownM;
  if (of_plane == 1.0)
    left.covariance.topLeftCorner<2, 2>() = unknown * Eigen::Matrix2d::Identity();
  if (of_height == 1.0) left.covariance(2, 2) = unknown;
  return left;
}

double plane_distance(const Vector3d& a, const Vector3d& b) {
  return (a - b).head<2>().norm();
}

}  // namespace

void describe(ConfigTable& table, SatelliteBeliefConfig& config) {
  table.add_enum("use", config.use,
                 {{"none", SatellitesInMatch::kNone},
                  {"penalty", SatellitesInMatch::kPenalty},
                  {"prior", SatellitesInMatch::kPrior}},
                 "positions by satellites do nothing while scans are positioned, pull at each "
                 "match, or place each scan without a match");
  table.add_enum("form", config.form,
                 {{"direct", PenaltyForm::kDirect},
                  {"one_point", PenaltyForm::kOnePoint},
                  {"three_points", PenaltyForm::kThreePoints}},
                 "penalty: a term of the pose, a point at the antenna, or points for position, "
                 "gravity and heading");
  table.add_enum("place", config.place,
                 {{"antenna", PenaltyPlace::kAntenna}, {"centre", PenaltyPlace::kCentre}},
                 "penalty: the position pulls at the antenna, or where a pull turns nothing");
  table.add("arm_m", config.arm_m, {0.1, 1000.0}, "m",
            "from the antenna to the points of gravity and heading");
  table.add("scale", config.scale, {1e-6, 1e6}, "",
            "penalty: how much the points of the scan count against the satellites");
  table.add("first_heading_sd_deg", config.first_heading_sd_deg, {0.01, 90.0}, "degrees",
            "heading of the map, one standard deviation, from which on satellites count");
  table.add("first_plane_sd_m", config.first_plane_sd_m, {0.01, 1000.0}, "m",
            "place of the map, one standard deviation, from which on satellites count");
  table.add("gravity_sd_deg", config.gravity_sd_deg, {0.001, 90.0}, "degrees",
            "penalty: standard deviation of the vertical by the IMU");
  table.add("course_way_m", config.course_way_m, {0.1, 1000.0}, "m",
            "way over which the course corrects the heading");
  table.add("course_sd_deg", config.course_sd_deg, {0.1, 180.0}, "degrees",
            "standard deviation of the heading by the course, each scan");
  table.add("oldest_fix_s", config.oldest_fix_s, {0.01, 60.0}, "s",
            "an older position says nothing of a scan");
  table.add("free_sd", config.free_sd, {0.0, 10.0}, "",
            "penalty: a position pulls back to within so many times what its standard deviation "
            "is above followed_sd_m; 0: to where it is");
  table.add("followed_sd_m", config.followed_sd_m, {0.0, 100.0}, "m",
            "penalty: positions up to this standard deviation pull to where they are");
}

SatelliteBelief::SatelliteBelief(const SatelliteBeliefConfig& config, double tilt_sd_deg)
    : config_(config), tilt_sd_deg_(tilt_sd_deg), drift_(config.first_heading_sd_deg * kDegree) {
  begin_stretch();
}

void SatelliteBelief::begin_stretch() {
  OnlineGeoreferenceConfig config;
  config.covariance = config_.covariance;
  config.tilt_sd_deg = tilt_sd_deg_;
  first_.emplace(config);
}

void SatelliteBelief::add_fix(const GnssFix& fix, const Vector3d& antenna_in_body,
                              const std::optional<Vector3d>& second_in_body) {
  if (!has_position(fix)) return;
  antenna_in_body_ = antenna_in_body;
  second_in_body_ = second_in_body;
  if (first_) first_->add_fix(fix, antenna_in_body, second_in_body);
  if (aligned()) waiting_.push_back(fix);
}

bool SatelliteBelief::wants_probe() const {
  return config_.use == SatellitesInMatch::kPenalty && aligned() && since_probe_ == 0;
}

void SatelliteBelief::note_probe(const Pose& alone, const Pose& pulled) {
  drift_.note_pull(alone * antenna_in_body_, pulled * antenna_in_body_);
}

void SatelliteBelief::add_pose(const StampedPose& pose, bool loose) {
  // Also where the scan alone was held too badly to tell: each fifth is matched twice, no more.
  since_probe_ = (since_probe_ + 1) % kProbeEvery;
  drift_.add_pose(pose.world_from_body * antenna_in_body_, loose);
  if (first_) {
    note_course(pose);
    align(first_->add_pose(pose), pose);
  }
  if (last_ && aligned()) take_fixes(pose);
  last_ = pose;
}

// The end of the first stretch: from now on the world lies where it lies.
void SatelliteBelief::align(const GlobalPose& on_globe, const StampedPose& pose) {
  if (!on_globe.heading_known || !on_globe.height_known) return;
  if (!(on_globe.turn_sd_deg.z() <= config_.first_heading_sd_deg)) return;
  if (!(on_globe.place_sd_m.head<2>().maxCoeff() <= config_.first_plane_sd_m)) return;
  origin_ = on_globe.place;
  // Heading and place alone. The IMU has levelled the world better than positions over a short
  // stretch can: there a centimetre on a metre is half a degree.
  const Eigen::Quaterniond turn =
      pose.world_from_body.rotation() * on_globe.enu_from_body.conjugate();
  world_from_enu_ = Pose(about_up(turn), pose.world_from_body.translation());
  if (aligned_at_ == 0) aligned_at_ = pose.stamp;
  first_.reset();
}

// Which way the carrier goes, seen from the body.
void SatelliteBelief::note_course(const StampedPose& pose) {
  const Vector3d here = pose.world_from_body.translation();
  if (!course_from_) course_from_ = pose;
  const Vector3d way = here - course_from_->world_from_body.translation();
  if (way.head<2>().norm() < kCourseStepM) return;
  // On a bend the carrier goes the way that it looks in the middle.
  forward_in_body_ += course_from_->world_from_body.rotation().conjugate() * way.normalized() +
                      pose.world_from_body.rotation().conjugate() * way.normalized();
  course_from_ = pose;
}

void SatelliteBelief::take_fixes(const StampedPose& pose) {
  while (!waiting_.empty() && waiting_.front().stamp <= pose.stamp) {
    const GnssFix fix = waiting_.front();
    waiting_.pop_front();
    if (fix.stamp < last_->stamp) continue;
    const double u = to_seconds(fix.stamp - last_->stamp) / to_seconds(pose.stamp - last_->stamp);
    const Pose body = interpolate(last_->world_from_body, pose.world_from_body, u);
    const bool has_height = std::isfinite(fix.height_m);
    const GeodeticPlace place{fix.latitude_deg, fix.longitude_deg,
                              has_height ? fix.height_m : origin_.height_m};
    Matrix3d covariance = fix_covariance(fix, config_.covariance);
    if (!has_height) covariance(2, 2) = kUnknownM * kUnknownM;
    const Pose& world_from_enu = *world_from_enu_;
    fixes_.push_back({fix.stamp, world_from_enu * EastNorthUp(origin_).from_place(place),
                      turned(world_from_enu, covariance), body});
    fixes_.back().distrust = distrust_of(fixes_.back());
    note_drift(fixes_.back());
    note_heading(fix, fixes_.back());
    forget_fixes();
  }
}

// What the second antenna says against the map is no drift beyond some degrees: then they are
// swapped, or their places are wrong.
void SatelliteBelief::note_heading(const GnssFix& fix, FixOnPath& on_path) const {
  if (!second_in_body_ || !std::isfinite(fix.heading_deg)) return;
  const Vector3d baseline =
      on_path.world_from_body.rotation() * (*second_in_body_ - antenna_in_body_);
  const double sd = std::hypot(turn_sd_rad(fix, kHeadingSdDeg), kBaselineSdDeg * kDegree);
  const double turn = std::remainder(
      turn_by_heading(fix, baseline) + turn_about_up(world_from_enu_->rotation()), 2.0 * M_PI);
  if (!(std::abs(turn) <= kMostTurnDeg * kDegree + kFarSteps * sd)) return;
  on_path.turn_rad = turn;
  on_path.turn_sd_rad = sd;
}

// A fix that has left the path may be as far off again.
void SatelliteBelief::note_drift(FixOnPath& on_path) {
  if (config_.use != SatellitesInMatch::kPenalty) return;  // no path beside that of the fixes
  const double off_m = drift_.add_fix(
      {on_path.fix_in_world, on_path.covariance, on_path.world_from_body * antenna_in_body_});
  const double sd = std::sqrt(on_path.covariance.diagonal().minCoeff());
  on_path.distrust = std::max(on_path.distrust, off_m / sd);
}

// One fix that lies the course's way back is enough.
void SatelliteBelief::forget_fixes() {
  const auto way = [&](const FixOnPath& fix) {
    return plane_distance(fix.fix_in_world, fixes_.back().fix_in_world);
  };
  while (fixes_.size() > 2 && (way(fixes_[1]) > config_.course_way_m || fixes_.size() > kMostFixes))
    fixes_.pop_front();
}

// The odometry knows a short way better than a receiver does: one whose error changes on it is
// worse than it says. Returns the factor for its standard deviation, 1 or more.
double SatelliteBelief::distrust_of(const FixOnPath& fix) const {
  const FixOnPath& before = fixes_.front();
  const auto antenna = [&](const FixOnPath& one) {
    return Vector3d(one.world_from_body * antenna_in_body_);
  };
  const Vector3d way = antenna(fix) - antenna(before);
  const Vector3d off = (fix.fix_in_world - before.fix_in_world - way).cwiseProduct(kPlane);
  const double stated = fix.covariance(0, 0) + before.covariance(0, 0);
  const double sd = std::sqrt(stated + std::pow(kOdometryErrorM, 2.0) +
                              std::pow(kOdometryErrorShare * way.norm(), 2.0));
  const double now = off.norm() > kFarSteps * sd ? off.norm() / sd : 1.0;
  // It is not better again at once.
  const double kept = fixes_.size() > 1 ? kDistrustKept * fixes_[fixes_.size() - 2].distrust : 1.0;
  return std::max({1.0, now, kept});
}

std::optional<PoseBelief> SatelliteBelief::at(const StampedPose& predicted,
                                              const Eigen::Quaterniond& level_from_world) const {
  if (!aligned() || fixes_.empty()) return std::nullopt;
  const FixOnPath& newest = fixes_.back();
  if (is_old(newest, predicted.stamp)) return std::nullopt;
  const Vector3d moved =
      predicted.world_from_body * antenna_in_body_ - newest.world_from_body * antenna_in_body_;
  // The prior leaves gravity to the smoother, which knows it already.
  const bool penalty = config_.use == SatellitesInMatch::kPenalty;
  const double tilt_sd = penalty ? config_.gravity_sd_deg * kDegree : kUnknownRad;
  Vector3d attitude_sd(tilt_sd, tilt_sd, kUnknownRad);
  Eigen::Quaterniond rotation = predicted.world_from_body.rotation();
  if (penalty) rotation = level_from_world * rotation;
  if (std::isfinite(newest.turn_rad)) {
    rotation = Eigen::AngleAxisd(newest.turn_rad, Vector3d::UnitZ()) * rotation;
    attitude_sd.z() = newest.turn_sd_rad;
  } else if (const std::optional<HeadingError> error = heading_error(newest, predicted)) {
    rotation = Eigen::AngleAxisd(error->turn_rad, Vector3d::UnitZ()) * rotation;
    attitude_sd.z() = error->sd_rad * newest.distrust;
  }
  AntennaBelief antenna{newest.fix_in_world + moved,
                        std::pow(newest.distrust, 2.0) * newest.covariance};
  const Vector3d by_odometry = predicted.world_from_body * antenna_in_body_;
  if (penalty) antenna = beyond_free(antenna, by_odometry, config_);
  if (antenna.covariance.diagonal().minCoeff() >= kUnknownM * kUnknownM) return std::nullopt;
  PoseBelief belief;
  belief.target_from_source = Pose(rotation, antenna.place - rotation * antenna_in_body_);
  belief.point_in_source = antenna_in_body_;
  belief.position_covariance = antenna.covariance;
  belief.attitude_covariance = attitude_sd.cwiseAbs2().asDiagonal();
  if (penalty && config_.place == PenaltyPlace::kCentre && has_centre_) {
    // The centre is as far off as the antenna is, but for a turn of the map. The course knows the
    // heading worse than the map does: a sleigh slips by degrees.
    const Vector3d centre = predicted.world_from_body * centre_in_body_;
    const Vector3d arm = centre - by_odometry;
    const Vector3d turn_sd =
        kDegree * Vector3d(config_.gravity_sd_deg, config_.gravity_sd_deg, kMapHeadingDeg);
    belief.point_in_source = centre_in_body_;
    belief.target_from_source =
        Pose(rotation, centre + antenna.place - by_odometry - rotation * centre_in_body_);
    belief.position_covariance +=
        skew(arm) * turn_sd.cwiseAbs2().asDiagonal() * skew(arm).transpose();
  }
  return belief;
}

bool SatelliteBelief::is_old(const FixOnPath& fix, TimeNs now) const {
  return to_seconds(now - fix.stamp) > config_.oldest_fix_s;
}

std::optional<PoseBelief> SatelliteBelief::heading_at(const StampedPose& predicted) const {
  const bool asked =
      config_.use == SatellitesInMatch::kPenalty && config_.form != PenaltyForm::kOnePoint;
  if (!asked || !aligned() || fixes_.empty()) return std::nullopt;
  const FixOnPath& newest = fixes_.back();
  if (is_old(newest, predicted.stamp) || !std::isfinite(newest.turn_rad)) return std::nullopt;
  PoseBelief belief;
  belief.target_from_source = Pose(
      Eigen::AngleAxisd(newest.turn_rad, Vector3d::UnitZ()) * predicted.world_from_body.rotation(),
      predicted.world_from_body.translation());
  belief.attitude_covariance =
      Vector3d(kUnknownRad, kUnknownRad, newest.turn_sd_rad).cwiseAbs2().asDiagonal();
  belief.least_arm_m = kFarArmM;
  return belief;
}

bool SatelliteBelief::holds() const {
  if (!aligned() || fixes_.empty() || !last_) return false;
  const FixOnPath& newest = fixes_.back();
  if (is_old(newest, last_->stamp)) return false;
  const Vector3d off = newest.world_from_body * antenna_in_body_ - newest.fix_in_world;
  const double sd = newest.distrust * std::sqrt(newest.covariance.diagonal().maxCoeff());
  return sd <= kHeldSdM && off.norm() <= kHeldM;
}

void SatelliteBelief::note_match(const Matrix6d& information) {
  centre_in_body_ = centre_of_turning(information);
  has_centre_ = centre_in_body_.norm() < kFarthestCentreM;
}

// By how much the heading has to turn for the carrier to go the way that it goes.
std::optional<SatelliteBelief::HeadingError> SatelliteBelief::heading_error(
    const FixOnPath& newest, const StampedPose& predicted) const {
  const FixOnPath& oldest = fixes_.front();
  const Vector3d way = newest.fix_in_world - oldest.fix_in_world;
  const double most_s = config_.course_way_m / kSlowestCourseMS;
  if (way.head<2>().norm() < config_.course_way_m || forward_in_body_.norm() < 0.5 ||
      to_seconds(newest.stamp - oldest.stamp) > most_s)
    return std::nullopt;
  const Vector3d forward = forward_in_body_.normalized();
  const Vector3d before = oldest.world_from_body.rotation() * forward;
  const Vector3d now = predicted.world_from_body.rotation() * forward;
  const double error = std::remainder(heading_of(way) - heading_of(before + now), 2.0 * M_PI);
  // A carrier that turns, or looks aside, does not go where it looks.
  const double turned = std::remainder(heading_of(now) - heading_of(before), 2.0 * M_PI);
  if (std::abs(error) > kMostSlipDeg * kDegree || std::abs(turned) > kMostBendDeg * kDegree)
    return std::nullopt;
  return HeadingError{error, std::hypot(config_.course_sd_deg * kDegree, turned)};
}

// Its z axis is up from now on: what was laid on it before has its heading and place alone.
void SatelliteBelief::level_world(const Pose& new_world_from_old_world) {
  if (world_from_enu_) {
    const Pose before = *world_from_enu_;
    const Pose moved = new_world_from_old_world * before;
    world_from_enu_ = Pose(about_up(moved.rotation()), moved.translation());
    const Pose new_from_old = *world_from_enu_ * before.inverse();
    drift_.move(new_from_old, Pose());
    for (FixOnPath& fix : fixes_) {
      fix.fix_in_world = new_from_old * fix.fix_in_world;
      fix.covariance = turned(new_from_old, fix.covariance);
    }
    turn_headings(new_from_old, 1.0);
  }
  move_present(new_world_from_old_world);
}

void SatelliteBelief::move_present(const Pose& new_world_from_old_world) {
  if (first_) first_->move_world(new_world_from_old_world);
  const auto move = [&](auto& place) {
    place.world_from_body = new_world_from_old_world * place.world_from_body;
  };
  drift_.move(Pose(), new_world_from_old_world);
  if (last_) move(*last_);
  if (course_from_) move(*course_from_);
  for (FixOnPath& fix : fixes_)
    move(fix);
  turn_headings(new_world_from_old_world, -1.0);
}

// What the bodies' headings lack, where east, north, up (1) or the bodies (-1) were turned.
void SatelliteBelief::turn_headings(const Pose& new_from_old, double sign) {
  for (FixOnPath& fix : fixes_)
    fix.turn_rad += sign * turn_about_up(new_from_old.rotation());
}

void SatelliteBelief::begin_piece() {
  begin_stretch();
  world_from_enu_.reset();
  last_.reset();
  course_from_.reset();
  waiting_.clear();
  fixes_.clear();
  drift_.clear();
  since_probe_ = 0;
}

void SatelliteBelief::save(BinaryWriter& writer) const {
  writer.put(first_.has_value());
  if (first_) first_->save(writer);
  writer.put_doubles(antenna_in_body_.data(), 3);
  put_optional(writer, second_in_body_,
               [](BinaryWriter& to, const Vector3d& place) { to.put_doubles(place.data(), 3); });
  put_optional(writer, last_, put_stamped_pose);
  writer.put_doubles(centre_in_body_.data(), 3);
  writer.put(has_centre_);
  for (const double value : {origin_.latitude_deg, origin_.longitude_deg, origin_.height_m})
    writer.put(value);
  put_optional(writer, world_from_enu_, put_pose);
  writer.put(aligned_at_);
  writer.put_doubles(forward_in_body_.data(), 3);
  put_optional(writer, course_from_, put_stamped_pose);
  writer.put(static_cast<std::uint64_t>(waiting_.size()));
  for (const GnssFix& fix : waiting_)
    put_fix(writer, fix);
  writer.put(static_cast<std::uint64_t>(fixes_.size()));
  for (const FixOnPath& fix : fixes_) {
    writer.put(fix.stamp);
    writer.put_doubles(fix.fix_in_world.data(), 3);
    writer.put_doubles(fix.covariance.data(), 9);
    put_pose(writer, fix.world_from_body);
    writer.put(fix.distrust);
    writer.put(fix.turn_rad);
    writer.put(fix.turn_sd_rad);
  }
  drift_.save(writer);
  writer.put(since_probe_);
}

void SatelliteBelief::load(BinaryReader& reader) {
  begin_stretch();
  reader.get<bool>() ? first_->load(reader) : first_.reset();
  reader.get_doubles(antenna_in_body_.data(), 3);
  second_in_body_ = get_optional(reader, [](BinaryReader& from) {
    Vector3d place;
    from.get_doubles(place.data(), 3);
    return place;
  });
  last_ = get_optional(reader, get_stamped_pose);
  reader.get_doubles(centre_in_body_.data(), 3);
  has_centre_ = reader.get<bool>();
  for (double* value : {&origin_.latitude_deg, &origin_.longitude_deg, &origin_.height_m})
    *value = reader.get<double>();
  world_from_enu_ = get_optional(reader, get_pose);
  aligned_at_ = reader.get<TimeNs>();
  reader.get_doubles(forward_in_body_.data(), 3);
  course_from_ = get_optional(reader, get_stamped_pose);
  waiting_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    waiting_.push_back(get_fix(reader));
  fixes_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    FixOnPath fix;
    fix.stamp = reader.get<TimeNs>();
    reader.get_doubles(fix.fix_in_world.data(), 3);
    reader.get_doubles(fix.covariance.data(), 9);
    fix.world_from_body = get_pose(reader);
    fix.distrust = reader.get<double>();
    fix.turn_rad = reader.get<double>();
    fix.turn_sd_rad = reader.get<double>();
    fixes_.push_back(fix);
  }
  drift_.load(reader);
  since_probe_ = reader.get<int>();
}

}  // namespace understory
