#include <Eigen/Geometry>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "understory/cli/command.h"
#include "understory/cli/register/register_features.h"
#include "understory/cli/register/register_output.h"
#include "understory/cli/register/register_stems.h"
#include "understory/cli/suggestion.h"
#include "understory/cli/terminal.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/recording/finding.h"
#include "understory/registration/global/match_verdict.h"
#include "understory/registration/matchers.h"
#include "understory/registration/two_clouds.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

struct RegisterConfig {
  double target_voxel_m = kTargetVoxelM;
  double source_voxel_m = kSourceVoxelM;
  MatcherConfig matcher = matchers_of_two_clouds();
  SparseIcpConfig stem_icp;
  GoIcpConfig go_icp;
};

void describe(ConfigTable& table, RegisterConfig& config) {
  table.add("target_voxel_m", config.target_voxel_m, {0.01, 5.0}, "m",
            "voxels that thin the target");
  table.add("source_voxel_m", config.source_voxel_m, {0.01, 5.0}, "m",
            "voxels that thin the source; of icp and gicp both clouds");
  describe_settings(table, config.matcher);
  table.section("stem_icp", [&] { describe(table, config.stem_icp); });
  table.section("go_icp", [&] { describe(table, config.go_icp); });
}

constexpr const char* kGlobal = "global";

struct RegisterOptions {
  std::string target;
  std::string source;
  std::string method = "ndt";
  std::vector<double> guess;
  std::string config_file;
  std::vector<std::string> settings;
  bool json = false;
  bool print_config = false;
};

// The guess as given: nothing, x y z, x y z qx qy qz qw, or 16 numbers row by row.
Pose parse_guess(const std::vector<double>& numbers) {
  switch (numbers.size()) {
    case 0:
      return {};
    case 3:
      return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(numbers.data())};
    case 7: {
      const Eigen::Quaterniond rotation(numbers[6], numbers[3], numbers[4], numbers[5]);
      if (!(rotation.norm() > 0.5)) break;
      return {rotation, Eigen::Vector3d(numbers.data())};
    }
    case 16: {
      const Eigen::Matrix4d matrix =
          Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
      const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
      const Eigen::RowVector4d last = matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1);
      const double off = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
      if (off > 1e-3 || rotation.determinant() < 0.0 || last.norm() > 1e-9) break;
      return Pose::from_matrix(matrix);
    }
    default:
      break;
  }
  throw ConfigError(
      {"--guess: expected x,y,z or x,y,z,qx,qy,qz,qw or a rigid motion as 16 numbers row by row"});
}

// A cloud in a frame of its own, so that single precision is enough in any coordinate system.
struct Loaded {
  Points points;
  std::vector<std::uint16_t> ring;  // of each point, or empty
  Pose file_from_points;
};

// What a motion does at one place: in map coordinates the matrix alone hides it, since a small tilt
// moves the far origin by kilometres.
struct LocalMotion {
  Eigen::Vector3d place;    // in the middle of B's extent, m, frame of B
  Eigen::Vector3d shift_m;  // of that place
  double turn_deg = 0.0;
};

LocalMotion motion_in_the_middle(const Pose& a_from_b, const Loaded& source) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& point : source.points)
    box.extend(point);
  LocalMotion motion;
  motion.place = source.file_from_points * Eigen::Vector3d(box.center().cast<double>());
  motion.shift_m = a_from_b * motion.place - motion.place;
  motion.turn_deg = kDegPerRad * Eigen::AngleAxisd(a_from_b.rotation()).angle();
  return motion;
}

Loaded load(const std::string& path, Log& log) {
  refuse_folder(path);
  PointCloudFile file = read_cloud(path, log);
  require_metres(file.coordinate_system, path);
  return {std::move(file.points), std::move(file.ring),
          Pose(Eigen::Quaterniond::Identity(), file.origin)};
}

// The same in another frame that is turned like it.
Points in_frame(const Loaded& cloud, const Pose& file_from_frame) {
  const Eigen::Vector3f offset =
      (cloud.file_from_points.translation() - file_from_frame.translation()).cast<float>();
  Points moved = cloud.points;
  for (Eigen::Vector3f& point : moved)
    point += offset;
  return moved;
}

// What the method makes of a guess, with both clouds ready for it.
MatchFrom matching(const RegisterOptions& options, const RegisterConfig& config,
                   const Loaded& target_cloud, const Loaded& source_cloud) {
  const Points& target = target_cloud.points;
  const Points& source = source_cloud.points;
  VoxelFilter filter;
  const std::shared_ptr<const Matcher> matcher = make_matcher(config.matcher, options.method);
  if (const auto finder = matcher->feature_finder()) {
    const FeaturePoints a =
        features_of_cloud(*finder, target, target_cloud.ring, config.target_voxel_m);
    const FeaturePoints b =
        features_of_cloud(*finder, source, source_cloud.ring, config.source_voxel_m);
    return [matcher, a, b](const Pose& guess, const PoseTerms& terms) {
      return match_clouds_by_features(*matcher, a, b, guess, terms);
    };
  }
  const Points thinned = filter.filter(source, config.source_voxel_m);
  const double voxel_m = matcher->sums_up_points() ? config.target_voxel_m : config.source_voxel_m;
  const MatchTargetPtr map = matcher->make_target(filter.filter(target, voxel_m));
  return [map, thinned](const Pose& guess, const PoseTerms& terms) {
    return map->match(thinned, guess, terms, MatchStart::kFar);
  };
}

void print_json(const RegistrationResult& result, const MatchVerdict& verdict, const Pose& a_from_b,
                const LocalMotion& local) {
  nlohmann::json out;
  out["a_from_b"] = numbers_of(a_from_b.matrix());
  out["middle_of_b"] = numbers_of(local.place);
  out["shift_there_m"] = numbers_of(local.shift_m);
  out["turn_deg"] = local.turn_deg;
  out["status"] = to_string(result.status);
  out["reason"] = result.reason;
  out["fitness_m2"] = result.fitness_m2;
  out["surface_residual_m2"] = result.surface_residual_m2;
  out["inlier_ratio"] = result.inlier_ratio;
  out["iterations"] = result.iterations;
  out["information"] = numbers_of(result.information);
  out["degenerate_directions"] = nlohmann::json::array();
  for (Eigen::Index i = 0; i < result.degenerate_directions.cols(); ++i)
    out["degenerate_directions"].push_back(numbers_of(result.degenerate_directions.col(i)));
  out["verdict"] = verdict_json(verdict);
  std::printf("%s\n", out.dump(2).c_str());
}

void print_text(const RegistrationResult& result, const MatchVerdict& verdict, const Pose& a_from_b,
                const LocalMotion& local) {
  print_motion(a_from_b);
  const Eigen::Vector3d& p = local.place;
  const Eigen::Vector3d& s = local.shift_m;
  std::printf("middle_of_b %s\nshift_there_m %s\nturn_deg %.3f\n",
              number_row({p.x(), p.y(), p.z()}, 3, " ").c_str(),
              number_row({s.x(), s.y(), s.z()}, 3, " ").c_str(), local.turn_deg);
  std::printf("status %s%s%s\n", to_string(result.status).c_str(),
              result.reason.empty() ? "" : ": ", result.reason.c_str());
  std::printf("fitness_m2 %.6f\nsurface_residual_m2 %.6f\ninlier_ratio %.4f\niterations %d\n",
              result.fitness_m2, result.surface_residual_m2, result.inlier_ratio,
              result.iterations);
  std::printf("information (rotation x y z, translation x y z)\n");
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c)
      std::printf("%.6g%c", result.information(r, c), c == 5 ? '\n' : ' ');
  }
  std::printf("degenerate_directions %td\n", result.degenerate_directions.cols());
  for (Eigen::Index i = 0; i < result.degenerate_directions.cols(); ++i) {
    for (int r = 0; r < 6; ++r)
      std::printf("%s%c", number_row({result.degenerate_directions(r, i)}, 4, "").c_str(),
                  r == 5 ? '\n' : ' ');
  }
  print_verdict(verdict);
}

// What a method made of the clouds, and the verdict on it; between the frames of the points.
GlobalRegistration registered(const RegisterOptions& options, const RegisterConfig& config,
                              const Loaded& target, const Loaded& source, const Pose& guess) {
  if (options.method == kGlobal) return register_globally(target.points, source.points);
  return match_and_judge(target.points, source.points, guess,
                         matching(options, config, target, source));
}

int print_registration(const RegisterOptions& options, const GlobalRegistration& done,
                       const Pose& a_from_b, const LocalMotion& local, CommandContext& context) {
  if (options.json)
    print_json(done.result, done.verdict, a_from_b, local);
  else
    print_text(done.result, done.verdict, a_from_b, local);
  const std::string damage = found(context.log, Finding::kDamage).first;
  if (!damage.empty()) {
    context.log.warn("register.untrusted", "a cloud is not whole: " + damage);
    return kExitUntrusted;
  }
  if (!done.verdict.trusted) context.log.warn("register.untrusted", done.verdict.reason);
  return done.verdict.trusted ? kExitDone : kExitUntrusted;
}

int run_register(const RegisterOptions& options, CommandContext& context) {
  RegisterConfig config;
  ConfigTable table;
  describe(table, config);
  if (!options.config_file.empty()) table.read_file(options.config_file);
  table.set(options.settings);
  if (options.print_config) {
    std::fputs(table.to_yaml(true).c_str(), stdout);
    return kExitDone;
  }
  if (options.target.empty() || options.source.empty())
    throw ConfigError({"register: expected two clouds, A and B"});
  context.stop_at_once();
  const Loaded target = load(options.target, context.log);
  const Loaded source = load(options.source, context.log);
  const Pose& a_from_target = target.file_from_points;
  const Pose guess = parse_guess(options.guess);
  if (options.method == "go-icp" || options.method == "stem-icp") {
    const Pose guess_in_target = a_from_target.inverse() * guess * a_from_target;
    const StemClouds clouds{
        options.target,  options.source, target.points, in_frame(source, a_from_target),
        guess_in_target, a_from_target,  options.json};
    return options.method == "go-icp" ? register_by_go_icp(clouds, config.go_icp, context)
                                      : register_by_stem_icp(clouds, config.stem_icp, context);
  }
  const GlobalRegistration done = registered(
      options, config, target, source, a_from_target.inverse() * guess * source.file_from_points);
  const Pose a_from_b =
      a_from_target * done.result.target_from_source * source.file_from_points.inverse();
  return print_registration(options, done, a_from_b, motion_in_the_middle(a_from_b, source),
                            context);
}

}  // namespace

void add_register_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<RegisterOptions>();
  CLI::App* command = app.add_subcommand("register", "Match one point cloud to another");
  command->add_option("A", options->target, "Target cloud (.las, .laz, .e57, .pcd, .ply, .bin)");
  command->add_option("B", options->source, "Source cloud");
  std::vector<std::string> methods = matcher_names();
  methods.insert(methods.end(), {kGlobal, "stem-icp", "go-icp"});
  command
      ->add_option("--method", options->method,
                   matcher_summaries("\n") +
                       "\nglobal (no guess, any place and heading; z about up)\n"
                       "stem-icp (sparse clouds of stems, z up: trimmed, from the guess)\n"
                       "go-icp (sparse clouds of stems, z up: a search without a guess)")
      ->check(CLI::IsMember(methods));
  command
      ->add_option("--guess", options->guess,
                   "a_from_b to start from: x,y,z or x,y,z,qx,qy,qz,qw or 16 numbers row by row")
      ->delimiter(',');
  command->add_option("--config", options->config_file, "YAML file with settings");
  add_settings_option(*command, options->settings);
  command->add_flag("--json", options->json, "Print one JSON object");
  command->add_flag("--print-config", options->print_config, "Print every key with its meaning");
  command->footer(
      "Example: understory register a.pcd b.pcd --method ndt --guess 1.2,0,0 --json\n"
      "prints a_from_b, the motion that takes points of B to A, row by row. Exit code 4: the "
      "match\n"
      "is not to be trusted; a warning says why.");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run_register(*options, context); };
  });
}

}  // namespace understory
