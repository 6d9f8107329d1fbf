#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "understory/forest/point_blocks.h"

namespace understory {

// A point of a cloud (world frame, metres) and when it was measured, seconds of any clock.
struct TimedPoint {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  double time_s = 0.0;
};

// The same points as PointBlocks gives, with their times.
using TimedVisitor = std::function<void(std::span<const TimedPoint>)>;
using TimedBlocks = std::function<void(const TimedVisitor&)>;

// Where the scanner was, by the clock of the points.
class ScannerPath {
 public:
  ScannerPath() = default;  // nowhere
  // Places in the world frame, metres, in order of time.
  explicit ScannerPath(std::vector<TimedPoint> places) : places_(std::move(places)) {}
  [[nodiscard]] bool empty() const { return places_.empty(); }
  // How far away a point was when it was measured, metres; NaN over a second before or after the
  // path.
  [[nodiscard]] double range_m(const TimedPoint& point) const;

 private:
  std::vector<TimedPoint> places_;
};

// What tells from how far each point of a cloud was measured. Without points: nothing does.
struct MeasuredCloud {
  TimedBlocks points;
  ScannerPath path;
};

}  // namespace understory
