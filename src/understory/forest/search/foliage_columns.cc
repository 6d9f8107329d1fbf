#include "understory/forest/search/foliage_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "understory/forest/foliage_constants.h"
#include "understory/forest/search/density_peaks.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace foliage_constants;

SparsePoints in_plane(const std::vector<DensityPeak>& peaks) {
  SparsePoints points;
  for (const DensityPeak& peak : peaks)
    points.emplace_back(peak.place.x(), peak.place.y(), 0.0);
  return points;
}

// A straight line that many slices show.
struct Column {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // at breast height
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  double contrast = 0.0;  // summed over its slices
};

class ColumnSearch {
 public:
  ColumnSearch(const std::vector<SlicePoint>& points, const std::vector<char>& explained,
               const StemDetectorConfig& config, const GroundArea& area,
               const ProgressSink& progress)
      : lowest_m_(config.lowest_m) {
    const double span = config.highest_m - config.lowest_m;
    const auto count = static_cast<std::size_t>(std::max(1.0, std::round(span / config.slice_m)));
    thickness_m_ = span / static_cast<double>(count);
    std::vector<std::vector<Eigen::Vector2f>> slices(count);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2f place(points[i].x, points[i].y);
      const double above = static_cast<double>(points[i].height_m) - lowest_m_;
      if (explained[i] != 0 || above < 0.0 || above >= span ||
          !area.contains(place.cast<double>())) {
        continue;
      }
      slices[std::min(count - 1, static_cast<std::size_t>(above / thickness_m_))].push_back(place);
    }
    for (const std::vector<Eigen::Vector2f>& slice : slices) {
      peaks_.push_back(find_density_peaks(slice, progress));
      grids_.emplace_back(in_plane(peaks_.back()));
    }
  }

  std::vector<StemFit> run(const ProgressSink& progress) const {
    std::vector<Column> columns;
    const std::size_t first = std::min(slices_in(kFirstWithin), peaks_.size());
    for (std::size_t a = 0; a < first; ++a) {
      std::vector<std::vector<Column>> found(peaks_[a].size());
      parallel_for(found.size(), 64, [&](std::size_t i) {
        progress.poll();
        found[i] = columns_from(a, peaks_[a][i].place);
      });
      for (const std::vector<Column>& part : found)
        columns.insert(columns.end(), part.begin(), part.end());
    }
    return best_of(std::move(columns));
  }

 private:
  // Slices of so many metres.
  [[nodiscard]] std::size_t slices_in(double height_m) const {
    return static_cast<std::size_t>(std::round(height_m / thickness_m_));
  }
  // Of the middle of a slice over breast height.
  [[nodiscard]] double rise_of(std::size_t slice) const {
    return lowest_m_ + (static_cast<double>(slice) + 0.5) * thickness_m_ - kBreastHeight;
  }

  // Lines from a place of a slice to peaks of higher ones, if enough slices show them.
  [[nodiscard]] std::vector<Column> columns_from(std::size_t a,
                                                 const Eigen::Vector2d& start) const {
    std::vector<Column> columns;
    const std::size_t last = std::min(peaks_.size() - 1, a + slices_in(kMostSpan));
    for (std::size_t b = a + slices_in(kLeastSpan); b <= last; ++b) {
      const double rise = rise_of(b) - rise_of(a);
      const double reach = kMostSlope * rise;
      grids_[b].around({start.x(), start.y(), 0.0}, reach, [&](int i) {
        const Eigen::Vector2d way = peaks_[b][static_cast<std::size_t>(i)].place - start;
        if (way.norm() > reach) return;
        Column column;
        column.slope = way / rise;
        column.centre = start - rise_of(a) * column.slope;
        if (is_shown(column)) columns.push_back(column);
      });
    }
    return columns;
  }

  // The peak of a slice that lies on the line, if there is one.
  [[nodiscard]] const DensityPeak* peak_of(const Column& column, std::size_t slice) const {
    const Eigen::Vector2d place = column.centre + rise_of(slice) * column.slope;
    const int found = grids_[slice].nearest({place.x(), place.y(), 0.0}, kOffLine, 0.0).index;
    return found < 0 ? nullptr : &peaks_[slice][static_cast<std::size_t>(found)];
  }

  // Whether enough slices show the line; sums up how clearly.
  bool is_shown(Column& column) const {
    const std::size_t low = std::min(slices_in(kShownWithin), peaks_.size());
    const auto most_missing =
        static_cast<std::size_t>((1.0 - kShownShare) * static_cast<double>(low));
    std::size_t missing = 0;
    for (std::size_t s = 0; s < peaks_.size(); ++s) {
      const DensityPeak* peak = peak_of(column, s);
      if (peak != nullptr) column.contrast += std::min(kMostContrast, peak->contrast);
      if (peak == nullptr && s < low && ++missing > most_missing) return false;
    }
    return true;
  }

  // The clearest ones, none near another.
  [[nodiscard]] std::vector<StemFit> best_of(std::vector<Column> columns) const {
    std::sort(columns.begin(), columns.end(), [](const Column& a, const Column& b) {
      if (a.contrast != b.contrast) return a.contrast > b.contrast;
      if (a.centre.x() != b.centre.x()) return a.centre.x() < b.centre.x();
      if (a.centre.y() != b.centre.y()) return a.centre.y() < b.centre.y();
      return a.slope.x() != b.slope.x() ? a.slope.x() < b.slope.x() : a.slope.y() < b.slope.y();
    });
    SparsePoints centres;
    for (const Column& column : columns)
      centres.emplace_back(column.centre.x(), column.centre.y(), 0.0);
    const PlaneGrid grid(centres);
    std::vector<char> taken(columns.size(), 0);
    std::vector<StemFit> stems;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (taken[i] != 0) continue;
      stems.push_back(stem_of(columns[i]));
      grid.around(centres[i], kApart, [&](int other) {
        const auto k = static_cast<std::size_t>(other);
        if ((centres[k] - centres[i]).norm() <= kApart) taken[k] = 1;
      });
    }
    return stems;
  }

  // The line through the peaks of a column, by least squares.
  [[nodiscard]] StemFit stem_of(const Column& column) const {
    StemFit stem;
    stem.radius_m = kFirstRadius;
    stem.rms_m = kFirstScatter;
    double rises = 0.0;
    double squares = 0.0;
    Eigen::Vector2d places = Eigen::Vector2d::Zero();
    Eigen::Vector2d products = Eigen::Vector2d::Zero();
    for (std::size_t s = 0; s < peaks_.size(); ++s) {
      const DensityPeak* peak = peak_of(column, s);
      if (peak == nullptr) continue;
      const double rise = rise_of(s);
      rises += rise;
      squares += rise * rise;
      places += peak->place;
      products += rise * peak->place;
      const Eigen::Vector2f place = peak->place.cast<float>();
      stem.slices.push_back({static_cast<float>(rise + kBreastHeight), place.x(), place.y(),
                             static_cast<float>(kFirstRadius), static_cast<float>(kFirstScatter),
                             360.0F});
    }
    const auto count = static_cast<double>(stem.slices.size());
    stem.slope = (count * products - rises * places) / (count * squares - rises * rises);
    stem.centre = (places - rises * stem.slope) / count;
    return stem;
  }

  double lowest_m_;
  double thickness_m_ = 0.0;
  std::vector<std::vector<DensityPeak>> peaks_;  // by slice
  std::vector<PlaneGrid> grids_;                 // of the same
};

}  // namespace

std::vector<StemFit> find_foliage_columns(const std::vector<SlicePoint>& points,
                                          const std::vector<char>& explained,
                                          const StemDetectorConfig& config,
                                          const StemSearchArea& where,
                                          const ProgressSink& progress) {
  return ColumnSearch(points, explained, config, where.area.grown(kSearchBeyond), progress)
      .run(progress);
}

bool stands_in_foliage(const std::vector<SlicePoint>& near, const StemFit& column) {
  const StemAxis axis(column);
  std::array<int, kSides> points{};
  for (const SlicePoint& point : near) {
    const AxisPlace place = axis.place(point);
    if (place.distance_m < column.radius_m + kFoliageFrom || place.distance_m > kFoliageTo)
      continue;
    const double turn = std::atan2(place.outward.y(), place.outward.x()) / (2.0 * M_PI) + 0.5;
    const auto side = static_cast<std::size_t>(turn * static_cast<double>(kSides));
    ++points[std::min(kSides - 1, side)];
  }
  return std::count_if(points.begin(), points.end(),
                       [](int count) { return count >= kLeastFoliage; }) >= kLeastSides;
}

bool is_too_stout(const StemFit& column, double slices_end_m) {
  if (column.highest_m > slices_end_m - kGoesOnWithin) return false;
  return 2.0 * column.radius_m > kMostStout * (column.highest_m - kBreastHeight);
}

}  // namespace understory
