#include "understory/forest/stems/noisy_cylinder.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/places_on_circle.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/geometry/symmetric_solver.h"

namespace understory {
namespace {

using namespace stem_constants::noisy_cylinder;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// What noise along the beams makes of the places on the circumference, twice round. A place's beams
// have a mean direction and a spread; of both the second moments count.
class PlaceTable {
 public:
  // Of the precision (inverse of the covariance) the parts; these times the outward direction, and
  // on either side; the root of its determinant.
  enum class Column { kXx, kXy, kYy, kOutwardX, kOutwardY, kOutward, kWeight };
  static constexpr int kColumns = 6;  // that are summed up

  // `lobes`: what each direction (column) sees of each place (row). `views`: how much of all comes
  // from it. `scatter`: standard deviation to all sides, metres. `along`: variance that is added
  // along the beams, square metres.
  void fill(const Eigen::MatrixXd& lobes, const Eigen::VectorXd& views, double scatter,
            double along) {
    const Eigen::Index count = lobes.rows();
    const Eigen::Index directions = lobes.cols();
    Eigen::MatrixXd moments(directions, 4);
    for (Eigen::Index k = 0; k < directions; ++k) {
      const double turn = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(directions);
      const Eigen::Vector2d view(std::cos(turn), std::sin(turn));
      moments.row(k) << view.x() * view.x(), view.x() * view.y(), view.y() * view.y(), 1.0;
    }
    const Eigen::MatrixXd seen = lobes * views.asDiagonal() * moments;
    values_.setZero(2 * count + kTogether, kColumns + 1);
    for (Eigen::Index b = 0; b < count; ++b) {
      const double turn = 2.0 * M_PI * (static_cast<double>(b) + 0.5) / static_cast<double>(count);
      const Eigen::Vector2d outward(std::cos(turn), std::sin(turn));
      Eigen::Matrix2d covariance;
      covariance << seen(b, 0), seen(b, 1), seen(b, 1), seen(b, 2);
      covariance = along / seen(b, 3) * covariance;
      covariance += scatter * scatter * Eigen::Matrix2d::Identity();
      const Eigen::Matrix2d precision = covariance.inverse();
      const Eigen::Vector2d out = precision * outward;
      values_.row(b) << precision(0, 0), precision(0, 1), precision(1, 1), out.x(), out.y(),
          outward.dot(out), std::sqrt(precision.determinant());
      values_.row(b + count) = values_.row(b);
    }
  }
  [[nodiscard]] auto at(Column column, Eigen::Index place) const {
    return values_.col(static_cast<Eigen::Index>(column)).segment<kTogether>(place);
  }

 private:
  Eigen::ArrayXXd values_;
};

// A point seen along the stem: place in the plane across it, relative to the start's centre line.
struct FlatPoint {
  Eigen::Vector2d place;
  double rise = 0.0;  // over breast height
  double weight = 1.0;
};

class Estimator {
 public:
  Estimator(const std::vector<SlicePoint>& points, const StemFit& start,
            const NoisyCylinderConfig& config)
      : config_(config), start_(start) {
    // A leaning stem's horizontal section is an ellipse: squeeze the plane along the lean.
    const double lean = start.slope.norm();
    squeeze_ = Eigen::Matrix2d::Identity();
    if (lean > 1e-9) {
      const Eigen::Vector2d along = start.slope / lean;
      squeeze_ -= (1.0 - 1.0 / std::sqrt(1.0 + lean * lean)) * along * along.transpose();
    }
    const auto most = static_cast<std::size_t>(config.max_points);
    const std::size_t stride = std::max<std::size_t>(1, (points.size() + most - 1) / most);
    for (std::size_t i = 0; i < points.size(); i += stride) {
      const SlicePoint& p = points[i];
      const double rise = static_cast<double>(p.height_m) - kBreastHeight;
      const Eigen::Vector2d q(static_cast<double>(p.x), static_cast<double>(p.y));
      flat_.push_back({squeeze_ * (q - start.centre - rise * start.slope), rise,
                       static_cast<double>(p.returns)});
      total_ += flat_.back().weight;
    }
    radius_ = start.radius_m;
    taper_ = start.taper;
    scatter_ = std::clamp(start.rms_m, kFirstScatterLeast, kFirstScatterMost);
    range_noise_ = config.range_noise_m;
    if (range_noise_ > 0.0) scatter_ = std::max(kFirstScatterLeast, scatter_ - range_noise_);
    const double reach = radius_ + config.stray_reach_m;
    stray_density_ = 1.0 / (M_PI * reach * reach);
  }

  NoisyCylinder run() {
    NoisyCylinder result;
    if (flat_.size() < kFewestPoints) return result;
    spread_bins();
    for (int cycle = 0; cycle < config_.cycles; ++cycle) {
      const Vector6 start = parameters();
      if (!step(result)) return result;
      const Vector6 first = parameters() - start;
      if (first.norm() < kSettled) break;
      const Vector6 once = parameters();
      if (!step(result)) return result;
      extrapolate(start, first, parameters() - once);
    }
    result.converged = true;
    const Eigen::Matrix2d back = squeeze_.inverse();
    result.centre = start_.centre + back * centre_;
    result.slope = start_.slope + back * slope_;
    result.radius_m = radius_;
    result.taper = taper_;
    result.scatter_m = scatter_;
    result.range_noise_m = range_noise_;
    result.strays = strays_;
    Matrix6 unsqueeze = Matrix6::Identity();
    unsqueeze.topLeftCorner<2, 2>() = back;
    unsqueeze.block<2, 2>(2, 2) = back;
    result.covariance = unsqueeze * result.covariance * unsqueeze.transpose();
    return result;
  }

 private:
  [[nodiscard]] Vector6 parameters() const {
    Vector6 all;
    all << centre_, slope_, radius_, taper_;
    return all;
  }

  // Expectation maximisation creeps where little is known. Squared extrapolation of two steps
  // (Varadhan and Roland, Scand. J. Stat. 35, 2008, scheme S3) takes it there.
  void extrapolate(const Vector6& start, const Vector6& first, const Vector6& second) {
    const Vector6 change = second - first;
    if (change.norm() < 1e-12) return;
    const double length = std::clamp(first.norm() / change.norm(), 1.0, kMostStretch);
    const Vector6 found = start + 2.0 * length * first + length * length * change;
    if (found[4] < 0.5 * radius_ || found[4] > 2.0 * radius_) return;
    centre_ = found.head<2>();
    slope_ = found.segment<2>(2);
    radius_ = found[4];
    taper_ = found[5];
  }

  // Places on the circumference, near enough to each other that the scatter blurs the gaps.
  void spread_bins() {
    const double gap = range_noise_ > 0.0 ? kNoisyBinScatters : kBinScatters;
    const double wanted = 2.0 * M_PI * radius_ / (gap * scatter_);
    const double quarter = std::clamp(wanted, kFewestBins, kMostBins) / kTogether;
    const auto count = kTogether * static_cast<Eigen::Index>(std::ceil(quarter));
    visible_ = Eigen::ArrayXd::Constant(2 * count + kTogether, 1.0 / static_cast<double>(count));
    views_ = Eigen::VectorXd::Constant(kViews, 1.0 / kViews);
    for (Eigen::ArrayXd* all : {&outward_x_, &outward_y_})
      all->setZero(2 * count + kTogether);
    shares_.resize(count + kTogether);
    for (Eigen::Index b = 0; b < 2 * count; ++b) {
      const double turn =
          2.0 * M_PI * (static_cast<double>(b % count) + 0.5) / static_cast<double>(count);
      outward_x_[b] = std::cos(turn);
      outward_y_[b] = std::sin(turn);
    }
    lobes_.resize(count, kViews);
    for (int k = 0; k < kViews; ++k) {
      const double turn = 2.0 * M_PI * k / kViews;
      lobes_.col(k) =
          (std::cos(turn) * outward_x_.head(count) + std::sin(turn) * outward_y_.head(count))
              .max(0.0);
      lobes_.col(k) /= lobes_.col(k).sum();
    }
  }

  // Sums over the points, each weighted with the chance that it came from each place.
  struct Sums {
    Matrix6 normal = Matrix6::Zero();
    Vector6 right = Vector6::Zero();
    double weight = 0.0;
    double square = 0.0;
    double along = 0.0;  // slope of the log likelihood over the variance of the noise, twice
    double log_likelihood = 0.0;
  };

  // Places in a row: only those near a point's own angle can have given it.
  struct Row {
    Eigen::Index begin;
    Eigen::Index size;
  };
  [[nodiscard]] Row row_near(const Eigen::Vector2d& q, double r, double scatter) const {
    const Eigen::Index count = lobes_.rows();
    const double width = kBlurReach * scatter / std::sqrt(std::max(1e-8, r * q.norm()));
    const auto reach =
        static_cast<Eigen::Index>(width / (2.0 * M_PI) * static_cast<double>(count)) + 1;
    const Eigen::Index size = std::min(count, 2 * reach + 1);
    const auto middle =
        static_cast<Eigen::Index>(rough_turn(q.x(), q.y()) * static_cast<double>(count));
    return {(middle + count - size / 2) % count, size};
  }

  // `seen`: of the places twice round, the returns that came from them.
  void add_point(const FlatPoint& point, Sums& sums, Eigen::ArrayXd& seen) {
    const Eigen::Vector2d q = point.place - centre_ - point.rise * slope_;
    const double r = radius_ + taper_ * point.rise;
    const double inverse = 1.0 / (scatter_ * scatter_);
    const auto [begin, near] = row_near(q, r, scatter_);
    Places density = Places::Zero();
    Places mean_x = Places::Zero();
    Places mean_y = Places::Zero();
    Places square = Places::Zero();
    for (Eigen::Index b = 0; b < near; b += kTogether) {
      const auto x = outward_x_.segment<kTogether>(begin + b);
      const auto y = outward_y_.segment<kTogether>(begin + b);
      const Places squares = (q.x() - r * x).square() + (q.y() - r * y).square();
      Places shares = quick_exp(-0.5 * inverse * squares) * visible_.segment<kTogether>(begin + b);
      // Places beyond the reach take returns that belong to nothing: 2 % fewer sections fit.
      for (Eigen::Index beyond = near - b; beyond < kTogether; ++beyond)
        shares[beyond] = 0.0;
      shares_.segment<kTogether>(b) = shares;
      density += shares;
      mean_x += shares * x;
      mean_y += shares * y;
      square += shares * squares;
    }
    const double scale = (1.0 - strays_) * inverse / (2.0 * M_PI);
    const double all = scale * density.sum() + strays_ * stray_density_;
    const double w = point.weight * scale / all;
    sums.log_likelihood += point.weight * std::log(all);
    sums.square += w * square.sum();
    seen.segment(begin, near) += w * shares_.head(near);
    add_to_system(point, w * density.sum(), w * Eigen::Vector2d(mean_x.sum(), mean_y.sum()), sums);
  }

  // The model q = centre + rise slope + (radius + rise taper) outward is linear in its parameters.
  static void add_to_system(const FlatPoint& point, double weight, const Eigen::Vector2d& outward,
                            Sums& sums) {
    const double h = point.rise;
    sums.weight += weight;
    for (int k = 0; k < 2; ++k) {
      sums.normal(k, k) += weight;
      sums.normal(k, 2 + k) += weight * h;
      sums.normal(2 + k, 2 + k) += weight * h * h;
      sums.normal(k, 4) += outward[k];
      sums.normal(k, 5) += h * outward[k];
      sums.normal(2 + k, 4) += h * outward[k];
      sums.normal(2 + k, 5) += h * h * outward[k];
      sums.right[k] += weight * point.place[k];
      sums.right[2 + k] += weight * h * point.place[k];
    }
    sums.normal(4, 4) += weight;
    sums.normal(4, 5) += weight * h;
    sums.normal(5, 5) += weight * h * h;
    const double out = outward.dot(point.place);
    sums.right[4] += out;
    sums.right[5] += h * out;
  }

  // The same where noise lies along the beams. A place's Gaussian is longer along the mean
  // direction of the beams that reach it. Terms of the system are weighted with its precision.
  void add_noisy_point(const FlatPoint& point, Sums& sums, Eigen::ArrayXd& seen) {
    const Eigen::Vector2d q = point.place - centre_ - point.rise * slope_;
    const double r = radius_ + taper_ * point.rise;
    const Row row = row_near(q, r, std::hypot(scatter_, range_noise_));
    const Eigen::Index begin = row.begin;
    const Eigen::Index near = row.size;
    using Column = PlaceTable::Column;
    std::array<Places, PlaceTable::kColumns> columns;
    columns.fill(Places::Zero());
    Places squares = Places::Zero();  // of the precision times the displacement
    Places distances = Places::Zero();
    for (Eigen::Index b = 0; b < near; b += kTogether) {
      const auto at = [&](Column column) { return table_.at(column, begin + b); };
      const Places x = q.x() - r * outward_x_.segment<kTogether>(begin + b);
      const Places y = q.y() - r * outward_y_.segment<kTogether>(begin + b);
      const Places ux = at(Column::kXx) * x + at(Column::kXy) * y;
      const Places uy = at(Column::kXy) * x + at(Column::kYy) * y;
      const Places distance = x * ux + y * uy;
      Places shares =
          quick_exp(-0.5 * distance) * at(Column::kWeight) * visible_.segment<kTogether>(begin + b);
      for (Eigen::Index beyond = near - b; beyond < kTogether; ++beyond)
        shares[beyond] = 0.0;
      shares_.segment<kTogether>(b) = shares;
      for (int k = 0; k < PlaceTable::kColumns; ++k)
        columns[static_cast<std::size_t>(k)] += shares * at(static_cast<Column>(k));
      squares += shares * (ux.square() + uy.square());
      distances += shares * distance;
    }
    const double density = shares_.head(near).sum();
    const double scale = (1.0 - strays_) / (2.0 * M_PI);
    const double all = scale * density + strays_ * stray_density_;
    const double w = point.weight * scale / all;
    const auto sum = [&](Column column) {
      return w * columns[static_cast<std::size_t>(column)].sum();
    };
    sums.log_likelihood += point.weight * std::log(all);
    sums.weight += w * density;
    // How the likelihood grows with the variance to all sides and with that along the beams; and
    // what of a displacement is scatter.
    const double s2 = scatter_ * scatter_;
    const double to_all_sides = w * squares.sum() - sum(Column::kXx) - sum(Column::kYy);
    const double along = (w * distances.sum() - 2.0 * w * density - s2 * to_all_sides) / along_;
    sums.along += along;
    sums.square += 2.0 * s2 * w * density + s2 * s2 * (to_all_sides - kLessAlong * along);
    seen.segment(begin, near) += w * shares_.head(near);
    Eigen::Matrix2d precision;
    precision << sum(Column::kXx), sum(Column::kXy), sum(Column::kXy), sum(Column::kYy);
    const Eigen::Vector2d outward(sum(Column::kOutwardX), sum(Column::kOutwardY));
    add_to_noisy_system(point, precision, outward, sum(Column::kOutward), sums);
  }

  // As add_to_system. `precision`: sum of the precisions of the places, each times its weight;
  // `outward`: of these times the outward directions; `both`: times these on either side.
  static void add_to_noisy_system(const FlatPoint& point, const Eigen::Matrix2d& precision,
                                  const Eigen::Vector2d& outward, double both, Sums& sums) {
    const double h = point.rise;
    Matrix6& normal = sums.normal;
    normal.block<2, 2>(0, 0) += precision;
    normal.block<2, 2>(0, 2) += h * precision;
    normal.block<2, 2>(2, 2) += h * h * precision;
    normal.block<2, 1>(0, 4) += outward;
    normal.block<2, 1>(0, 5) += h * outward;
    normal.block<2, 1>(2, 4) += h * outward;
    normal.block<2, 1>(2, 5) += h * h * outward;
    normal(4, 4) += both;
    normal(4, 5) += h * both;
    normal(5, 5) += h * h * both;
    const Eigen::Vector2d place = precision * point.place;
    const double out = outward.dot(point.place);
    sums.right.head<2>() += place;
    sums.right.segment<2>(2) += h * place;
    sums.right[4] += out;
    sums.right[5] += h * out;
  }

  // One step of scoring for the variance of the noise.
  void learn_range_noise(const Sums& sums) {
    const double variance = range_noise_ * range_noise_;
    const double whole = scatter_ * scatter_ + variance;
    const double step = whole * whole * sums.along / sums.weight;
    range_noise_ =
        std::clamp(std::sqrt(std::max(0.0, variance + step)), kLeastRangeNoise, kMostRangeNoise);
  }

  // The scatter is smaller along the beams. The width of a beam and an error of heading shift a
  // point sideways, and hardly change its range. So part of the noise lies within the scatter.
  [[nodiscard]] double variance_along() const {
    const double noise = range_noise_ * range_noise_;
    return std::max(kLeastShareAlong * noise, noise - kLessAlong * scatter_ * scatter_);
  }

  bool step(NoisyCylinder& result) {
    Sums sums;
    Eigen::ArrayXd seen = Eigen::ArrayXd::Zero(visible_.size());
    const bool noisy = range_noise_ > 0.0;
    if (noisy) {
      along_ = variance_along();
      table_.fill(lobes_, views_, scatter_, along_);
    }
    for (const FlatPoint& point : flat_)
      noisy ? add_noisy_point(point, sums, seen) : add_point(point, sums, seen);
    if (sums.weight < std::min(kLeastWeight, 1.0 - config_.most_strays) * total_) return false;
    result.log_likelihood = sums.log_likelihood / total_;
    // Without noise the system is in units of the scatter's variance.
    const double s2 = noisy ? 1.0 : scatter_ * scatter_;
    const auto prior = [&](int i, double value, double sd) {
      sums.normal(i, i) += s2 / (sd * sd);
      sums.right[i] += s2 / (sd * sd) * value;
    };
    prior(2, 0.0, config_.slope_sd);
    prior(3, 0.0, config_.slope_sd);
    prior(5, config_.usual_taper, config_.taper_sd);
    const Matrix6 normal = sums.normal.selfadjointView<Eigen::Upper>();
    const SymmetricSolver<6> solver(normal);
    Vector6 found = solver.solve(sums.right);
    found[4] = std::max(found[4], config_.held_radius_m);
    if (!found.allFinite() || found[4] < kLeastRadius || found.head<2>().norm() > kFarthest)
      return false;
    centre_ = found.head<2>();
    slope_ = found.segment<2>(2);
    radius_ = found[4];
    taper_ = found[5];
    result.covariance = s2 * solver.inverse();
    scatter_ = std::clamp(std::sqrt(0.5 * sums.square / sums.weight), kLeastScatter,
                          config_.most_scatter_m);
    if (noisy && config_.find_range_noise) learn_range_noise(sums);
    strays_ = std::clamp(1.0 - sums.weight / total_, kLeastStrays, config_.most_strays);
    learn_views(seen.head(lobes_.rows()) + seen.segment(lobes_.rows(), lobes_.rows()));
    return true;
  }

  // Beams from one direction fall evenly over the stem's width. So they hit places in proportion to
  // the cosine of their angle to it, and none beyond a right angle. What is seen is a sum of such
  // lobes. That ties the radius to the width seen where the side away from the scanner is unknown.
  void learn_views(const Eigen::ArrayXd& seen) {
    for (int round = 0; round < kViewRounds; ++round) {
      const auto visible = visible_.head(seen.size());
      const Eigen::ArrayXd ratio = (visible > 1e-12).select(seen / visible, 0.0);
      views_.array() *= (lobes_.transpose() * ratio.matrix()).array();
      views_ = (views_.array() / views_.sum()).max(kLeastView);
      visible_.head(seen.size()) = (lobes_ * views_).array();
      visible_.segment(seen.size(), seen.size()) = visible_.head(seen.size());
    }
  }

  const NoisyCylinderConfig& config_;
  const StemFit& start_;
  Eigen::Matrix2d squeeze_;
  std::vector<FlatPoint> flat_;
  double total_ = 0.0;
  // Relative to the start's centre line, in the squeezed plane.
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();
  double radius_ = 0.0;
  double taper_ = 0.0;
  double scatter_ = 0.0;
  double range_noise_ = 0.0;  // 0: none beside the scatter
  double along_ = 0.0;        // variance that is added to the scatter along the beams
  PlaceTable table_;          // where there is some
  double strays_ = kFirstStrays;
  double stray_density_ = 1.0;
  // Of the places, twice round: share of the returns that come from each, and its direction.
  Eigen::ArrayXd visible_;
  Eigen::ArrayXd outward_x_;
  Eigen::ArrayXd outward_y_;
  Eigen::VectorXd views_;  // share of the returns from each direction
  Eigen::MatrixXd lobes_;  // what each direction (column) sees of each place (row)
  Eigen::ArrayXd shares_;  // of a point: the chances that it came from the places near it
};

}  // namespace

NoisyCylinder fit_noisy_cylinder(const std::vector<SlicePoint>& points, const StemFit& start,
                                 const NoisyCylinderConfig& config) {
  return Estimator(points, start, config).run();
}

}  // namespace understory
