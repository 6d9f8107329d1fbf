#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "understory/geometry/plane/plot_shape.h"

namespace understory {

// A sample plot as its file tells it, in the coordinates that were asked for. It is a circle
// (centre and radius in metres) or rings (outer ones anticlockwise, holes clockwise).
struct PlotOutline {
  std::string id;
  Eigen::Vector2d centre = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  double radius_m = std::numeric_limits<double>::quiet_NaN();
  std::vector<PlaneRing> rings;
};

// Whether a text is one circular plot, "X,Y,R", and no file.
[[nodiscard]] bool is_plot_text(const std::string& given);

// One circle "X,Y,R", or a .csv with the columns id (may be absent), x, y and radius_m. Also any
// vector file that GDAL reads (GeoPackage, GeoJSON, Shapefile), with polygons, or with points and a
// column radius_m. Of several layers it is `plots`, or else the first. Coordinates of a text or
// .csv are those of `system` ("EPSG:3067" or WKT; empty: a local frame). Those of another file are
// brought there from its own system. Throws InputError where the file cannot be read, holds no
// plots, or an id twice. So it does for a radius that is not over 0, a coordinate that is no
// number, and an outline without an area. Where only one of both systems is known, it throws, too.
[[nodiscard]] std::vector<PlotOutline> read_plots(const std::string& given,
                                                  const std::string& system);

// The same checks of a file whose coordinates are not brought to any system yet.
void check_plots(const std::string& given);

}  // namespace understory
