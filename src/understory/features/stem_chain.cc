#include "understory/features/stem_chain.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/features/features_constants.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace features_constants::stem_chain;

// A section's centre with its error, given a radius.
struct Centre {
  Eigen::Vector2d place;
  Eigen::Matrix2d covariance;
};

Centre centre_of(const StemSection& section, double radius, double radius_sd, double range_sd) {
  const Eigen::Vector2d along = section.sight;
  const Eigen::Vector2d left(-along.y(), along.x());
  const double n = section.returns;
  const double s = section.spacing_m;
  Centre centre;
  centre.place = section.surface;
  double along_var = range_sd * range_sd / n + kLeastAlongVariance;
  double across_var = 0.0;
  if (section.range_m > 0.0) {
    centre.place += kMeanDepth * radius * along;
    along_var += std::pow(kMeanDepth * radius_sd, 2) + std::pow(kDepthSpread * radius, 2) / n;
  }
  const bool hidden_left = section.left == Side::kHidden;
  const bool hidden_right = section.right == Side::kHidden;
  const double missing = 2.0 * radius - section.width_m;
  if (hidden_left != hidden_right && missing > 0.0) {
    // The open edge and the radius tell where the centre is.
    centre.place += (hidden_left ? 0.5 : -0.5) * missing * left;
    across_var = s * s / 12.0 + radius_sd * radius_sd;
  } else if (hidden_left && missing > 0.0) {
    across_var = radius * radius / 3.0;
  } else if (section.returns == 1) {
    const double width = std::min(2.0 * radius, 2.0 * s);
    across_var = width * width / 12.0;
  } else {
    across_var = s * s / 24.0;
  }
  across_var += kLeastAcrossVariance;
  centre.covariance = along_var * along * along.transpose() + across_var * left * left.transpose();
  return centre;
}

using Observation = Eigen::Matrix<double, 2, 4>;
Observation observation(double above_base) {
  Observation h = Observation::Zero();
  h.leftCols<2>().setIdentity();
  h.rightCols<2>() = above_base * Eigen::Matrix2d::Identity();
  return h;
}

// A section of a level by its place, for the search.
struct Spot {
  double x = 0.0;
  double y = 0.0;
  int section = 0;
};

// The growing of one chain from its first section.
class Grower {
 public:
  Grower(const SectionView& view, const StemChainConfig& config,
         const std::vector<std::vector<Spot>>& by_x, std::vector<char>& used)
      : view_(view), config_(config), sections_(view.sections()), by_x_(by_x), used_(used) {
    centres_.reserve(sections_.size());
    for (const StemSection& section : sections_)
      centres_.push_back(
          centre_of(section, config.usual_radius_m, config.radius_spread_m, view.range_sd_m()));
  }

  StemChain grow(int seed) {
    const StemSection& section = at(seed);
    chain_ = {};
    chain_.sections = {seed};
    const Centre& centre = centre_at(seed);
    StemLine& line = chain_.line;
    line.base_m = section.height_m;
    line.state << centre.place, 0.0, 0.0;
    line.covariance.setZero();
    line.covariance.topLeftCorner<2, 2>() = centre.covariance;
    line.covariance.bottomRightCorner<2, 2>() =
        config_.slope_sd * config_.slope_sd * Eigen::Matrix2d::Identity();
    extend(section.level, 1, section.height_m);
    extend(section.level, -1, section.height_m);
    std::sort(chain_.sections.begin(), chain_.sections.end(), [&](int a, int b) {
      return at(a).level != at(b).level ? at(a).level < at(b).level : a < b;
    });
    return chain_;
  }

 private:
  [[nodiscard]] const StemSection& at(int i) const {
    return sections_[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const Centre& centre_at(int i) const {
    return centres_[static_cast<std::size_t>(i)];
  }

  void extend(int level, int direction, double last_height) {
    int passed = 0;
    int blocked = 0;
    for (level += direction; level >= 0 && level < view_.levels(); level += direction) {
      Eigen::Vector2d place = chain_.line.at(last_height);
      const double height = view_.height_at(level, place);
      if (std::abs(height - last_height) > kLongestGap) return;
      place = chain_.line.at(height);
      const int next = best_in(level, place, height);
      if (next >= 0) {
        take(next);
        last_height = at(next).height_m;
        passed = 0;
        blocked = 0;
        continue;
      }
      // Most sections begin nothing, and are left before their surroundings are looked at.
      if (chain_.sections.size() == 1) {
        if (++passed >= 2) return;
        continue;
      }
      const Sight sight = view_.look(level, place, 0.5 * config_.usual_radius_m);
      passed += sight == Sight::kPassed ? 1 : 0;
      blocked += sight == Sight::kHit ? 1 : 0;
      if (passed >= 2 || blocked >= 3) return;
    }
  }

  // The unused section of a level that lies best on the line.
  [[nodiscard]] int best_in(int level, const Eigen::Vector2d& place, double height_m) const {
    // Far enough for the gate, given how well the line is known and how badly a section can be.
    const Eigen::Matrix2d known = chain_.line.covariance_at(height_m);
    const double reach =
        std::sqrt(kGate * (known.diagonal().maxCoeff() + kWorstSection * kWorstSection)) +
        kMeanDepth * config_.usual_radius_m;
    const std::vector<Spot>& row = by_x_[static_cast<std::size_t>(level)];
    auto it = std::lower_bound(row.begin(), row.end(), place.x() - reach,
                               [](const Spot& spot, double x) { return spot.x < x; });
    int best = -1;
    double least = kGate;
    for (; it != row.end() && it->x <= place.x() + reach; ++it) {
      if (std::abs(it->y - place.y()) > reach) continue;
      if (used_[static_cast<std::size_t>(it->section)] != 0) continue;
      const Centre& centre = centre_at(it->section);
      const double height = at(it->section).height_m;
      const Eigen::Vector2d off = centre.place - chain_.line.at(height);
      const Eigen::Matrix2d spread = centre.covariance + chain_.line.covariance_at(height);
      const double distance = off.dot(spread.inverse() * off);
      if (distance >= least) continue;
      least = distance;
      best = it->section;
    }
    return best;
  }

  void take(int i) {
    const Centre& centre = centre_at(i);
    StemLine& line = chain_.line;
    const Observation h = observation(at(i).height_m - line.base_m);
    const Eigen::Matrix2d spread = centre.covariance + h * line.covariance * h.transpose();
    const Eigen::Matrix<double, 4, 2> gain = line.covariance * h.transpose() * spread.inverse();
    line.state += gain * (centre.place - h * line.state);
    line.covariance -= gain * h * line.covariance;
    chain_.sections.push_back(i);
  }

  const SectionView& view_;
  const StemChainConfig& config_;
  const std::vector<StemSection>& sections_;
  std::vector<Centre> centres_;
  const std::vector<std::vector<Spot>>& by_x_;
  std::vector<char>& used_;
  StemChain chain_;
};

// Sections from the one that says most down. One or two returns in a thicket begin nothing.
std::vector<int> seed_order(const std::vector<StemSection>& sections) {
  std::vector<int> order;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const bool open = sections[i].left == Side::kOpen || sections[i].right == Side::kOpen;
    if (open || sections[i].returns >= 3) order.push_back(static_cast<int>(i));
  }
  const auto worth = [&](int i) {
    const StemSection& section = sections[static_cast<std::size_t>(i)];
    const int open = (section.left == Side::kOpen ? 1 : 0) + (section.right == Side::kOpen ? 1 : 0);
    return 100 * open + std::min(section.returns, 20);
  };
  sort_stably(order, [&](int a, int b) { return worth(a) > worth(b); });
  return order;
}

void count_between(const SectionView& view, StemChain& chain) {
  chain.passed = chain.hits = chain.hidden = chain.blank = 0;
  std::size_t next = 0;
  const auto& sections = view.sections();
  const auto level_of = [&](std::size_t k) {
    return sections[static_cast<std::size_t>(chain.sections[k])].level;
  };
  for (int level = level_of(0); level <= level_of(chain.sections.size() - 1); ++level) {
    if (level_of(next) == level) {
      while (next + 1 < chain.sections.size() && level_of(next) <= level)
        ++next;
      continue;
    }
    Eigen::Vector2d place = chain.line.state.head<2>();
    place = chain.line.at(view.height_at(level, place));
    switch (view.look(level, place, 0.5 * chain.radius_m)) {
      case Sight::kHit:
        ++chain.hits;
        break;
      case Sight::kPassed:
        ++chain.passed;
        break;
      case Sight::kHidden:
        ++chain.hidden;
        break;
      case Sight::kUnknown:
        ++chain.blank;
        break;
    }
  }
}

}  // namespace

Eigen::Matrix2d StemLine::covariance_at(double height_m) const {
  const double above = height_m - base_m;
  return covariance.topLeftCorner<2, 2>() +
         above * (covariance.topRightCorner<2, 2>() + covariance.bottomLeftCorner<2, 2>()) +
         above * above * covariance.bottomRightCorner<2, 2>();
}

OwnRadius own_radius(const SectionView& view, const StemChain& chain, double from_m, double to_m) {
  std::vector<double> widths;
  std::vector<const StemSection*> whole;
  for (const int i : chain.sections) {
    const StemSection& section = view.sections()[static_cast<std::size_t>(i)];
    if (section.left == Side::kHidden || section.right == Side::kHidden) continue;
    if (section.height_m < from_m || section.height_m > to_m) continue;
    whole.push_back(&section);
    widths.push_back(section.width_m);
  }
  if (whole.empty()) return {};
  // Runs that something else has widened are left out.
  const double most = kWidened * upper_median(widths) + kWidenedBy;
  double sum = 0.0;
  double count = 0.0;
  double variance = 0.0;
  double range = 0.0;
  double spacing = 0.0;
  for (const StemSection* section : whole) {
    if (section->width_m > most) continue;
    sum += section->width_m;
    range += section->range_m;
    spacing += section->spacing_m;
    variance += section->spacing_m * section->spacing_m / 6.0;
    count += 1.0;
  }
  range /= count;
  const double seen = count;
  // Beams that went by on both sides of a narrow stem count as a width of zero.
  const double missed = chain.blank + chain.passed;
  variance += missed * std::pow(whole.front()->spacing_m, 2) / 6.0;
  count += missed;
  const double width = sum / count;
  OwnRadius own;
  own.sections = static_cast<int>(seen);
  own.spacing_m = spacing / seen;
  own.radius_m = 0.5 * width;
  if (range > 0.0) own.radius_m *= 1.0 + kMeanDepth * own.radius_m / range;
  own.sd_m = 0.5 * std::sqrt(variance) / count + kRadiusSd;
  return own;
}

void fit_chain(const SectionView& view, const StemChainConfig& config, StemChain& chain) {
  if (chain.radius_m <= 0.0) chain.radius_m = config.usual_radius_m;
  count_between(view, chain);
  const OwnRadius own = own_radius(view, chain);
  const double usual = 1.0 / (config.radius_spread_m * config.radius_spread_m);
  const double seen = own.radius_m > 0.0 ? 1.0 / (own.sd_m * own.sd_m) : 0.0;
  chain.radius_m = (usual * config.usual_radius_m + seen * own.radius_m) / (usual + seen);
  chain.radius_sd_m = 1.0 / std::sqrt(usual + seen);

  // The base in the middle of what was seen keeps place and slope nearly independent; the radius is
  // that there.
  const auto& sections = view.sections();
  const auto height_of = [&](int i) { return sections[static_cast<std::size_t>(i)].height_m; };
  StemLine line;
  line.base_m = 0.5 * (height_of(chain.sections.front()) + height_of(chain.sections.back()));
  line.state << chain.line.at(line.base_m), chain.line.state.tail<2>();
  Eigen::Matrix4d prior = Eigen::Matrix4d::Zero();
  prior(2, 2) = prior(3, 3) = 1.0 / (config.slope_sd * config.slope_sd);
  std::vector<Centre> centres;
  for (const int i : chain.sections) {
    const double radius = chain.radius_m + kUsualTaper * (height_of(i) - line.base_m);
    // What all sections of a stem share, the radius, is added at the end.
    centres.push_back(centre_of(sections[static_cast<std::size_t>(i)], std::max(radius, 0.0), 0.0,
                                view.range_sd_m()));
  }
  Eigen::Matrix4d information;
  double squares = 0.0;
  for (int round = 0; round < kFitRounds; ++round) {
    information = prior;
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    squares = 0.0;
    for (std::size_t k = 0; k < centres.size(); ++k) {
      const Observation h = observation(height_of(chain.sections[k]) - line.base_m);
      const Eigen::Matrix2d inverse = centres[k].covariance.inverse();
      const Eigen::Vector2d off = centres[k].place - h * line.state;
      const double distance = off.dot(inverse * off);
      // Student's t with 4 degrees of freedom.
      const double weight = 6.0 / (4.0 + distance);
      squares += std::min(distance, kMostSquare);
      information += weight * h.transpose() * inverse * h;
      right += weight * h.transpose() * inverse * centres[k].place;
    }
    line.state = SymmetricSolver<4>(information).solve(right);
  }
  chain.misfit = std::sqrt(squares / (2.0 * static_cast<double>(centres.size())));
  line.covariance = information.inverse();
  const Eigen::Vector2d sight = sections[static_cast<std::size_t>(chain.sections.front())].sight;
  line.covariance.topLeftCorner<2, 2>() +=
      std::pow(kMeanDepth * chain.radius_sd_m, 2) * sight * sight.transpose();
  chain.line = line;
}

std::vector<StemChain> chain_sections(const SectionView& view, const StemChainConfig& config) {
  const auto& sections = view.sections();
  std::vector<std::vector<Spot>> by_x(static_cast<std::size_t>(view.levels()));
  for (std::size_t i = 0; i < sections.size(); ++i) {
    by_x[static_cast<std::size_t>(sections[i].level)].push_back(
        {sections[i].surface.x(), sections[i].surface.y(), static_cast<int>(i)});
  }
  for (std::vector<Spot>& row : by_x) {
    std::sort(row.begin(), row.end(), [](const Spot& a, const Spot& b) {
      return a.x != b.x ? a.x < b.x : a.section < b.section;
    });
  }
  std::vector<char> used(sections.size(), 0);
  std::vector<StemChain> chains;
  Grower grower(view, config, by_x, used);
  for (const int seed : seed_order(sections)) {
    if (used[static_cast<std::size_t>(seed)] != 0) continue;
    used[static_cast<std::size_t>(seed)] = 1;
    StemChain chain = grower.grow(seed);
    if (chain.sections.size() < 2) {
      used[static_cast<std::size_t>(seed)] = 0;
      continue;
    }
    for (const int i : chain.sections)
      used[static_cast<std::size_t>(i)] = 1;
    chains.push_back(std::move(chain));
  }
  return chains;
}

}  // namespace understory
