#include "understory/graph/loops/gain_queue.h"

#include <algorithm>
#include <cmath>

#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {

GainQueue::GainQueue(std::vector<CorrectionPair> pairs, std::vector<double> noise_m2,
                     const std::vector<double>& step_variance_m2)
    : pairs_(std::move(pairs)), noise_m2_(std::move(noise_m2)) {
  UNDERSTORY_CHECK(pairs_.size() == noise_m2_.size());
  walked_m2_.assign(step_variance_m2.size(), 0.0);
  for (std::size_t k = 1; k < walked_m2_.size(); ++k)
    walked_m2_[k] = walked_m2_[k - 1] + step_variance_m2[k];
  open_.assign(pairs_.size(), 1);
  factor_.resize(pairs_.size());
  for (std::size_t c = 0; c < pairs_.size(); ++c)
    variance_m2_.push_back(shared_m2(c, c));
}

double GainQueue::shared_m2(std::size_t a, std::size_t b) const {
  const int begin = std::max(pairs_[a].j, pairs_[b].j);
  const int end = std::min(pairs_[a].i, pairs_[b].i);
  if (end <= begin) return 0.0;
  return walked_m2_[static_cast<std::size_t>(end)] - walked_m2_[static_cast<std::size_t>(begin)];
}

std::optional<std::size_t> GainQueue::best() const {
  std::optional<std::size_t> found;
  double most = 0.0;
  for (std::size_t c = 0; c < pairs_.size(); ++c) {
    if (open_[c] == 0 || gain(c) <= most) continue;
    most = gain(c);
    found = c;
  }
  return found;
}

double GainQueue::variance_m2(std::size_t pair) const {
  return std::max(0.0, variance_m2_[pair]);
}

double GainQueue::gain(std::size_t pair) const {
  return 0.5 * std::log1p(variance_m2(pair) / noise_m2_[pair]);
}

void GainQueue::take(std::size_t pair) {
  open_[pair] = 0;
  const double scale = 1.0 / std::sqrt(variance_m2(pair) + noise_m2_[pair]);
  const std::vector<double> own = factor_[pair];
  parallel_for(pairs_.size(), 256, [&](std::size_t c) {
    if (open_[c] == 0) return;
    double left = shared_m2(c, pair);
    for (std::size_t k = 0; k < own.size(); ++k)
      left -= factor_[c][k] * own[k];
    const double value = left * scale;
    factor_[c].push_back(value);
    variance_m2_[c] -= value * value;
  });
}

}  // namespace understory
