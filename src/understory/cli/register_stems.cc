#include "understory/cli/register_stems.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "understory/util/error.h"

namespace understory {
namespace {

using Json = nlohmann::ordered_json;

SparsePoints sparse(const Points& points, const std::string& file) {
  constexpr std::size_t kMost = 5000;
  if (points.size() > kMost)
    throw InputError(file, "", "expected a sparse cloud of at most 5000 points (stems)");
  SparsePoints result;
  result.reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    result.emplace_back(point.cast<double>());
  return result;
}

Json rows_of(const Eigen::MatrixXd& matrix) {
  Json numbers = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c)
      numbers.push_back(matrix(r, c));
  }
  return numbers;
}

// One object, or the same as lines of a name and a value.
void print(const Json& figures, const Eigen::Matrix4d& a_from_b, bool as_json) {
  if (as_json) {
    Json out{{"a_from_b", rows_of(a_from_b)}};
    out.update(figures);
    std::printf("%s\n", out.dump(2).c_str());
    return;
  }
  std::printf("a_from_b\n");
  for (int r = 0; r < 4; ++r)
    std::printf("%.9f %.9f %.9f %.9f\n", a_from_b(r, 0), a_from_b(r, 1), a_from_b(r, 2),
                a_from_b(r, 3));
  for (const auto& [name, value] : figures.items()) {
    if (value.is_array() || value == "") continue;
    if (value.is_number_float()) {
      std::printf("%s %.4f\n", name.c_str(), value.get<double>());
    } else {
      std::printf("%s %s\n", name.c_str(),
                  value.is_string() ? value.get<std::string>().c_str() : value.dump().c_str());
    }
  }
}

Eigen::Matrix4d in_files(const StemClouds& clouds, const Pose& target_from_source) {
  return (clouds.file_from_target * target_from_source * clouds.file_from_target.inverse())
      .matrix();
}

int trusted_or(bool trusted, const std::string& reason, CommandContext& context) {
  if (!trusted) context.log.warn("register.untrusted", reason);
  return trusted ? kExitDone : kExitUntrusted;
}

const char* name_of(SparseIcpStatus status) {
  switch (status) {
    case SparseIcpStatus::kConverged:
      return "converged";
    case SparseIcpStatus::kIterationLimit:
      return "iteration_limit";
    case SparseIcpStatus::kTooFewPoints:
      return "too_few_points";
  }
  return "?";
}

}  // namespace

int register_by_go_icp(const StemClouds& clouds, const GoIcpConfig& config,
                       CommandContext& context) {
  const SparseTarget target(sparse(clouds.target, clouds.target_file));
  const GoIcpResult result =
      register_go_icp(target, sparse(clouds.source, clouds.source_file), clouds.guess, config);
  print({{"status", to_string(result.status)},
         {"reason", result.reason},
         {"gap_m", result.gap_m},
         {"error_rms_m", result.error_rms_m},
         {"overlap", result.overlap},
         {"cells", result.cells},
         {"nodes", result.nodes},
         {"icp_runs", result.icp_runs}},
        in_files(clouds, result.target_from_source), clouds.json);
  return trusted_or(
      result.status == GoIcpStatus::kCertified || result.status == GoIcpStatus::kConverged,
      result.reason, context);
}

int register_by_stem_icp(const StemClouds& clouds, const SparseIcpConfig& config,
                         CommandContext& context) {
  const SparseTarget target(sparse(clouds.target, clouds.target_file));
  const SparseIcpResult result =
      register_sparse_icp(target, sparse(clouds.source, clouds.source_file), clouds.guess, config);
  print({{"status", name_of(result.status)},
         {"reason", result.reason},
         {"error_m", result.error_m},
         {"error_rms_m", result.error_rms_m},
         {"overlap", result.overlap},
         {"outlier_ratio", result.outlier_ratio},
         {"mean_neighbour_m", target.l0_m},
         {"iterations", result.iterations},
         {"information", rows_of(result.information)}},
        in_files(clouds, result.target_from_source), clouds.json);
  // P0 (26): ICP that has not come home leaves pairs about half a neighbour's distance apart.
  constexpr double kLeastOverlap = 0.4;
  if (result.status != SparseIcpStatus::kConverged)
    return trusted_or(false, result.reason, context);
  return trusted_or(result.overlap >= kLeastOverlap,
                    "little overlap: the match may have ended in another place (go-icp searches)",
                    context);
}

}  // namespace understory
