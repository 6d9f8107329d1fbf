#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "understory/forest/stem_constants.h"

namespace understory {

// The points of a list that are still there, for a list from which points are taken until none is
// left. Each call takes time by the logarithm of the list's length.
class LivePoints {
 public:
  explicit LivePoints(std::size_t count);

  // Points that are left.
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool holds(std::uint32_t i) const { return alive_[i] != 0; }
  // Index of the point before which `k` others are left; k < size().
  [[nodiscard]] std::uint32_t at(std::size_t k) const;
  // Takes one away that is there.
  void remove(std::uint32_t i);
  void clear() { size_ = 0; }

 private:
  std::vector<char> alive_;
  std::vector<std::uint32_t> sums_;  // Fenwick tree of `alive_`, from 1
  std::size_t size_;
};

// Points of a plane (metres) sorted into square cells: those near a place are found, and taken
// away, without looking at all.
class CellIndex {
 public:
  using Points = std::vector<Eigen::Vector2f>;
  using Range = std::pair<std::uint32_t, std::uint32_t>;  // of `point`, without its end

  // Cells of `cell_m` that begin at `low`, which no live point of `points` lies below.
  CellIndex(const Points& points, const LivePoints& live, const Eigen::Vector2f& low, float cell_m);

  // The points of all cells that touch the square around `centre`, in order of rows, then columns;
  // returns how many they are.
  std::uint32_t square(const Eigen::Vector2f& centre, float reach,
                       std::vector<Range>& ranges) const;
  // The points in cells that touch the ring between `inner` and `outer`; returns how many lie in
  // cells wholly within `inner`.
  std::uint32_t ring(const Eigen::Vector2f& centre, float inner, float outer,
                     std::vector<Range>& ranges) const;
  // A point of a range, and its index in the list.
  [[nodiscard]] const Eigen::Vector2f& point(std::uint32_t i) const { return sorted_[i]; }
  [[nodiscard]] std::uint32_t id(std::uint32_t i) const { return ids_[i]; }

  // Forgets the points of the square around `centre` that are no longer live; returns how many
  // points it looked at. What is not live must be forgotten before the next question.
  std::size_t forget(const LivePoints& live, const Eigen::Vector2f& centre, float reach);

 private:
  // Short ones stand here, where the compiler makes no calls of them: they are half of the search.
  [[nodiscard]] int column(float x) const {
    return static_cast<int>(std::floor((x - low_.x()) / cell_m_));
  }
  [[nodiscard]] int row(float y) const {
    return static_cast<int>(std::floor((y - low_.y()) / cell_m_));
  }
  [[nodiscard]] std::size_t stretch_of(int r, int c) const {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(stretches_) +
           static_cast<std::size_t>(c / stem_constants::circle_search::kStretch);
  }
  [[nodiscard]] std::size_t begin_of(int r, int c) const {
    constexpr int kStretch = stem_constants::circle_search::kStretch;
    return stretch_of(r, c) * (kStretch + 1) + static_cast<std::size_t>(c % kStretch);
  }
  std::uint32_t add_cells(int r, int c0, int c1, std::vector<Range>* ranges) const;
  std::size_t compact(std::size_t stretch, const LivePoints& live);

  float cell_m_;
  Eigen::Vector2f low_;
  int columns_ = 0;
  int rows_ = 0;
  int stretches_ = 0;  // of a row: points move up within a stretch where others are forgotten
  std::vector<std::uint32_t> begin_;  // of the cells of each stretch, and the end of its last
  Points sorted_;
  std::vector<std::uint32_t> ids_;
};

}  // namespace understory
