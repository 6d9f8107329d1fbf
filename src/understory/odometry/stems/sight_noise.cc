#include "understory/odometry/stems/sight_noise.h"

#include <algorithm>
#include <cmath>

#include "understory/odometry/odometry_constants.h"

namespace understory {

using namespace odometry_constants::sight_noise;

void SightNoise::add(double square_m2, double square_before_m2, double product_m2) {
  squares_m2_ += 0.5 * (square_m2 + square_before_m2);
  products_m2_ += product_m2;
  pairs_ += 1.0;
}

void SightNoise::end_view() {
  squares_m2_ *= kKept;
  products_m2_ *= kKept;
  pairs_ *= kKept;
}

double SightNoise::gain() const {
  if (pairs_ < kEnoughPairs || squares_m2_ <= 0.0) return 1.0;
  const double opposed = std::clamp(-products_m2_ / squares_m2_, 0.0, 0.5);
  if (opposed < kLeastOpposed || opposed * squares_m2_ < least_noise_m_ * least_noise_m_ * pairs_)
    return 1.0;
  const double t = (1.0 - std::sqrt(1.0 - 4.0 * opposed * opposed)) / (2.0 * opposed);
  return std::clamp(1.0 - t, kLeastGain, 1.0);
}

void SightNoise::save(BinaryWriter& writer) const {
  writer.put(squares_m2_);
  writer.put(products_m2_);
  writer.put(pairs_);
}

void SightNoise::load(BinaryReader& reader) {
  squares_m2_ = reader.get<double>();
  products_m2_ = reader.get<double>();
  pairs_ = reader.get<double>();
}

}  // namespace understory
