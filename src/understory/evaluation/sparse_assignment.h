#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace understory {

// A row may be given one of the columns of its edges. Costs are finite and not negative.
struct AssignmentEdge {
  std::size_t column = 0;
  double cost = 0.0;
};
// Edges of row r: `edges[first[r]]` to `edges[first[r + 1] - 1]`.
struct SparseCosts {
  std::vector<std::size_t> first = {0};  // rows + 1
  std::vector<AssignmentEdge> edges;
  std::size_t columns = 0;
};

inline constexpr std::size_t kNoColumn = std::numeric_limits<std::size_t>::max();

// The one-to-one assignment of rows to columns of least cost, where a row without a column costs
// `unassigned_cost`. Gives the column of each row, kNoColumn without one. Exact: shortest
// augmenting paths with dual variables, over the edges alone (Jonker and Volgenant 1987). A path is
// never longer than `unassigned_cost`, so it stays among near rows and the time grows nearly as the
// edges. Of several best assignments the order of the input takes one.
[[nodiscard]] std::vector<std::size_t> least_cost_assignment(const SparseCosts& costs,
                                                             double unassigned_cost);

}  // namespace understory
