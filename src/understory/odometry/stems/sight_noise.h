#pragma once

#include "understory/util/files/binary_io.h"

namespace understory {

// How much of the change of a stem's place from one sight to the next is noise. Noise that is drawn
// anew at each sight is taken back by the next one, so that changes which follow one another
// oppose each other. An error that goes along with the place of the body does not do that.
// The model is a local level with noise, an ARIMA(0,1,1) process [Muth 1960, J. Am. Stat. Assoc.
// 55]. Its changes d have cov(d_k, d_k-1) / var(d) = -t / (1 + t^2). The best estimate of the place
// moves by 1 - t of what is new at each sight: the steady gain of a Kalman filter.
class SightNoise {
 public:
  // `least_noise_m`: with a smaller standard deviation of the noise the newest sight counts alone.
  explicit SightNoise(double least_noise_m) : least_noise_m_(least_noise_m) {}
  // One stem: squares (m^2) of its change at this sight and at the sight before, and the product of
  // both changes. In axes that do not turn.
  void add(double square_m2, double square_before_m2, double product_m2);
  // A view ends: those of long ago count less.
  void end_view();
  // Share of the newest sight, in [kLeastGain, 1]; 1 until enough sights have told.
  [[nodiscard]] double gain() const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  double least_noise_m_;
  double squares_m2_ = 0.0;
  double products_m2_ = 0.0;
  double pairs_ = 0.0;
};

}  // namespace understory
