#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"

namespace understory {

// Finds where a view of stems was seen before, without any guess. It compares the triangles that
// neighbouring stems form, with the heights of their corners against each other. All lengths are in
// L0, the mean neighbour distance of the stand, so that nothing is tuned to a site.
struct TreePatternConfig {
  int neighbours = 4;         // triangles are made of a stem and two of this many nearest
  double longest_side = 4.0;  // L0; longer sides are left out
  double tolerance = 0.035;   // L0; sides and heights of the same triangle agree that well
  double vote_cell = 1.0;     // L0; triangles that agree on the place within it vote together
  int triangles = 250;        // of a view, about, that are asked for
  int candidates = 3;         // places handed on to be verified
};
void describe(ConfigTable& table, TreePatternConfig& config);

// A place whose pattern of trees is like that of a query.
struct PatternCandidate {
  int place = 0;
  Pose place_from_query;  // level frames: yaw and translation
  int votes = 0;          // triangles that agree
};

// A library of places: level views (z up) in the order of the recording. Lookups are thread-safe.
class TreePatterns {
 public:
  TreePatterns(double l0_m, const TreePatternConfig& config) : l0_m_(l0_m), config_(config) {}

  // `id` ascends from call to call.
  void add(int id, const SparsePoints& level_points);
  // To be called once, after the last place.
  void finish();
  // Places with ids below `before`, best first.
  [[nodiscard]] std::vector<PatternCandidate> find(const SparsePoints& level_points,
                                                   int before) const;
  [[nodiscard]] std::size_t triangles() const { return entries_.size(); }

 private:
  struct Triangle {
    std::array<double, 5> shape;  // sides, longest first; heights of corners 1, 2 above corner 0
    std::array<int, 3> corner;    // corner 0 faces the longest side, and so on
    bool clockwise = false;
  };
  struct Entry {
    std::uint64_t key = 0;
    std::array<float, 5> shape{};
    std::int32_t place = 0;  // index into places_
    std::array<std::uint16_t, 3> corner{};
  };
  class Poll;
  [[nodiscard]] std::vector<std::array<int, 3>> corner_sets(const SparsePoints& points) const;
  [[nodiscard]] std::vector<Triangle> triangles_of(const SparsePoints& points) const;
  [[nodiscard]] static std::uint64_t key_of(const std::array<int, 5>& cell, bool clockwise);

  double l0_m_;
  TreePatternConfig config_;
  std::vector<Entry> entries_;        // sorted by key, which is scattered over all its bits
  std::vector<std::uint32_t> first_;  // of the entries whose keys begin with the same 16 bits
  struct Place {
    int id = 0;
    std::vector<Eigen::Vector3f> points;
  };
  std::vector<Place> places_;
};

}  // namespace understory
