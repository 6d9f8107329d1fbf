#include "understory/evaluation/sparse_assignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "understory/util/random.h"

namespace understory {
namespace {

SparseCosts random_costs(Random& random, std::size_t rows, std::size_t columns, double density) {
  SparseCosts costs;
  costs.columns = columns;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      // Some equal costs, so that ties occur.
      const double cost = random.uniform() < 0.3 ? 1.0 : random.uniform(0.0, 2.0);
      if (random.uniform() < density) costs.edges.push_back({column, cost});
    }
    costs.first.push_back(costs.edges.size());
  }
  return costs;
}

// Least cost of the rows from `row` on, trying everything.
double least_by_trial(const SparseCosts& costs, double unassigned, std::size_t row,
                      std::vector<bool>& taken) {
  if (row + 1 == costs.first.size()) return 0.0;
  double least = unassigned + least_by_trial(costs, unassigned, row + 1, taken);
  for (std::size_t k = costs.first[row]; k < costs.first[row + 1]; ++k) {
    const AssignmentEdge& edge = costs.edges[k];
    if (taken[edge.column]) continue;
    taken[edge.column] = true;
    least = std::min(least, edge.cost + least_by_trial(costs, unassigned, row + 1, taken));
    taken[edge.column] = false;
  }
  return least;
}

// Cost of an assignment; checks that it is one.
double assignment_cost(const SparseCosts& costs, const std::vector<std::size_t>& column_of,
                       double unassigned) {
  double sum = 0.0;
  std::set<std::size_t> taken;
  for (std::size_t row = 0; row < column_of.size(); ++row) {
    if (column_of[row] == kNoColumn) {
      sum += unassigned;
      continue;
    }
    EXPECT_TRUE(taken.insert(column_of[row]).second) << "a column was given twice";
    const auto begin = costs.edges.begin() + static_cast<std::ptrdiff_t>(costs.first[row]);
    const auto end = costs.edges.begin() + static_cast<std::ptrdiff_t>(costs.first[row + 1]);
    const auto edge = std::find_if(
        begin, end, [&](const AssignmentEdge& e) { return e.column == column_of[row]; });
    EXPECT_NE(edge, end) << "no edge leads there";
    if (edge != end) sum += edge->cost;
  }
  return sum;
}

TEST(SparseAssignment, CostsAsLittleAsTheBestOfAllAssignments) {
  Random random(3);
  for (int round = 0; round < 400; ++round) {
    const auto rows = static_cast<std::size_t>(random.uniform(0.0, 7.99));
    const auto columns = static_cast<std::size_t>(random.uniform(0.0, 7.99));
    const SparseCosts costs = random_costs(random, rows, columns, random.uniform(0.2, 1.0));
    const double unassigned = random.uniform(0.3, 3.0);
    std::vector<bool> taken(columns, false);
    const double best = least_by_trial(costs, unassigned, 0, taken);
    const auto found = least_cost_assignment(costs, unassigned);
    ASSERT_EQ(found.size(), rows);
    EXPECT_NEAR(assignment_cost(costs, found, unassigned), best, 1e-12) << "round " << round;
  }
}

TEST(SparseAssignment, ARowGivesItsColumnUpWhereThatCostsLess) {
  // Row 0 takes column 0 first; row 1 has no other. Row 2 then drives row 1 out.
  SparseCosts costs;
  costs.columns = 2;
  costs.edges = {{0, 0.1}, {1, 0.3}, {0, 0.2}, {0, 0.0}, {1, 1.9}};
  costs.first = {0, 2, 3, 5};
  const auto found = least_cost_assignment(costs, 1.0);
  EXPECT_EQ(found, (std::vector<std::size_t>{1, kNoColumn, 0}));
}

}  // namespace
}  // namespace understory
