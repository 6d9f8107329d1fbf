#pragma once

#include <Eigen/Core>
#include <bitset>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// From which sides the surface of a stem was seen, by 10 degrees from east towards north of the
// frame. A side is seen if the surface that faces it holds points.
using SeenSides = std::bitset<36>;

// A few points of one tree, for a look at how well it is measured (P4 figs. 9-12).
struct TreeSheet {
  struct FrontPoint {
    // East and north of the foot of the stem, height above the ground, metres.
    Eigen::Vector3f place = Eigen::Vector3f::Zero();
    bool stem = false;  // near the centre line
    bool own = true;    // of this tree, and not of one beside it; of a full inventory only
  };
  std::size_t tree = 0;           // its place in the list of trees
  std::vector<FrontPoint> front;  // at most one per cube of 4 cm; of a cut none
  // 0.9 to 1.9 m above the ground, metres from the centre line at the point's height.
  std::vector<Eigen::Vector2f> section;
  double section_reach_m = 0.0;  // half the side of the square that `section` comes from
  SeenSides seen;
};

// The points with the least hash values of all that were added: the same whatever the order, and
// spread evenly over all. Each counts once. Memory: twice `most` points.
class PointSample {
 public:
  struct Point {
    std::uint32_t hash = 0;
    std::int8_t x = 0;
    std::int8_t y = 0;
    std::uint16_t z = 0;
    auto operator<=>(const Point&) const = default;  // NOLINT(modernize-use-nullptr)
  };
  explicit PointSample(std::size_t most) : most_(most) {}
  void add(const Point& point) {
    if (full_ && !(point < last_)) return;
    points_.push_back(point);
    if (points_.size() >= 2 * most_) settle();
  }
  // Sorted by their hash values.
  [[nodiscard]] std::vector<Point> take();

 private:
  void settle();

  std::size_t most_;
  std::vector<Point> points_;
  bool full_ = false;
  Point last_;
};

// Sheets by the number of the stem, and from which sides each stem was seen.
struct StemSheets {
  std::vector<TreeSheet> sheets;
  std::vector<SeenSides> seen;
};

// Which stems have a sheet: 3,000 at most, those whose diameters are most in doubt.
[[nodiscard]] std::vector<char> most_doubtful(const std::vector<StemFit>& stems);

// Gathers the sheets of the stems that are most in doubt, while a cloud is run through. The same
// for any order of points. Not thread-safe.
class SheetCollector {
 public:
  // `stems` outlive this; `slices` are in their frame (metres). A stem has a sheet where
  // `with_sheet` is not 0.
  SheetCollector(const std::vector<StemFit>& stems, const std::vector<SlicePoint>& slices,
                 const std::vector<char>& with_sheet);

  // A point of the column around a stem, see TreeColumns; height >= 0.
  void add(std::size_t stem, const Eigen::Vector2d& place, double height_m);

  // By the number of the stem.
  [[nodiscard]] std::vector<TreeSheet> take();
  // Of all stems.
  [[nodiscard]] const std::vector<SeenSides>& seen() const { return seen_; }
  // East and north of the foot, height above the ground of a front point's cube, metres.
  [[nodiscard]] static Eigen::Vector3d cube_middle(const PointSample::Point& point);

 private:
  struct Gathered {
    std::size_t stem = 0;
    PointSample near;  // the centre line
    PointSample around;
    PointSample section;
  };
  void choose(const std::vector<char>& with_sheet);
  void look_at_slices(const std::vector<SlicePoint>& slices);

  const std::vector<StemFit>& stems_;
  std::vector<SeenSides> seen_;
  std::vector<std::int32_t> sheet_of_;  // by stem; -1: none
  std::vector<Gathered> sheets_;
};

}  // namespace understory
