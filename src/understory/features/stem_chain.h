#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/features/stem_section.h"

namespace understory {

// A centre line in the level frame: x and y at `base_m`, and what they gain per metre of height.
struct StemLine {
  double base_m = 0.0;
  Eigen::Vector4d state = Eigen::Vector4d::Zero();  // x, y, slope of x, slope of y
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();

  [[nodiscard]] Eigen::Vector2d at(double height_m) const {
    return state.head<2>() + (height_m - base_m) * state.tail<2>();
  }
  // Error of the place at a height.
  [[nodiscard]] Eigen::Matrix2d covariance_at(double height_m) const;
};

// Sections that lie on one upright line.
struct StemChain {
  std::vector<int> sections;  // indices, from the lowest up
  StemLine line;
  double radius_m = 0.0;
  double radius_sd_m = 0.0;
  double misfit = 0.0;  // root mean square of the sections' distances in standard deviations
  int passed = 0;       // levels between lowest and highest whose beams went past the place
  int hits = 0;         // ... that hit something there which is no section of the chain
  int hidden = 0;
  int blank = 0;  // ... that have no beam there
};

// What is known of stems before a frame is looked at. Metres; slopes as tangents.
struct StemChainConfig {
  double slope_sd = 0.06;        // of the stems against up, about 3 degrees
  double usual_radius_m = 0.08;  // of the stems, until their own widths are known
  double radius_spread_m = 0.04;
};

// Gathers sections into chains, the richest sections first; each serves one chain. Deterministic.
[[nodiscard]] std::vector<StemChain> chain_sections(const SectionView& view,
                                                    const StemChainConfig& config);

// The chain's radius from the widths of its sections and of the beams that passed between them, and
// from what is usual. Then its line by robust least squares from the centres that follow. The
// surface that beams hit lies before the centre by pi/4 of the radius in the mean over the width
// (P1 figure 11).
void fit_chain(const SectionView& view, const StemChainConfig& config, StemChain& chain);

// The chain's radius from its own widths alone, and its error; a radius of 0 where none shows one.
// Only sections between the heights given count.
struct OwnRadius {
  double radius_m = 0.0;
  double sd_m = 0.0;
  int sections = 0;
  double spacing_m = 0.0;  // between returns, mean
};
[[nodiscard]] OwnRadius own_radius(const SectionView& view, const StemChain& chain,
                                   double from_m = -1e9, double to_m = 1e9);

}  // namespace understory
