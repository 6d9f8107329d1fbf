#include "understory/forest/dead_wood/log_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "understory/forest/dead_wood_constants.h"
#include "understory/forest/stems/arc_bins.h"
#include "understory/forest/stems/point_index.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace forest_constants::log_search;

// A straight piece of a lying stem: a point of its centre line, and the direction along it.
struct Piece {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();
  double low_m = 0.0;  // along from the place
  double high_m = 0.0;
  double radius_m = 0.0;  // at the place
  double taper = 0.0;     // of the radius, per metre along
};

// The points with their heights in the frame of the search, by place.
class Points {
 public:
  Points(std::vector<SlicePoint>& points, const Raster& ground) : points_(points), index_(points) {
    for (const SlicePoint& point : points) {
      const auto x = static_cast<double>(point.x);
      const auto y = static_cast<double>(point.y);
      z_.push_back(ground.interpolate(x, y) + static_cast<double>(point.height_m));
    }
  }
  [[nodiscard]] std::size_t size() const { return z_.size(); }
  [[nodiscard]] Eigen::Vector3d at(std::size_t i) const {
    return {static_cast<double>(points_[i].x), static_cast<double>(points_[i].y), z_[i]};
  }
  [[nodiscard]] double height_m(std::size_t i) const {
    return static_cast<double>(points_[i].height_m);
  }
  [[nodiscard]] std::uint32_t returns(std::size_t i) const { return points_[i].returns; }
  // Those of squares within `reach` of the line between two places, each once.
  template <typename Visit>
  void along(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double reach,
             const Visit& visit) const {
    const Eigen::Vector2d low = a.head<2>().cwiseMin(b.head<2>());
    const Eigen::Vector2d high = a.head<2>().cwiseMax(b.head<2>());
    const Eigen::Vector2d way = (b - a).head<2>();
    const double length = way.norm();
    const Eigen::Vector2d along =
        length > 0.0 ? Eigen::Vector2d(way / length) : Eigen::Vector2d::UnitX();
    index_.near(0.5 * (low + high), 0.5 * (high - low).maxCoeff() + reach, [&](std::size_t i) {
      const Eigen::Vector2d off = at(i).head<2>() - a.head<2>();
      const double t = off.dot(along);
      const double across = off.x() * along.y() - off.y() * along.x();
      if (t > -reach && t < length + reach && std::abs(across) < reach) visit(i);
    });
  }

 private:
  const std::vector<SlicePoint>& points_;
  PointIndex index_;
  std::vector<double> z_;
};

Eigen::Matrix3d upright_frame(const Eigen::Vector3d& along) {
  // Rows: level across, up across, along.
  Eigen::Matrix3d frame;
  const Eigen::Vector3d across = along.cross(Eigen::Vector3d::UnitZ()).normalized();
  frame.row(0) = across.transpose();
  frame.row(1) = across.cross(along).transpose();
  frame.row(2) = along.transpose();
  return frame;
}

// Every n-th where they are many.
void thin_out(std::vector<Eigen::Vector3d>& points) {
  const std::size_t stride = points.size() / kEnoughNear + 1;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points.size(); i += stride)
    points[kept++] = points[i];
  points.resize(kept);
}

// The line through two points near a place that most others follow; nothing where none does.
std::optional<Piece> start_at(const Points& points, const std::vector<std::size_t>& cell,
                              std::uint64_t place) {
  const Eigen::Vector3d middle = points.at(cell[cell.size() / 2]);
  std::vector<Eigen::Vector3d> near;
  points.along(middle, middle, 1.0 + kSeedCell,
               [&](std::size_t i) { near.push_back(points.at(i)); });
  thin_out(near);
  Random random(kLogSeed, place);
  std::optional<Piece> best;
  double best_score = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Eigen::Vector3d a = points.at(cell[random.below(cell.size())]);
    const Eigen::Vector3d b = near[random.below(near.size())];
    const Eigen::Vector3d way = b - a;
    const double run = way.head<2>().norm();
    if (run < kPairApart || std::abs(way.z()) > kSteepest * run) continue;
    const Eigen::Vector3d along = way.normalized();
    std::uint32_t steps = 0;
    int on = 0;
    int around = 0;
    for (const Eigen::Vector3d& point : near) {
      const double t = (point - a).dot(along);
      if (std::abs(t) >= kStartHalf) continue;
      const double off = (point - a - t * along).norm();
      if (off < kLineReach) {
        steps |= 1U << static_cast<unsigned>((t + kStartHalf) / kStep);
        ++on;
      } else if (off < kLineAround) {
        ++around;
      }
    }
    const int covered = std::popcount(steps);
    const double share = on / static_cast<double>(on + around);
    if (covered < kLeastSteps || share < kLeastNear) continue;
    const double score = covered * share;
    if (score <= best_score) continue;
    best_score = score;
    best = Piece{a, along, -kStartHalf, kStartHalf, 0.0, 0.0};
  }
  return best;
}

// The points near a piece, laid so that it stands on end: the height is along, and its place is at
// breast height.
std::vector<SlicePoint> on_end(const Points& points, const Piece& piece,
                               const Eigen::Matrix3d& frame, double reach) {
  std::vector<SlicePoint> laid;
  points.along(piece.place + piece.low_m * piece.along, piece.place + piece.high_m * piece.along,
               reach, [&](std::size_t i) {
                 const Eigen::Vector3d q = frame * (points.at(i) - piece.place);
                 if (q.z() < piece.low_m || q.z() > piece.high_m || q.head<2>().norm() > reach)
                   return;
                 laid.push_back({static_cast<float>(q.x()), static_cast<float>(q.y()),
                                 static_cast<float>(q.z() + kBreastHeight), points.returns(i)});
               });
  return laid;
}

Piece piece_of(const Piece& before, const Eigen::Matrix3d& frame, const StemFit& fit) {
  Piece piece = before;
  piece.place += frame.transpose() * Eigen::Vector3d(fit.centre.x(), fit.centre.y(), 0.0);
  piece.along =
      (frame.transpose() * Eigen::Vector3d(fit.slope.x(), fit.slope.y(), 1.0)).normalized();
  piece.radius_m = fit.radius_m;
  piece.taper = fit.taper;
  return piece;
}

// The first cylinder about a line through its surface.
std::optional<Piece> first_fit(const Points& points, const Piece& line) {
  const Eigen::Matrix3d frame = upright_frame(line.along);
  const std::vector<SlicePoint> laid = on_end(points, line, frame, kFirstReach);
  std::optional<Piece> best;
  double most = 0.0;
  const StemDetectorConfig config;
  for (const double radius : kFirstRadii) {
    StemFit start;
    start.centre = {0.0, -radius};
    start.radius_m = radius;
    const StemFitResult fit = fit_stem(laid, start, config);
    if (!fit.converged || fit.stem.radius_m > kThickestRadius) continue;
    const double score = fit.evidence.on - kInsideWeight * fit.evidence.inside;
    if (score <= most) continue;
    most = score;
    best = piece_of(line, frame, fit.stem);
  }
  return best;
}

// Which parts along hold points of the surface.
struct Cover {
  int pieces = 0;
  double low_m = 0.0;
  double high_m = 0.0;
};

// One part along.
struct Part {
  int on = 0;
  int around = 0;
  double low_m = std::numeric_limits<double>::infinity();
  double high_m = -std::numeric_limits<double>::infinity();
  // Ground and plants lie on all sides of the surface.
  [[nodiscard]] bool shows() const {
    return on >= kLeastOn && static_cast<double>(on) >= kLeastOnShare * (on + around);
  }
};

Cover cover_of(const Points& points, const Piece& piece) {
  const double gap = kLongestGap + kPiece;
  const double low = piece.low_m - gap;
  const double high = piece.high_m + gap;
  std::vector<Part> parts(static_cast<std::size_t>((high - low) / kPiece) + 1);
  points.along(piece.place + low * piece.along, piece.place + high * piece.along,
               piece.radius_m + kBeside, [&](std::size_t i) {
                 const Eigen::Vector3d q = points.at(i) - piece.place;
                 const double t = q.dot(piece.along);
                 if (t < low || t >= high) return;
                 Part& part = parts[static_cast<std::size_t>((t - low) / kPiece)];
                 const double out =
                     (q - t * piece.along).norm() - (piece.radius_m + piece.taper * t);
                 if (std::abs(out) < kLogBand) {
                   ++part.on;
                   part.low_m = std::min(part.low_m, t);
                   part.high_m = std::max(part.high_m, t);
                 } else if (out < kBeside) {
                   ++part.around;
                 }
               });
  // From the middle outwards, without wide gaps.
  const auto middle =
      static_cast<std::ptrdiff_t>((0.5 * (piece.low_m + piece.high_m) - low) / kPiece);
  const auto most_empty = static_cast<int>(kLongestGap / kPiece);
  Cover cover{0, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto walk = [&](std::ptrdiff_t from, std::ptrdiff_t step) {
    int empty = 0;
    for (std::ptrdiff_t i = from;
         i >= 0 && i < static_cast<std::ptrdiff_t>(parts.size()) && empty <= most_empty;
         i += step) {
      const Part& part = parts[static_cast<std::size_t>(i)];
      if (!part.shows()) {
        ++empty;
        continue;
      }
      empty = 0;
      ++cover.pieces;
      cover.low_m = std::min(cover.low_m, part.low_m);
      cover.high_m = std::max(cover.high_m, part.high_m);
    }
  };
  walk(middle, 1);
  walk(middle - 1, -1);
  return cover;
}

// A piece about the middle of what it covers.
Piece centred(Piece piece, const Cover& cover) {
  const double shift = 0.5 * (cover.low_m + cover.high_m);
  piece.place += shift * piece.along;
  piece.radius_m += shift * piece.taper;
  piece.low_m = cover.low_m - shift;
  piece.high_m = cover.high_m - shift;
  return piece;
}

std::optional<Piece> grown(const Points& points, Piece piece) {
  const StemDetectorConfig config;
  for (int round = 0; round < 30; ++round) {
    const Cover cover = cover_of(points, piece);
    if (cover.pieces == 0) return std::nullopt;
    const double before = piece.high_m - piece.low_m;
    piece = centred(piece, cover);
    if (piece.high_m - piece.low_m > kLongestLog) return std::nullopt;
    if (round > 0 && piece.high_m - piece.low_m < before + kPiece) return piece;
    const Eigen::Matrix3d frame = upright_frame(piece.along);
    StemFit start;
    start.radius_m = piece.radius_m;
    const StemFitResult fit =
        fit_stem(on_end(points, piece, frame, piece.radius_m + 0.15), start, config);
    if (!fit.converged || fit.stem.radius_m > kThickestRadius) return std::nullopt;
    piece = piece_of(piece, frame, fit.stem);
  }
  return piece;
}

// What the points tell of a cylinder between its ends.
struct LogSight {
  int on = 0;
  int returns = 0;
  int inside = 0;
  double arc_deg = 0.0;      // see ArcBins::even_deg
  double round_share = 0.0;  // of its sections, those that show some width
  double lowest_m = std::numeric_limits<double>::infinity();  // above the ground
};

LogSight look_at(const Points& points, const Piece& piece) {
  LogSight sight;
  ArcBins arc;
  std::vector<ArcBins> sections(static_cast<std::size_t>((piece.high_m - piece.low_m) / kSection) +
                                1);
  const Eigen::Matrix3d frame = upright_frame(piece.along);
  points.along(piece.place + piece.low_m * piece.along, piece.place + piece.high_m * piece.along,
               piece.radius_m + kBeside, [&](std::size_t i) {
                 const Eigen::Vector3d q = frame * (points.at(i) - piece.place);
                 if (q.z() < piece.low_m || q.z() > piece.high_m) return;
                 const double out = q.head<2>().norm() - (piece.radius_m + piece.taper * q.z());
                 if (out < -kLogBand) ++sight.inside;
                 if (std::abs(out) >= kLogBand) return;
                 ++sight.on;
                 sight.returns += static_cast<int>(points.returns(i));
                 sight.lowest_m = std::min(sight.lowest_m, points.height_m(i));
                 arc.add(q.x(), q.y());
                 sections[static_cast<std::size_t>((q.z() - piece.low_m) / kSection)].add(q.x(),
                                                                                          q.y());
               });
  sight.arc_deg = arc.even_deg();
  const auto round = std::count_if(sections.begin(), sections.end(), [](const ArcBins& section) {
    return section.covered_deg() >= kLeastSectionArc;
  });
  sight.round_share = static_cast<double>(round) / static_cast<double>(sections.size());
  return sight;
}

double diameter_sd(const StemFit& fit) {
  return 2.0 * std::sqrt(std::max(0.0, fit.covariance(2, 2)));
}

bool is_log(const StemFitResult& fit, const Piece& piece, const LogSight& sight) {
  const double diameter = 2.0 * piece.radius_m;
  const double thin_end =
      2.0 * (piece.radius_m + std::min(piece.taper * piece.low_m, piece.taper * piece.high_m));
  return piece.high_m - piece.low_m >= std::max(kShortestLog, kLeastSlender * diameter) &&
         thin_end > 0.0 && sight.arc_deg >= kLeastLogArc && sight.round_share >= kRoundShare &&
         sight.inside <= kMostInsideLog * sight.on && sight.lowest_m <= kLyingBelow &&
         fit.evidence.scatter_m <= kMostLogScatter && fit.evidence.outside_ratio <= kMostOutside &&
         diameter_sd(fit.stem) <= kMostDiameterSd * diameter;
}

LogFit log_of(const Piece& piece, const StemFitResult& fit, const LogSight& sight) {
  LogFit log;
  log.returns = sight.returns;
  log.quality = sight.on / fit.evidence.scatter_m;
  log.from = piece.place + piece.low_m * piece.along;
  log.to = piece.place + piece.high_m * piece.along;
  log.diameter_m = 2.0 * (piece.radius_m + piece.taper * piece.low_m);
  log.diameter_to_m = 2.0 * (piece.radius_m + piece.taper * piece.high_m);
  if (log.diameter_to_m > log.diameter_m) {
    std::swap(log.from, log.to);
    std::swap(log.diameter_m, log.diameter_to_m);
  }
  log.diameter_sd_m = std::hypot(kSdTimes * diameter_sd(fit.stem), kFormSd);
  return log;
}

// The last fit, of all that shows; nothing where it is no log.
std::optional<LogFit> judged(const Points& points, Piece piece) {
  const Eigen::Matrix3d frame = upright_frame(piece.along);
  StemFit start;
  start.radius_m = piece.radius_m;
  const StemFitResult fit = fit_stem(on_end(points, piece, frame, piece.radius_m + kFitReach),
                                     start, StemDetectorConfig());
  if (!fit.converged) return std::nullopt;
  piece = piece_of(piece, frame, fit.stem);
  const Cover cover = cover_of(points, piece);
  if (cover.pieces == 0) return std::nullopt;
  piece = centred(piece, cover);
  const double length = piece.high_m - piece.low_m;
  if (static_cast<double>(cover.pieces) < kLeastCovered * length / kPiece) return std::nullopt;
  const LogSight sight = look_at(points, piece);
  if (!is_log(fit, piece, sight)) return std::nullopt;
  return log_of(piece, fit, sight);
}

// Whether most of a log lies along another one.
bool lies_along(const LogFit& log, const LogFit& other) {
  const Eigen::Vector3d way = other.to - other.from;
  const double length = way.norm();
  int near = 0;
  constexpr int kPlaces = 11;
  for (int i = 0; i < kPlaces; ++i) {
    const Eigen::Vector3d place = log.from + i / (kPlaces - 1.0) * (log.to - log.from);
    const double t = std::clamp((place - other.from).dot(way) / length, 0.0, length);
    const double off = (place - other.from - t / length * way).norm();
    near += off < 0.5 * (log.diameter_m + other.diameter_m) ? 1 : 0;
  }
  return 2 * near > kPlaces;
}

bool of_a_stem(const SlicePoint& point, const StemFit& stem) {
  const double up = static_cast<double>(point.height_m) - kBreastHeight;
  const Eigen::Vector2d off(static_cast<double>(point.x) - stem.centre.x() - up * stem.slope.x(),
                            static_cast<double>(point.y) - stem.centre.y() - up * stem.slope.y());
  return off.norm() < stem.radius_m + kStemMargin;
}

// Leaves what may be of a log. A thinned point may lie where the terrain ends.
void drop_others(std::vector<SlicePoint>& points, const Raster& ground,
                 const std::vector<StemFit>& stems) {
  std::erase_if(points, [&](const SlicePoint& point) {
    return static_cast<double>(point.height_m) > kHighestLog ||
           std::isnan(
               ground.interpolate(static_cast<double>(point.x), static_cast<double>(point.y)));
  });
  const PointIndex index(points);
  std::vector<char> taken(points.size(), 0);
  for (const StemFit& stem : stems) {
    index.near(stem.centre, stem.radius_m + 1.0, [&](std::size_t i) {
      if (of_a_stem(points[i], stem)) taken[i] = 1;
    });
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (taken[i] == 0) points[kept++] = points[i];
  }
  points.resize(kept);
}

}  // namespace

std::vector<LogFit> find_logs(std::vector<SlicePoint>& points, const Raster& ground,
                              const std::vector<StemFit>& stems, const GroundArea& area,
                              const ProgressSink& progress) {
  drop_others(points, ground, stems);
  const Points all(points, ground);
  std::vector<std::vector<std::size_t>> cells;
  std::vector<std::uint64_t> places;
  const auto cell_of = [](double value) { return static_cast<int>(std::floor(value / kSeedCell)); };
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Eigen::Vector3d point = all.at(i);
    const std::uint64_t place = hash_numbers(static_cast<std::uint64_t>(cell_of(point.x())),
                                             static_cast<std::uint64_t>(cell_of(point.y())));
    if (places.empty() || places.back() != place) {
      places.push_back(place);
      cells.emplace_back();
    }
    cells.back().push_back(i);
  }
  std::vector<std::optional<LogFit>> found(cells.size());
  parallel_for(cells.size(), 16, [&](std::size_t i) {
    progress.poll();
    if (cells[i].size() < kLeastInCell) return;
    const std::optional<Piece> line = start_at(all, cells[i], places[i]);
    if (!line) return;
    const std::optional<Piece> first = first_fit(all, *line);
    if (!first) return;
    if (const std::optional<Piece> whole = grown(all, *first)) found[i] = judged(all, *whole);
  });
  std::vector<LogFit> logs;
  for (const std::optional<LogFit>& log : found) {
    if (log) logs.push_back(*log);
  }
  std::sort(logs.begin(), logs.end(), [](const LogFit& a, const LogFit& b) {
    if (a.quality != b.quality) return a.quality > b.quality;
    return a.from.x() != b.from.x() ? a.from.x() < b.from.x() : a.from.y() < b.from.y();
  });
  std::vector<LogFit> kept;
  for (const LogFit& log : logs) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const LogFit& other) {
      return lies_along(log, other) || lies_along(other, log);
    });
    if (!known) kept.push_back(log);
  }
  std::erase_if(kept, [&](const LogFit& log) { return !area.contains(log.middle().head<2>()); });
  std::sort(kept.begin(), kept.end(), [](const LogFit& a, const LogFit& b) {
    return a.middle().x() != b.middle().x() ? a.middle().x() < b.middle().x()
                                            : a.middle().y() < b.middle().y();
  });
  return kept;
}

double log_search_reach() {
  return 0.5 * kLongestLog + 2.0;
}

}  // namespace understory
