#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"

namespace understory {

// What the rings of a scan tell of a point.
enum class PointFeature : std::uint8_t {
  kNone,    // nothing that is matched
  kEdge,    // its ring bends sharply there
  kPlane,   // its ring runs smoothly there
  kGround,  // smoothly, and over ground
};

// Points with their features, in parallel; no features where no method asks for them.
struct FeaturePoints {
  Points points;
  std::vector<PointFeature> features;
  std::vector<std::uint8_t> lidars = {};  // which lidar measured each; empty: the first one all
};

}  // namespace understory
