#pragma once

#include <cstddef>

#include "understory/geometry/pose.h"

namespace understory {

// What matching sums up over points besides the normal equations.
struct MatchCounts {
  double cost = 0.0;
  std::size_t matched = 0;         // points with a match
  double nearest_squared = 0.0;    // sum over matched points, see RegistrationResult::fitness_m2
  double weight = 0.0;             // sum of weights
  double weighted_residual = 0.0;  // sum of weight * squared normalised residual
  double weighted_rows = 0.0;      // sum of weight * rows
  double surface_squared = 0.0;    // sum of weight * squared distance from the surface, m^2

  MatchCounts& operator+=(const MatchCounts& other) {
    cost += other.cost;
    matched += other.matched;
    nearest_squared += other.nearest_squared;
    weight += other.weight;
    weighted_residual += other.weighted_residual;
    weighted_rows += other.weighted_rows;
    surface_squared += other.surface_squared;
    return *this;
  }
};

// A matcher's cost at one pose with its gradient and Hessian with respect to a right perturbation.
struct MatchSums : MatchCounts {
  Vector6d gradient = Vector6d::Zero();
  Matrix6d hessian = Matrix6d::Zero();

  MatchSums& operator+=(const MatchSums& other) {
    MatchCounts::operator+=(other);
    gradient += other.gradient;
    hessian += other.hessian;
    return *this;
  }
};

}  // namespace understory
