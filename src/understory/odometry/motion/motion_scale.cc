#include "understory/odometry/motion/motion_scale.h"

#include <algorithm>
#include <cmath>

#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::motion_scale;

}  // namespace

void MotionScale::add(const Eigen::Vector3d& step, const Drive& drive, double duration_s) {
  if (!(duration_s > 0.0)) return;
  window_.moved += step;
  window_.swept += speed_ * duration_s + drive.way;
  window_.time_s += duration_s;
  speed_ += drive.speed;
  if (window_.time_s >= kWindowS) close_window();
}

void MotionScale::close_window() {
  if (last_.time_s > 0.0) {
    const double apart = 0.5 * (last_.time_s + window_.time_s);  // of the windows' middles
    const Eigen::Vector3d by_match =
        (window_.moved / window_.time_s - last_.moved / last_.time_s) / apart;
    const Eigen::Vector3d by_force =
        (window_.swept / window_.time_s - last_.swept / last_.time_s) / apart;
    ++count_;
    sum_by_match_ += by_match;
    sum_by_force_ += by_force;
    products_ += by_match.dot(by_force);
    squares_by_match_ += by_match.squaredNorm();
    squares_by_force_ += by_force.squaredNorm();
  }
  last_ = window_;
  // Only differences of speed count: small numbers keep them exact over a long run.
  last_.swept -= speed_ * last_.time_s;
  speed_.setZero();
  window_ = {};
}

void MotionScale::interrupt() {
  window_ = {};
  last_ = {};
  speed_.setZero();
}

double MotionScale::product() const {
  return count_ == 0 ? 0.0 : products_ - sum_by_match_.dot(sum_by_force_) / count_;
}

double MotionScale::square_by_force() const {
  return count_ == 0 ? 0.0 : squares_by_force_ - sum_by_force_.squaredNorm() / count_;
}

double MotionScale::square_by_match() const {
  return count_ == 0 ? 0.0 : squares_by_match_ - sum_by_match_.squaredNorm() / count_;
}

double MotionScale::scale() const {
  const double square = square_by_force();
  return square > 0.0 ? product() / square : 0.0;
}

double MotionScale::correlation() const {
  const double squares = square_by_force() * square_by_match();
  return squares > 0.0 ? product() / std::sqrt(squares) : 0.0;
}

double MotionScale::spread_m_s2() const {
  return count_ == 0 ? 0.0 : std::sqrt(std::max(0.0, square_by_force()) / count_);
}

void MotionScale::save(BinaryWriter& writer) const {
  for (const auto* v : {&speed_, &window_.moved, &window_.swept, &last_.moved, &last_.swept,
                        &sum_by_match_, &sum_by_force_})
    writer.put_doubles(v->data(), 3);
  for (const double value :
       {window_.time_s, last_.time_s, products_, squares_by_match_, squares_by_force_})
    writer.put(value);
  writer.put(count_);
}

void MotionScale::load(BinaryReader& reader) {
  for (auto* v : {&speed_, &window_.moved, &window_.swept, &last_.moved, &last_.swept,
                  &sum_by_match_, &sum_by_force_})
    reader.get_doubles(v->data(), 3);
  for (double* value :
       {&window_.time_s, &last_.time_s, &products_, &squares_by_match_, &squares_by_force_})
    *value = reader.get<double>();
  count_ = reader.get<int>();
}

}  // namespace understory
