#include "understory/cli/evaluate/evaluate_trees_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "understory/evaluation/alignment.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// With fewer trees a third of them is chance [chosen]
constexpr std::size_t kFewestTrees = 5;

// RMSE and bias, A minus B; null where no pair tells.
void add_differences(nlohmann::ordered_json& json, const TreeErrors& e) {
  json["position_rmse_m"] = e.position_rmse_m;
  json["dbh_rmse_m"] = e.dbh_rmse_m;
  json["dbh_bias_m"] = e.dbh_bias_m;
  json["height_rmse_m"] = e.height_rmse_m;
  json["position_bias_m"] = {e.x_bias_m, e.y_bias_m};
  json["height_bias_m"] = e.height_bias_m;
  json["volume_rmse_m3"] = e.volume_rmse_m3;
  json["volume_bias_m3"] = e.volume_bias_m3;
}

void add_errors(nlohmann::ordered_json& json, const TreeErrors& e) {
  json["trees_a"] = e.trees_a;
  json["trees_b"] = e.trees_b;
  json["matched"] = e.matched;
  json["recall"] = e.recall;
  json["precision"] = e.precision;
  json["overlapping"] = e.overlapping;
  json["overlapping_tree_ratio"] = e.overlapping_tree_ratio;
  add_differences(json, e);
}

// A column of the table of classes.
struct ClassColumn {
  const char* title;
  double TreeErrors::*figure;
  int decimals;
};
constexpr std::array kClassColumns = {
    ClassColumn{"recall", &TreeErrors::recall, 3},
    ClassColumn{"precision", &TreeErrors::precision, 3},
    ClassColumn{"position m", &TreeErrors::position_rmse_m, 3},
    ClassColumn{"diameter m", &TreeErrors::dbh_rmse_m, 4},
    ClassColumn{"its bias m", &TreeErrors::dbh_bias_m, 4},
    ClassColumn{"height m", &TreeErrors::height_rmse_m, 2},
    ClassColumn{"volume m3", &TreeErrors::volume_rmse_m3, 4},
};

// Columns that no class tells are left out, and so are figures that a class does not tell.
std::string classes_text(const std::vector<ErrorsOfClass>& classes) {
  if (classes.empty()) return {};
  constexpr int kWidth = 12;
  std::vector<std::string> lines = {fmt::format("{:<16}{:>8}{:>8}", "diameter, m", "of A", "of B")};
  for (const ErrorsOfClass& each : classes)
    lines.push_back(fmt::format("{:>5.2f} to {:<7.2f}{:>8}{:>8}", each.from_m, each.to_m,
                                each.errors.trees_a, each.errors.trees_b));
  for (const ClassColumn& column : kClassColumns) {
    const auto told = [&](const ErrorsOfClass& each) {
      return std::isfinite(each.errors.*column.figure);
    };
    if (std::none_of(classes.begin(), classes.end(), told)) continue;
    lines[0] += fmt::format("{:>{}}", column.title, kWidth);
    for (std::size_t k = 0; k < classes.size(); ++k)
      lines[k + 1] += fmt::format(
          "{:>{}}",
          told(classes[k]) ? fixed_text(classes[k].errors.*column.figure, column.decimals) : "",
          kWidth);
  }
  std::string text;
  for (const std::string& line : lines)
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  return text;
}

std::string figures_text(const TreeErrors& e) {
  std::string text;
  // What no tree tells is left out: a map of stems has no heights.
  const auto tell = [&](double figure, const std::string& line) {
    if (std::isfinite(figure)) text += line;
  };
  tell(e.recall, fmt::format("recall              {:.4f} (matched share of B)\n", e.recall));
  tell(e.precision, fmt::format("precision           {:.4f} (matched share of A)\n", e.precision));
  tell(e.overlapping_tree_ratio,
       fmt::format("overlapping trees   {:.4f} (share of B whose stem overlaps its partner's)\n",
                   e.overlapping_tree_ratio));
  tell(e.position_rmse_m,
       fmt::format(
           "position            rmse {:.4f} m (horizontal), bias {} m in x, {} m in y (A minus "
           "B)\n",
           e.position_rmse_m, signed_text(e.x_bias_m, 4), signed_text(e.y_bias_m, 4)));
  tell(e.dbh_rmse_m, fmt::format("diameter            rmse {:.4f} m, bias {} m (A minus B)\n",
                                 e.dbh_rmse_m, signed_text(e.dbh_bias_m, 4)));
  tell(e.height_rmse_m, fmt::format("height              rmse {:.4f} m, bias {} m\n",
                                    e.height_rmse_m, signed_text(e.height_bias_m, 4)));
  tell(e.volume_rmse_m3, fmt::format("stem volume         rmse {:.4f} m3, bias {} m3\n",
                                     e.volume_rmse_m3, signed_text(e.volume_bias_m3, 4)));
  return text;
}

}  // namespace

nlohmann::ordered_json comparison_json(const TreeComparison& result, const TreeOptions& options) {
  nlohmann::ordered_json json;
  json["alignment"] = options.alignment;
  json["alignment_found"] = nullptr;
  if (result.b_from_a) {
    const Eigen::Vector3d& t = result.b_from_a->translation();
    json["alignment_found"] = {{"translation_m", {t.x(), t.y(), t.z()}},
                               {"yaw_deg", yaw_deg(*result.b_from_a)},
                               {"rotation_deg", result.b_from_a->angle() * 180.0 / M_PI}};
  }
  json["matching"] = options.matching;
  add_errors(json, result.all);
  for (const ErrorsOfClass& each : result.by_diameter) {
    nlohmann::ordered_json row = {{"from_m", each.from_m}, {"to_m", each.to_m}};
    add_errors(row, each.errors);
    json["by_diameter"].push_back(row);
  }
  if (result.visible) {
    json["visible"] = {
        {"min_returns", options.min_returns},   {"within_m", options.within_m},
        {"expected", result.visible->expected}, {"found", result.visible->found},
        {"recall", result.visible->recall},     {"reported", result.visible->reported},
        {"false", result.visible->false_trees}, {"false_share", result.visible->false_share}};
  }
  if (result.agreement) {
    const MapAgreement& m = *result.agreement;
    json["near_path"] = {{"within_m", options.within_m}, {"trees_a", m.trees_a},
                         {"trees_b", m.trees_b},         {"paired_a", m.paired_a},
                         {"paired_b", m.paired_b},       {"agreement", m.agreement}};
  }
  for (const DistanceRate& rate : result.by_distance) {
    nlohmann::ordered_json row = {{"from_m", rate.from_m},     {"to_m", rate.to_m},
                                  {"expected", rate.expected}, {"found", rate.found},
                                  {"recall", rate.recall},     {"reported", rate.reported},
                                  {"right", rate.right},       {"precision", rate.precision}};
    add_differences(row, rate.errors);
    json["by_distance"].push_back(row);
  }
  if (result.consistency) {
    const MapConsistency& c = *result.consistency;
    json["consistency"] = {{"within_m", options.consistency.within_m},
                           {"pairing_m", options.consistency.pairing_m},
                           {"trees_a", c.trees_a},
                           {"trees_b", c.trees_b},
                           {"as_placed", c.as_placed},
                           {"moved", c.moved},
                           {"parts", c.parts},
                           {"in_parts", c.in_parts}};
  }
  return json;
}

std::string few_pairs_complaint(const TreeErrors& errors, const TreeOptions& options) {
  const std::size_t fewer = std::min(errors.trees_a, errors.trees_b);
  const bool few = fewer < kFewestTrees ? errors.matched == 0 : 3 * errors.matched < fewer;
  if (fewer == 0 || !few) return "";
  return fmt::format("only {} of {} trees match{}", errors.matched, fewer,
                     options.alignment == "none"
                         ? ": A and B may lie in different frames. --align yaw moves A onto B "
                           "first, --radius-m pairs trees farther apart"
                         : ", also where A was moved: the lists may show different stands");
}

std::string comparison_text(const TreeComparison& result, const TreeOptions& options) {
  const TreeErrors& e = result.all;
  std::string text = fmt::format(
      "alignment           {}\n"
      "trees               {} in A, {} in B, {} matched one to one within {:g} m ({})\n",
      options.alignment + (result.b_from_a ? ": moved by " + motion_text(*result.b_from_a) : ""),
      e.trees_a, e.trees_b, e.matched, options.assignment.radius_m,
      options.matching == "optimal" ? "best in position and diameter together" : "nearest first");
  text += figures_text(e) + classes_text(result.by_diameter);
  if (result.visible) {
    const VisibleTreeErrors& v = *result.visible;
    text += fmt::format(
        "visible             {} of {} found ({:.2f} %), {} of {} false ({:.2f} %); within {:g} m "
        "of "
        "the path, at least {} returns\n",
        v.found, v.expected, 100.0 * v.recall, v.false_trees, v.reported, 100.0 * v.false_share,
        options.within_m, options.min_returns);
  }
  if (result.agreement) {
    const MapAgreement& m = *result.agreement;
    text += fmt::format(
        "agreement           {:.2f} % within {:g} m of the path: {} of {} trees of A and {} of {} "
        "of B are paired\n",
        100.0 * m.agreement, options.within_m, m.paired_a, m.trees_a, m.paired_b, m.trees_b);
  }
  for (const DistanceRate& rate : result.by_distance)
    text += fmt::format(
        "{:>3g} to {:>3g} m from the path: {} of {} found ({:.1f} %), {} of {} right{}\n",
        rate.from_m, rate.to_m, rate.found, rate.expected, 100.0 * rate.recall, rate.right,
        rate.reported,
        rate.errors.matched == 0
            ? ""
            : fmt::format("; rmse {:.3f} m in the plane", rate.errors.position_rmse_m) +
                  (std::isfinite(rate.errors.dbh_rmse_m)
                       ? fmt::format(", {:.4f} m of diameter", rate.errors.dbh_rmse_m)
                       : ""));
  if (result.consistency) {
    const MapConsistency& c = *result.consistency;
    text += fmt::format(
        "consistency         {:.1f} % of {} and {} trees within {:g} m of both paths are the same; "
        "{:.1f} % after one motion, {:.1f} % in {} parts\n",
        100.0 * c.as_placed, c.trees_a, c.trees_b, options.consistency.within_m, 100.0 * c.moved,
        100.0 * c.in_parts, c.parts);
  }
  return text;
}

}  // namespace understory
