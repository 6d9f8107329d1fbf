#include "understory/georeference/systems/default_system.h"

#include <array>
#include <vector>

#include "understory/georeference/systems/coordinate_system.h"

namespace understory {
namespace {

struct Corner {
  double longitude_deg;
  double latitude_deg;
};

// Anticlockwise from the end of the border with Sweden in the Gulf of Bothnia. EPSG:3067's own box
// holds Tallinn and Saint Petersburg.
constexpr std::array<Corner, 78> kFinland = {{
    {24.140, 65.530}, {24.120, 65.770}, {24.150, 65.825}, {24.1395, 65.8425}, {24.126, 65.855},
    {24.105, 65.890}, {24.040, 65.955}, {23.985, 66.030}, {23.900, 66.150},   {23.670, 66.220},
    {23.645, 66.310}, {23.700, 66.400}, {23.860, 66.560}, {23.945, 66.790},   {23.590, 66.950},
    {23.570, 67.160}, {23.760, 67.300}, {23.740, 67.420}, {23.480, 67.450},   {23.520, 67.880},
    {23.660, 67.950}, {23.480, 68.040}, {23.150, 68.160}, {23.060, 68.300},   {22.830, 68.390},
    {22.470, 68.443}, {22.050, 68.480}, {21.700, 68.600}, {21.400, 68.700},   {20.900, 68.900},
    {20.549, 69.060}, {21.060, 69.040}, {21.070, 69.220}, {21.280, 69.315},   {21.630, 69.280},
    {22.350, 68.840}, {23.050, 68.690}, {23.770, 68.820}, {24.150, 68.800},   {24.900, 68.560},
    {25.130, 68.650}, {25.640, 68.890}, {25.750, 69.000}, {25.720, 69.250},   {25.970, 69.610},
    {26.470, 69.940}, {27.000, 69.912}, {27.550, 70.060}, {27.950, 70.093},   {28.350, 69.830},
    {29.140, 69.700}, {29.310, 69.650}, {28.830, 69.220}, {28.930, 69.050},   {28.430, 68.900},
    {28.800, 68.870}, {28.460, 68.540}, {28.650, 68.200}, {29.330, 68.070},   {29.660, 67.800},
    {30.020, 67.670}, {29.070, 66.960}, {29.100, 66.850}, {30.140, 65.660},   {29.700, 65.300},
    {29.640, 64.930}, {30.050, 64.780}, {30.050, 64.400}, {30.550, 64.220},   {29.980, 63.750},
    {31.230, 63.200}, {31.590, 62.910}, {31.200, 62.480}, {28.830, 61.130},   {27.750, 60.500},
    {26.500, 60.000}, {22.900, 59.630}, {21.000, 59.500},
}};
constexpr std::array<Corner, 7> kSea = {{
    {19.200, 59.700},
    {19.080, 60.200},
    {19.300, 60.750},
    {20.600, 61.300},
    {20.600, 63.250},
    {21.400, 63.650},
    {23.500, 65.000},
}};

constexpr std::array<const char*, 2> kWorldGeoids = {"3855", "5773"};  // EGM2008, EGM96

}  // namespace

bool is_in_finland(const GeodeticPlace& place) {
  std::vector<Corner> outline(kFinland.begin(), kFinland.end());
  outline.insert(outline.end(), kSea.begin(), kSea.end());
  bool inside = false;
  for (std::size_t i = 0, j = outline.size() - 1; i < outline.size(); j = i++) {
    const Corner& a = outline[i];
    const Corner& b = outline[j];
    if ((a.latitude_deg > place.latitude_deg) == (b.latitude_deg > place.latitude_deg)) continue;
    const double at = a.longitude_deg + (b.longitude_deg - a.longitude_deg) *
                                            (place.latitude_deg - a.latitude_deg) /
                                            (b.latitude_deg - a.latitude_deg);
    if (place.longitude_deg < at) inside = !inside;
  }
  return inside;
}

std::string with_heights(const std::string& definition, const GeodeticPlace& place,
                         HeightWish heights) {
  if (heights == HeightWish::kEllipsoid) return definition;
  const CoordinateSystem plane(definition);
  if (!plane.vertical_name().empty()) return definition;
  const std::string code = plane.code();
  if (code.empty()) return definition;
  std::vector<std::string> parts(kWorldGeoids.begin(), kWorldGeoids.end());
  if (is_in_finland(place)) parts.insert(parts.begin(), "3900");  // N2000
  for (const std::string& part : parts) {
    std::string whole = code;
    whole += "+" + part;
    if (CoordinateSystem(whole).follows_heights(place)) return whole;
  }
  return definition;
}

std::string default_system(const GeodeticPlace& place, HeightWish heights) {
  return with_heights(is_in_finland(place) ? "EPSG:3067" : utm_zone(place), place, heights);
}

}  // namespace understory
