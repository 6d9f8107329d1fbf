#pragma once

#include <Eigen/Core>
#include <array>

#include "understory/simulation/stand/stand.h"

namespace understory {

// Wind that sways trees. Each swings at its own pace, mostly along the wind, and leans with the
// gusts, which travel through the stand. The pace is the natural frequency of a conifer of its
// diameter and height (Moore and Maguire 2004, Trees 18: 0.0948 + 3.4317 dbh / height^2 hertz, cm
// and m). A function of the time alone; thread-safe.
class Wind {
 public:
  // sway_m: standard deviation along the wind of the top of a tree of 15 m; others sway in
  // proportion to their height.
  explicit Wind(double sway_m) : sway_m_(sway_m) {}

  [[nodiscard]] bool still() const { return sway_m_ <= 0.0; }

  // What is of a tree's own.
  struct Sway {
    double top_m = 0.0;  // standard deviation of its top along the wind
    double rate_rad_s = 1.0;
    double lag_s = 0.0;  // gusts come so much later than at the origin
    std::array<double, 4> phases_rad{};
  };
  [[nodiscard]] Sway sway_of(const GrownTree& tree) const;

  // Where the top is, east and north of its place in still air, metres; and its velocity, m/s.
  [[nodiscard]] static Eigen::Vector2d top(const Sway& sway, double time_s);
  [[nodiscard]] static Eigen::Vector2d top_velocity(const Sway& sway, double time_s);

 private:
  double sway_m_;
};

// Height above the foot below which a stem does not yield: a fifth of the height, or the lowest
// joint from there up. Above it the stem bends over in proportion to the height.
constexpr double kStiffShare = 0.2;  // of the height
[[nodiscard]] double stiff_height(const GrownTree& tree);

}  // namespace understory
