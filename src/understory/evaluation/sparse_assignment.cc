#include "understory/evaluation/sparse_assignment.h"

#include <algorithm>
#include <functional>
#include <queue>
#include <utility>

namespace understory {
namespace {

constexpr std::size_t kNoRow = std::numeric_limits<std::size_t>::max();

class Assigner {
 public:
  Assigner(const SparseCosts& costs, double unassigned_cost)
      : costs_(costs),
        unassigned_cost_(unassigned_cost),
        column_of_(costs.first.size() - 1, kNoColumn),
        columns_(costs.columns) {}

  std::vector<std::size_t> solve() {
    for (std::size_t row = 0; row < column_of_.size(); ++row)
      augment(row);
    return column_of_;
  }

 private:
  struct Column {
    std::size_t row = kNoRow;      // that has it
    double dual = 0.0;             // never positive; 0 while no row has it
    double distance = 0.0;         // of the path that is being sought, reduced cost
    double edge_cost = 0.0;        // of the edge to `row`
    std::size_t from = kNoRow;     // row before it on the path
    double from_cost = 0.0;        // of that edge
    std::size_t round = kNoRow;    // row whose path `distance` belongs to
    std::size_t settled = kNoRow;  // row whose path it was settled for: `distance` is final
  };
  // Where the best path found so far ends: at a column, or at a row that gives its own up.
  struct End {
    double distance = 0.0;
    std::size_t column = kNoColumn;
    std::size_t row = kNoRow;
  };
  using Reached = std::pair<double, std::size_t>;  // distance, column

  // Goes on from `row`; `base` is the distance to it less its own dual.
  void scan(std::size_t row, double base, std::size_t round, End& end) {
    if (const double distance = base + unassigned_cost_; distance < end.distance)
      end = {distance, kNoColumn, row};
    for (std::size_t k = costs_.first[row]; k < costs_.first[row + 1]; ++k) {
      const AssignmentEdge& edge = costs_.edges[k];
      Column& column = columns_[edge.column];
      const double distance = base + edge.cost - column.dual;
      if (column.settled == round) continue;  // rounding must not open it again
      if (column.round == round && column.distance <= distance) continue;
      column.round = round;
      column.distance = distance;
      column.from = row;
      column.from_cost = edge.cost;
      reached_.emplace(distance, edge.column);
    }
  }

  // Gives `row` a column, or leaves it or one of the rows on its path without.
  void augment(std::size_t row) {
    reached_ = {};
    settled_.clear();
    End end{std::numeric_limits<double>::infinity(), kNoColumn, row};
    scan(row, 0.0, row, end);
    while (!reached_.empty()) {
      const auto [distance, index] = reached_.top();
      reached_.pop();
      Column& column = columns_[index];
      if (distance > end.distance) break;
      if (distance > column.distance) continue;  // a shorter way was found since
      if (column.row == kNoRow) {
        end = {distance, index, kNoRow};
        break;
      }
      settled_.push_back(index);
      column.settled = row;
      scan(column.row, distance - (column.edge_cost - column.dual), row, end);
    }
    for (const std::size_t index : settled_)
      columns_[index].dual += std::min(0.0, columns_[index].distance - end.distance);
    hand_over(end, row);
  }

  // Every row on the path takes the column after it.
  void hand_over(const End& end, std::size_t start) {
    std::size_t column = end.column;
    if (end.row != kNoRow) column = std::exchange(column_of_[end.row], kNoColumn);
    // A row that gives its column up lets the row before it on the path take it.
    while (column != kNoColumn) {
      const std::size_t taker = columns_[column].from;
      columns_[column].row = taker;
      columns_[column].edge_cost = columns_[column].from_cost;
      column = std::exchange(column_of_[taker], column);
      if (taker == start) break;
    }
  }

  const SparseCosts& costs_;
  const double unassigned_cost_;
  std::vector<std::size_t> column_of_;  // of each row
  std::vector<Column> columns_;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> reached_;
  std::vector<std::size_t> settled_;
};

}  // namespace

std::vector<std::size_t> least_cost_assignment(const SparseCosts& costs, double unassigned_cost) {
  return Assigner(costs, unassigned_cost).solve();
}

}  // namespace understory
