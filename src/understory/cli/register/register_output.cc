#include "understory/cli/register/register_output.h"

#include <cstdio>

#include "understory/cli/terminal.h"

namespace understory {

std::vector<double> numbers_of(const Eigen::MatrixXd& matrix) {
  std::vector<double> numbers;
  numbers.reserve(static_cast<std::size_t>(matrix.size()));
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = 0; c < matrix.cols(); ++c)
      numbers.push_back(matrix(r, c));
  }
  return numbers;
}

void print_motion(const Pose& a_from_b) {
  const Eigen::Matrix4d matrix = a_from_b.matrix();
  std::printf("a_from_b\n");
  for (int r = 0; r < 4; ++r) {
    std::printf(
        "%s\n",
        number_row({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)}, 9, " ").c_str());
  }
}

nlohmann::ordered_json verdict_json(const MatchVerdict& verdict) {
  nlohmann::ordered_json out{{"trusted", verdict.trusted},
                             {"reason", verdict.reason},
                             {"chance", verdict.chance},
                             {"near", verdict.evidence.near},
                             {"seen_through", verdict.evidence.seen_through},
                             {"fine", verdict.evidence.fine},
                             {"fine_aside", verdict.evidence.fine_aside},
                             {"uprights_matched", verdict.evidence.matched},
                             {"uprights_by_chance", verdict.evidence.by_chance},
                             {"score", verdict.score},
                             {"moved_m", verdict.moved_m},
                             {"moved_deg", verdict.moved_deg}};
  if (verdict.rival) out["rival_score"] = verdict.rival->score;
  return out;
}

void print_verdict(const MatchVerdict& verdict) {
  std::printf("verdict %s%s\n",
              verdict.trusted ? "trusted" : "untrusted: ", verdict.reason.c_str());
  std::printf("chance %.3f\nnear %.3f\nseen_through %.3f\n", verdict.chance, verdict.evidence.near,
              verdict.evidence.seen_through);
}

}  // namespace understory
