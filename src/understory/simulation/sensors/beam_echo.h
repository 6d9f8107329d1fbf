#pragma once

#include <span>

#include "understory/simulation/scene/scene.h"
#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/site.h"

namespace understory {

// What comes back of one beam, before the receiver has its say.
struct BeamEcho {
  float range_m = 0.0F;
  float energy = 0.0F;  // reflectivity x cosine x share of the beam
  float cosine = 1.0F;  // of the angle of incidence
  int tree = 0;         // whose stem or crown gave most of it, or 0
  Surface surface = Surface::kNone;
};

// What a lidar reports of a beam.
struct BeamReading {
  float range_m = 0.0F;    // 0: no return; a multiple of the range step
  float intensity = 0.0F;  // whole number, 0 to 255
};

// Hits of one beam, at most 64, that lie within a pulse's length merge into one echo, which is
// where mixed returns at edges come from. The strongest is given, and the one after it where
// `second` is.
[[nodiscard]] BeamEcho strongest_echo(std::span<const Hit> hits, double pulse_m, BeamEcho* second);

// What the receiver makes of an echo: threshold, dropouts, noise of range by range, incidence and
// bark, range step, limits of range.
[[nodiscard]] BeamReading read_echo(const BeamEcho& echo, const LidarConfig& config,
                                    CounterNoise noise);

}  // namespace understory
