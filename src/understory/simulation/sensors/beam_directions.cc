#include "understory/simulation/sensors/beam_directions.h"

#include <cmath>

namespace understory {

HeadTurn::HeadTurn(double angle_rad) : cosine(std::cos(angle_rad)), sine(std::sin(angle_rad)) {}

Eigen::Matrix3d HeadTurn::matrix() const {
  Eigen::Matrix3d m;
  m << cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0;
  return m;
}

BeamDirections::BeamDirections(const LidarModel& model, double time_ns, double higher_rad) {
  for (std::size_t i = 0; i < model.beams.size(); ++i) {
    const HeadTurn turn(model.beams[i].azimuth_offset_rad);
    const double elevation = model.elevation(i, time_ns) + higher_rad;
    const Eigen::Vector3d direction =
        turn * Eigen::Vector3d(std::cos(elevation), 0.0, std::sin(elevation));
    const Eigen::Vector3d side = turn * Eigen::Vector3d::UnitY();
    x.push_back(direction.x());
    y.push_back(direction.y());
    z.push_back(direction.z());
    near_x.push_back(static_cast<float>(direction.x()));
    near_y.push_back(static_cast<float>(direction.y()));
    near_z.push_back(static_cast<float>(direction.z()));
    near_side_x.push_back(static_cast<float>(side.x()));
    near_side_y.push_back(static_cast<float>(side.y()));
  }
}

}  // namespace understory
