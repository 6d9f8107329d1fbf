#include "understory/recording/messages/imu_unit.h"

namespace understory {
namespace {

constexpr double kMetresPerG = 9.80665;  // m/s^2
// Between these a mean is one of multiples of gravity [chosen].
constexpr double kLeastInG = 0.5;
constexpr double kMostInG = 2.0;

}  // namespace

bool ImuUnit::judge(double mean_specific_force) {
  const bool in_g = mean_specific_force > kLeastInG && mean_specific_force < kMostInG;
  scale_ = in_g ? kMetresPerG : 1.0;
  text_ = in_g ? "accelerations in g, converted to m/s^2; rad/s" : "m/s^2, rad/s";
  return in_g;
}

void ImuUnit::save(BinaryWriter& writer) const {
  writer.put(scale_);
  writer.put(text_);
}

void ImuUnit::load(BinaryReader& reader) {
  scale_ = reader.get<double>();
  text_ = reader.get_string();
}

}  // namespace understory
