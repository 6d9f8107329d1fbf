#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/evaluation/trees/tree_rates.h"

namespace understory {

// What `evaluate trees` is asked for.
struct TreeOptions {
  std::string a;
  std::string b;
  std::string alignment = "none";
  std::string matching = "optimal";
  TreeAssignmentConfig assignment;
  double class_m = 0.1;
  std::string returns;
  long min_returns = 30;
  std::string path;
  std::string other_path;
  double within_m = 15.0;
  double bin_m = 0.0;
  double reach_m = 40.0;
  MapConsistencyConfig consistency;
  bool json = false;
  bool epochs = false;
  std::string output;  // of --epochs
  bool overwrite = false;
};

// What was found.
struct TreeComparison {
  std::optional<Pose> b_from_a;  // found by --align
  TreeErrors all;
  std::vector<ErrorsOfClass> by_diameter;
  std::optional<VisibleTreeErrors> visible;
  std::optional<MapAgreement> agreement;
  std::vector<DistanceRate> by_distance;
  std::optional<MapConsistency> consistency;
};

// As one JSON object; NaN becomes null.
[[nodiscard]] nlohmann::ordered_json comparison_json(const TreeComparison& result,
                                                     const TreeOptions& options);
// Why the figures mean little, and what to try, where fewer than a third of the shorter list found
// a partner, or none. Empty else.
[[nodiscard]] std::string few_pairs_complaint(const TreeErrors& errors, const TreeOptions& options);
// As lines for a terminal; what no tree tells is left out.
[[nodiscard]] std::string comparison_text(const TreeComparison& result, const TreeOptions& options);

}  // namespace understory
