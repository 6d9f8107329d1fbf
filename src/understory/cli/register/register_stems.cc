#include "understory/cli/register/register_stems.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "understory/cli/register/register_output.h"
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

struct SparsePair {
  SparseTarget target;
  SparsePoints source;
};

SparsePair sparse_pair(const StemClouds& clouds) {
  return {SparseTarget(sparse(clouds.target, clouds.target_file)),
          sparse(clouds.source, clouds.source_file)};
}

void print_line(const std::string& name, const Json& value) {
  const bool said = !value.is_string() || !value.get_ref<const std::string&>().empty();
  if (value.is_array() || !said) return;
  if (value.is_number_float()) {
    std::printf("%s %.4f\n", name.c_str(), value.get<double>());
  } else {
    std::printf("%s %s\n", name.c_str(),
                value.is_string() ? value.get<std::string>().c_str() : value.dump().c_str());
  }
}

// P0 (26): ICP that has not come home leaves pairs about half a neighbour's distance apart. The
// best of a range in which there is no match has as few partners.
constexpr double kLeastOverlap = 0.4;

// One object, or the same as lines of a name and a value; the method's own figures come last.
template <typename Result>
void print(const StemClouds& clouds, const Result& result, const Json& own) {
  const Pose a_from_b =
      clouds.file_from_target * result.target_from_source * clouds.file_from_target.inverse();
  Json figures{{"status", to_string(result.status)},
               {"reason", result.reason},
               {"error_rms_m", result.error_rms_m},
               {"overlap", result.overlap}};
  figures.update(own);
  if (clouds.json) {
    Json out{{"a_from_b", numbers_of(a_from_b.matrix())}};
    out.update(figures);
    std::printf("%s\n", out.dump(2).c_str());
    return;
  }
  print_motion(a_from_b);
  for (const auto& [name, value] : figures.items())
    print_line(name, value);
}

int trusted_or(bool trusted, const std::string& reason, CommandContext& context) {
  if (!trusted) context.log.warn("register.untrusted", reason);
  return trusted ? kExitDone : kExitUntrusted;
}

}  // namespace

int register_by_go_icp(const StemClouds& clouds, const GoIcpConfig& config,
                       CommandContext& context) {
  const auto [target, source] = sparse_pair(clouds);
  GoIcpResult result = register_go_icp(target, source, clouds.guess, config);
  const bool found =
      result.status == GoIcpStatus::kCertified || result.status == GoIcpStatus::kConverged;
  if (found && result.overlap < kLeastOverlap)
    result.reason =
        "little overlap: the best motion of the range leaves most stems without a partner";
  print(clouds, result,
        {{"gap_m", result.gap_m},
         {"cells", result.cells},
         {"nodes", result.nodes},
         {"icp_runs", result.icp_runs}});
  return trusted_or(found && result.overlap >= kLeastOverlap, result.reason, context);
}

int register_by_stem_icp(const StemClouds& clouds, const SparseIcpConfig& config,
                         CommandContext& context) {
  const auto [target, source] = sparse_pair(clouds);
  const SparseIcpResult result = register_sparse_icp(target, source, clouds.guess, config);
  print(clouds, result,
        {{"error_m", result.error_m},
         {"outlier_ratio", result.outlier_ratio},
         {"mean_neighbour_m", target.l0_m},
         {"iterations", result.iterations},
         {"information", numbers_of(result.information)}});
  if (result.status != SparseIcpStatus::kConverged)
    return trusted_or(false, result.reason, context);
  return trusted_or(result.overlap >= kLeastOverlap,
                    "little overlap: the match may have ended in another place (go-icp searches)",
                    context);
}

}  // namespace understory
