#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "understory/cli/command.h"
#include "understory/cli/evaluate/evaluate_map.h"
#include "understory/cli/evaluate/evaluate_trees.h"
#include "understory/cli/suggestion.h"
#include "understory/evaluation/prism_errors.h"
#include "understory/evaluation/trajectory_errors.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct EvaluateOptions {
  std::string estimate;
  std::string truth;
  std::string alignment = "none";
  double tolerance_s = 0.01;
  std::vector<double> deltas_m = {10.0};
  std::vector<double> prism_m;  // three numbers, or none
  bool json = false;
};

// The velocities beside a trajectory, empty if there are none.
std::vector<StampedVelocity> velocities_beside(const std::string& given, Log& log) {
  const fs::path path(given);
  if (!fs::is_directory(path)) return {};
  for (const char* name : {"states.csv.gz", "velocity.csv"}) {
    if (!fs::exists(path / name)) continue;
    try {
      return read_velocities(path / name);
    } catch (const InputError& error) {
      log.warn("evaluate.velocity", std::string("velocities are left out: ") + error.what());
    }
  }
  return {};
}

Json motion_json(const Pose& truth_from_estimate) {
  const Eigen::Vector3d& t = truth_from_estimate.translation();
  return {{"translation_m", {t.x(), t.y(), t.z()}},
          {"yaw_deg", yaw_deg(truth_from_estimate)},
          {"rotation_deg", truth_from_estimate.angle() * 180.0 / M_PI}};
}

// Figures that the positions do not determine, and why.
std::vector<std::string> notes_on(const TrajectoryErrors& errors) {
  std::vector<std::string> notes;
  if (!errors.alignment_determined)
    notes.push_back(fmt::format(
        "the rotation of the {} alignment is not determined: the positions lie in one place or "
        "nearly on a line{}. Rotation errors and velocities then mean nothing",
        to_string(errors.alignment),
        std::isfinite(errors.alignment_sd_deg)
            ? fmt::format(" (it is off by some {:.1f} deg)", errors.alignment_sd_deg)
            : ""));
  if (!errors.scale_percent)
    notes.emplace_back("the scale is not determined: a path stays within decimetres");
  return notes;
}

// Null where a figure is not determined.
Json to_json(const TrajectoryErrors& errors, const std::optional<Eigen::Vector3d>& velocity) {
  Json json;
  json["pairs"] = errors.pairs;
  json["alignment"] = to_string(errors.alignment);
  json["alignment_found"] = nullptr;
  if (errors.alignment != Alignment::kNone) {
    json["alignment_found"] = motion_json(errors.truth_from_estimate);
    json["alignment_found"]["rotation_sd_deg"] = errors.alignment_sd_deg;
    json["alignment_found"]["determined"] = errors.alignment_determined;
  }
  json["length_m"] = errors.length_m;
  json["ape_rmse_m"] = errors.ape_rmse_m;
  json["ape_plane_rmse_m"] = errors.ape_plane_rmse_m;
  json["ape_mean_m"] = errors.ape_mean_m;
  json["ape_median_m"] = errors.ape_median_m;
  json["ape_max_m"] = errors.ape_max_m;
  json["ape_rotation_rmse_deg"] = nullptr;
  if (errors.alignment_determined) json["ape_rotation_rmse_deg"] = errors.ape_rotation_rmse_deg;
  json["drift_end_m"] = errors.drift_end_m;
  json["drift_plane_m"] = errors.drift_plane_m;
  json["drift_percent"] = errors.drift_percent;
  json["scale_percent"] = nullptr;
  if (errors.scale_percent) json["scale_percent"] = *errors.scale_percent;
  json["rpe"] = Json::array();
  for (const RelativeError& rpe : errors.rpe) {
    json["rpe"].push_back({{"delta_m", rpe.delta_m},
                           {"translation_rmse_m", rpe.translation_rmse_m},
                           {"translation_percent", rpe.translation_percent},
                           {"rotation_rmse_deg", rpe.rotation_rmse_deg}});
  }
  json["segments"] = Json::array();
  for (const SegmentError& segment : errors.segments) {
    json["segments"].push_back({{"length_m", segment.length_m},
                                {"translation_percent", segment.translation_percent},
                                {"translation_plane_percent", segment.translation_plane_percent},
                                {"rotation_deg_per_m", segment.rotation_deg_per_m}});
  }
  json["velocity_rmse_m_s"] = nullptr;
  if (velocity) json["velocity_rmse_m_s"] = {velocity->x(), velocity->y(), velocity->z()};
  json["notes"] = notes_on(errors);
  return json;
}

std::string steps_text(const TrajectoryErrors& e) {
  std::string text;
  for (const RelativeError& rpe : e.rpe) {
    text += rpe.pairs == 0
                ? fmt::format("RPE over {:g} m       no pair: the estimate's path is shorter\n",
                              rpe.delta_m)
                : fmt::format(
                      "RPE over {:g} m       rmse {:.4f} m = {:.4f} %, rotation rmse {:.4f} "
                      "deg ({} pairs)\n",
                      rpe.delta_m, rpe.translation_rmse_m, rpe.translation_percent,
                      rpe.rotation_rmse_deg, rpe.pairs);
  }
  for (const SegmentError& s : e.segments) {
    text += fmt::format(
        "segments of {:>3g} m   {:.4f} %, in the plane {:.4f} %, rotation {:.6f} deg/m ({} "
        "segments)\n",
        s.length_m, s.translation_percent, s.translation_plane_percent, s.rotation_deg_per_m,
        s.segments);
  }
  return text;
}

std::string to_text(const TrajectoryErrors& e, const std::optional<Eigen::Vector3d>& velocity,
                    double tolerance_s) {
  std::string text = fmt::format(
      "alignment           {}\npairs               {} within {} s, {:.1f} % of the truth's time\n"
      "length of truth     {:.3f} m\n"
      "APE                 rmse {:.4f} m, in the plane {:.4f} m, mean {:.4f} m, median {:.4f} m, "
      "max {:.4f} m, rotation {}\n"
      "drift at the end    {:.4f} m{} (first pose aligned; x {}, y {}, z {} m; in the plane "
      "{:.4f} m)\n"
      "scale of the path   {}\n",
      e.alignment == Alignment::kNone
          ? "none (positions as they are)"
          : to_string(e.alignment) + ": moved by " + motion_text(e.truth_from_estimate),
      e.pairs, tolerance_s, 100.0 * e.covered, e.length_m, e.ape_rmse_m, e.ape_plane_rmse_m,
      e.ape_mean_m, e.ape_median_m, e.ape_max_m,
      e.alignment_determined ? fmt::format("rmse {:.4f} deg", e.ape_rotation_rmse_deg)
                             : "not determined",
      e.drift_end_m,
      std::isfinite(e.drift_percent) ? fmt::format(" = {:.4f} %", e.drift_percent) : "",
      signed_text(e.drift_end.x(), 4), signed_text(e.drift_end.y(), 4),
      signed_text(e.drift_end.z(), 4), e.drift_plane_m,
      e.scale_percent ? signed_text(*e.scale_percent, 4) + " %" : "not determined");
  text += steps_text(e);
  text += velocity ? fmt::format("velocity            rmse x {:.4f}, y {:.4f}, z {:.4f} m/s\n",
                                 velocity->x(), velocity->y(), velocity->z())
          : e.alignment_determined
              ? "velocity            not compared: both folders need velocities\n"
              : "velocity            not compared: the alignment is not determined\n";
  return text;
}

void warn_of_doubts(const TrajectoryErrors& errors, Log& log) {
  if (errors.covered < 0.95) {
    log.warn("evaluate.coverage",
             fmt::format("only {:.1f} % of the truth's time is covered by the estimate",
                         100.0 * errors.covered));
  }
  for (const std::string& note : notes_on(errors))
    log.warn("evaluate.alignment", note);
}

// Of paths as they lie: errors of metres that a motion of the whole path takes away.
void warn_of_frames(const Trajectory& estimate, const Trajectory& truth, EvaluationOptions settings,
                    const TrajectoryErrors& errors, Log& log) {
  constexpr double kApartM = 1.0;  // less is an error of the place on the globe [chosen]
  constexpr double kLeft = 0.1;    // share of the error that is left once moved [chosen]
  if (errors.alignment != Alignment::kNone || errors.ape_rmse_m < kApartM) return;
  settings.alignment = Alignment::kSe3;
  const auto moved = evaluate_trajectory(estimate, truth, settings);
  if (!moved || moved->ape_rmse_m > kLeft * errors.ape_rmse_m) return;
  log.warn(
      "evaluate.frames",
      fmt::format("the paths lie {:.2f} m apart as they are, and {:.3f} m once the estimate is "
                  "moved as a whole: their frames may differ. --align se3 moves it first",
                  errors.ape_rmse_m, moved->ape_rmse_m));
}

Json to_json(const PrismErrors& errors) {
  Json json;
  json["pairs"] = errors.pairs;
  json["alignment_found"] = nullptr;
  if (errors.alignment != Alignment::kNone)
    json["alignment_found"] = motion_json(errors.truth_from_estimate);
  json["ape_rmse_m"] = errors.ape_rmse_m;
  json["ape_plane_rmse_m"] = errors.ape_plane_rmse_m;
  json["ape_mean_m"] = errors.ape_mean_m;
  json["ape_median_m"] = errors.ape_median_m;
  json["ape_max_m"] = errors.ape_max_m;
  return json;
}

// Against the places of a prism, which have no attitude.
int evaluate_places(const EvaluateOptions& options, CommandContext& context) {
  const fs::path file = file_in_folder(options.truth, "total_station.csv");
  const Trajectory estimate = read_trajectory(file_in_folder(options.estimate, "trajectory.tum"));
  const std::vector<StampedPoint> truth = read_points(file);
  const Eigen::Vector3d arm(options.prism_m[0], options.prism_m[1], options.prism_m[2]);
  const auto errors = evaluate_prism(estimate, truth, arm, alignment_from_name(options.alignment),
                                     options.tolerance_s);
  if (!errors) {
    throw InputError(file.string(), "",
                     fmt::format("expected places within {} s of the estimate's poses, which run "
                                 "from {} to {} s",
                                 options.tolerance_s, format_seconds(estimate.front().stamp),
                                 format_seconds(estimate.back().stamp)));
  }
  if (!errors->alignment_determined) {
    context.log.warn("evaluate.alignment",
                     "the prism's places do not fix the " + options.alignment + " alignment");
  }
  const std::string text =
      options.json
          ? to_json(*errors).dump(2) + "\n"
          : fmt::format(
                "alignment           {}\npairs               {} within {} s\nAPE of the prism    "
                "rmse {:.4f} m, in the plane {:.4f} m, mean {:.4f} m, median {:.4f} m, max {:.4f} "
                "m\n",
                errors->alignment == Alignment::kNone
                    ? "none"
                    : to_string(errors->alignment) + ": moved by " +
                          motion_text(errors->truth_from_estimate),
                errors->pairs, options.tolerance_s, errors->ape_rmse_m, errors->ape_plane_rmse_m,
                errors->ape_mean_m, errors->ape_median_m, errors->ape_max_m);
  std::fputs(text.c_str(), stdout);
  return kExitDone;
}

int evaluate(const EvaluateOptions& options, CommandContext& context) {
  if (options.estimate.empty() || options.truth.empty()) {
    throw ConfigError({"understory evaluate needs ESTIMATE and TRUTH (files or folders)"});
  }
  for (const std::string& path : {options.estimate, options.truth})
    refuse_unmapped(path);
  refuse_lists_of_trees(options.estimate, options.truth);
  if (!options.prism_m.empty()) return evaluate_places(options, context);
  EvaluationOptions settings;
  settings.alignment = alignment_from_name(options.alignment);
  settings.tolerance_s = options.tolerance_s;
  settings.rpe_deltas_m = options.deltas_m;
  const fs::path estimate_file = file_in_folder(options.estimate, "trajectory.tum");
  const Trajectory estimate = read_trajectory(estimate_file);
  const Trajectory truth = read_trajectory(file_in_folder(options.truth, "trajectory.tum"));
  const auto errors = evaluate_trajectory(estimate, truth, settings);
  if (!errors) {
    throw InputError(
        estimate_file.string(), "",
        fmt::format("expected poses within {} s of those of the truth; the estimate "
                    "runs from {} to {} s, the truth from {} to {} s",
                    options.tolerance_s, format_seconds(estimate.front().stamp),
                    format_seconds(estimate.back().stamp), format_seconds(truth.front().stamp),
                    format_seconds(truth.back().stamp)));
  }
  std::optional<Eigen::Vector3d> velocity;
  if (errors->alignment_determined)
    velocity = velocity_rmse(velocities_beside(options.estimate, context.log),
                             velocities_beside(options.truth, context.log),
                             errors->truth_from_estimate.rotation(), options.tolerance_s);
  warn_of_doubts(*errors, context.log);
  warn_of_frames(estimate, truth, settings, *errors, context.log);
  const std::string text = options.json ? to_json(*errors, velocity).dump(2) + "\n"
                                        : to_text(*errors, velocity, options.tolerance_s);
  std::fputs(text.c_str(), stdout);
  return kExitDone;
}

}  // namespace

void add_evaluate_command(CLI::App& app, Command& chosen) {
  CLI::App* command = app.add_subcommand(
      "evaluate", "Errors of a trajectory, or of a tree list, against the truth");
  const auto options = std::make_shared<EvaluateOptions>();
  command->add_option("ESTIMATE", options->estimate, "Run folder or TUM file");
  command->add_option("TRUTH", options->truth, "Truth folder or TUM file");
  command
      ->add_option("--align", options->alignment,
                   "Move the estimate onto the truth first (unaligned by default)")
      ->check(CLI::IsMember({"none", "first", "yaw", "se3"}));
  command->add_option("--tolerance-s", options->tolerance_s, "Largest difference of paired times")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--delta-m", options->deltas_m, "Path lengths for RPE (10 by default)")
      ->check(CLI::Range(1e-6, 1e7));
  command
      ->add_option("--prism-m", options->prism_m,
                   "TRUTH holds places of a prism (total_station.csv), which is here in the body "
                   "frame: x y z")
      ->expected(3);
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer(
      "Examples:\n  understory evaluate run walk.truth --align se3\n"
      "  understory evaluate run walk.truth --align yaw --prism-m -0.3 0.4 2.6\n"
      "  understory evaluate trees run walk.truth --align yaw");
  command->callback([&chosen, options, command] {
    if (!command->get_subcommands().empty()) return;
    chosen = [options](CommandContext& context) {
      context.stop_at_once();
      return evaluate(*options, context);
    };
  });
  add_evaluate_map_command(*command, chosen);
  add_evaluate_trees_command(*command, chosen);
}

}  // namespace understory
